//! The baseline: 3D segments by the plain scheme of Hofer, Maurer and Bischof,
//! *Efficient 3D scene abstraction using line segments* (Line3D++, 2017), without
//! the images, junctions and adjustment of [`super::assemble`].
//!
//! The constants are those of the program that its authors published, where this
//! has the same.
//!
//! | step of theirs | here |
//! | --- | --- |
//! | ten neighbouring views by sparse points in common | by shared sight of points in the scene ball |
//! | partners by epipolar overlap of at least 0.25, the ten best per view | all of them |
//! | scores of hypotheses by angle (10°) and distance (2.5 pixels) in space, one partner per view | by distances in the partner's image |
//! | the best hypothesis of every 2D segment, of score at least 0.75 | the weighted mean of the partners that agree, of score above 1 and in enough views |
//! | affinity of partners, the smaller of both ways, at least 0.5 | the same, with distances in the images |
//! | clusters by Felzenszwalb and Huttenlocher's segmentation, scale 3 | the same |
//! | a line through a cluster, parts that three views show | by the principal axis of all end points |
//! | optional diffusion, collinearity and bundle adjustment | left out |

use super::graph_segmentation::{Link, segment_graph};
use super::hypothesis_scoring::{Hypothesis, Scoring, score_hypotheses};
use super::neighbours::neighbours;
use super::projected_line::ProjectedLine;
use super::view_segments::{PreparedView, SegmentId, segment_of};
use crate::{ViewObservation, Wireframe3d};
use nalgebra::{Matrix3, Vector3};
use neat_core::LineSegment3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Names a 2D segment of the observations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct SegmentSupport {
    /// Index of the view.
    pub view: usize,
    /// Index into that view's [`ViewObservation::segments`].
    pub segment_in_view: usize,
}

/// Settings of [`line3d`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Line3dConfig {
    /// Views that must show a segment, at least 2.
    pub min_views: usize,
    /// Shorter 2D segments are passed over.
    pub min_segment_length_in_pixels: f64,
    /// Structure lies within the scene ball times this.
    pub ball_margin: f64,
    /// Which views are compared.
    pub neighbours: usize,
    /// Standard deviation of the distance of two images of one segment.
    pub sigma_in_pixels: f64,
    /// Standard deviation of the angle between two positions of one segment.
    pub sigma_in_degrees: f64,
    /// Partners that are less alike, from 0 to 1, are not linked.
    pub min_affinity: f64,
    /// The larger, the larger the clusters.
    pub clustering_scale: f64,
}

impl Default for Line3dConfig {
    fn default() -> Self {
        Self {
            min_views: 3,
            min_segment_length_in_pixels: 8.0,
            ball_margin: 1.5,
            neighbours: 10,
            sigma_in_pixels: 2.5,
            sigma_in_degrees: 10.0,
            min_affinity: 0.5,
            clustering_scale: 3.0,
        }
    }
}

/// A 3D segment with the 2D segments that it was made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Line3dSegment {
    /// In the world of the cameras.
    pub segment: LineSegment3,
    /// The 2D segments of its cluster, ascending.
    pub supports: Vec<SegmentSupport>,
    /// Number of different views among them.
    pub views: usize,
}

/// The segments as a wireframe in which no two share a junction: segment i joins
/// junctions 2 i and 2 i + 1.
pub fn wireframe_of_segments(segments: &[Line3dSegment]) -> Wireframe3d {
    Wireframe3d {
        junctions: segments.iter().flat_map(|s| s.segment.ends()).collect(),
        edges: (0..segments.len()).map(|i| [2 * i, 2 * i + 1]).collect(),
    }
}

/// Reconstructs 3D segments from the 2D segments of posed views.
///
/// `scene_radius` is the radius of the ball around the world's origin in which the
/// structure lies. The result is empty where nothing can be built: too few usable
/// views, a radius that is not a positive number. It does not depend on the number
/// of threads.
pub fn line3d(
    observations: &[ViewObservation],
    scene_radius: f64,
    config: &Line3dConfig,
) -> Vec<Line3dSegment> {
    if !(scene_radius.is_normal() && scene_radius > 0.0) {
        return Vec::new();
    }
    let min_views = config.min_views.max(2);
    let views: Vec<PreparedView> = observations
        .par_iter()
        .map(|observation| {
            let length = config.min_segment_length_in_pixels;
            PreparedView::new(observation, scene_radius.recip(), length)
        })
        .collect();
    let neighbours = neighbours(&views, config.ball_margin, config.neighbours);
    let scoring = Scoring {
        // Agreement ends at two standard deviations.
        tolerance_in_pixels: 2.0 * config.sigma_in_pixels,
        alternatives: 1,
    };
    let alternatives = score_hypotheses(
        &views,
        &neighbours,
        None,
        config.ball_margin,
        min_views,
        &scoring,
    );
    let positioned: Vec<Positioned> = (alternatives.into_iter().enumerate())
        .flat_map(|(view, lists)| {
            let best = lists.into_iter().enumerate();
            best.filter_map(move |(segment, list)| {
                Some((SegmentId { view, segment }, list.into_iter().next()?))
            })
        })
        .map(|(id, hypothesis)| Positioned {
            id,
            line: views[id.view].back_project(id.segment, hypothesis.depths),
            hypothesis,
        })
        .collect();
    let clusters = segment_graph(
        positioned.len(),
        links(&views, &positioned, config),
        config.clustering_scale,
    );
    let mut members: BTreeMap<usize, Vec<&Positioned>> = BTreeMap::new();
    for (cluster, positioned) in clusters.iter().zip(&positioned) {
        members.entry(*cluster).or_default().push(positioned);
    }
    members
        .values()
        .flat_map(|members| segments_of_cluster(&views, members, min_views))
        .map(|found| Line3dSegment {
            segment: found.segment.map(|end| end * scene_radius),
            ..found
        })
        .collect()
}

/// A 2D segment at its best 3D position.
struct Positioned {
    id: SegmentId,
    line: LineSegment3,
    hypothesis: Hypothesis,
}

/// The partners that are alike enough, in both directions.
fn links(views: &[PreparedView], positioned: &[Positioned], config: &Line3dConfig) -> Vec<Link> {
    let index_of = |id: SegmentId| positioned.binary_search_by_key(&id, |p| p.id).ok();
    let found: Vec<Vec<Link>> = positioned
        .par_iter()
        .enumerate()
        .map(|(a, first)| {
            (first.hypothesis.supports.iter())
                .filter_map(|support| index_of(support.id))
                .filter_map(|b| {
                    let affinity = affinity(views, first, &positioned[b], config);
                    (affinity >= config.min_affinity).then_some(Link {
                        nodes: [a.min(b), a.max(b)],
                        weight: 1.0 - affinity,
                    })
                })
                .collect()
        })
        .collect();
    found.into_iter().flatten().collect()
}

/// From 0 to 1: how near each position lies to the other's 2D segment, and how
/// parallel the two are.
fn affinity(views: &[PreparedView], a: &Positioned, b: &Positioned, config: &Line3dConfig) -> f64 {
    let [u, v] = [a, b].map(|p| (p.line.end - p.line.start).normalize());
    let degrees = u.dot(&v).abs().min(1.0).acos().to_degrees();
    let bell = |x: f64, sigma: f64| (-0.5 * (x / sigma).powi(2)).exp();
    let seen = |line: &LineSegment3, id: SegmentId| {
        ProjectedLine::new(&views[id.view].camera, line).map_or(0.0, |line| {
            let distance = line.segment_distance(&segment_of(views, id).segment);
            bell(distance, config.sigma_in_pixels)
        })
    };
    let alike = seen(&a.line, b.id)
        .min(seen(&b.line, a.id))
        .min(bell(degrees, config.sigma_in_degrees));
    if alike.is_finite() { alike } else { 0.0 }
}

/// The line through all ends of a cluster, where enough views show it.
fn segments_of_cluster(
    views: &[PreparedView],
    members: &[&Positioned],
    min_views: usize,
) -> Vec<Line3dSegment> {
    let mut of_views: Vec<usize> = members.iter().map(|member| member.id.view).collect();
    of_views.dedup();
    if of_views.len() < min_views {
        return Vec::new();
    }
    let ends: Vec<Vector3<f64>> = members.iter().flat_map(|m| m.line.ends()).collect();
    let center = ends.iter().sum::<Vector3<f64>>() / ends.len() as f64;
    let scatter: Matrix3<f64> = ends
        .iter()
        .map(|end| (end - center) * (end - center).transpose())
        .sum();
    if !scatter.iter().all(|x| x.is_finite()) {
        return Vec::new();
    }
    let eigen = scatter.symmetric_eigen();
    let direction = eigen
        .eigenvectors
        .column(eigen.eigenvalues.imax())
        .into_owned();
    let shown: Vec<(usize, [f64; 2])> = members
        .iter()
        .map(|member| {
            let [s, t] = (member.line.ends()).map(|end| (end - center).dot(&direction));
            (member.id.view, [s.min(t), s.max(t)])
        })
        .collect();
    let supports: Vec<SegmentSupport> = members
        .iter()
        .map(|member| SegmentSupport {
            view: member.id.view,
            segment_in_view: segment_of(views, member.id).segment_in_view,
        })
        .collect();
    parts_of_many_views(shown, min_views)
        .into_iter()
        .map(|[low, high]| Line3dSegment {
            segment: LineSegment3::new(center + low * direction, center + high * direction),
            supports: supports.clone(),
            views: of_views.len(),
        })
        .collect()
}

/// The parts of a line that at least `min_views` views show, ascending.
fn parts_of_many_views(shown: Vec<(usize, [f64; 2])>, min_views: usize) -> Vec<[f64; 2]> {
    let mut steps: Vec<(f64, bool, usize)> = shown
        .into_iter()
        .flat_map(|(view, [low, high])| [(low, false, view), (high, true, view)])
        .collect();
    // Where one interval ends and another begins at one place there is no gap.
    steps.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut open: BTreeMap<usize, usize> = BTreeMap::new();
    let mut begin = None;
    let mut parts = Vec::new();
    for (place, ends, view) in steps {
        if ends {
            if let Some(count) = open.get_mut(&view) {
                *count -= 1;
                if *count == 0 {
                    open.remove(&view);
                }
            }
            if open.len() < min_views
                && let Some(low) = begin.take()
                && place > low
            {
                parts.push([low, place]);
            }
        } else {
            *open.entry(view).or_default() += 1;
            if open.len() >= min_views && begin.is_none() {
                begin = Some(place);
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::{cube_edge, end_distance};
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};

    fn observations(noise_in_pixels: f64) -> Vec<ViewObservation> {
        let (junctions, edges) = cube();
        let mut views = views_of_edges(&cameras_on_sphere(20), &junctions, &edges);
        let mut noise = Noise(5);
        for detection in views.iter_mut().flat_map(|view| &mut view.segments) {
            detection.segment.start += noise_in_pixels * noise.vector().xy();
            detection.segment.end += noise_in_pixels * noise.vector().xy();
        }
        views
    }

    #[test]
    fn the_edges_of_a_cube_come_back_without_shared_junctions() {
        for (noise, tolerance) in [(0.0, 1e-3), (0.7, 0.03)] {
            let found = line3d(&observations(noise), 1.0, &Line3dConfig::default());
            for edge in 0..12 {
                let best = found
                    .iter()
                    .map(|line| end_distance(&line.segment, &cube_edge(edge)))
                    .fold(f64::INFINITY, f64::min);
                assert!(best < tolerance, "edge {edge}: {best} at noise {noise}");
            }
            let wireframe = wireframe_of_segments(&found);
            assert_eq!(wireframe.junctions.len(), 2 * found.len());
            for line in &found {
                assert!(line.views >= 3);
                assert!(line.supports.is_sorted());
            }
        }
    }

    #[test]
    fn neither_threads_nor_the_unit_of_length_matter() {
        let views = observations(0.7);
        let config = Line3dConfig::default();
        let with_threads = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| line3d(&views, 1.0, &config))
        };
        let alone = with_threads(1);
        assert_eq!(alone, with_threads(4));
        let mut scaled = views.clone();
        for view in &mut scaled {
            view.camera.center_in_world *= 4.0;
        }
        let scaled = line3d(&scaled, 4.0, &config);
        assert!(
            scaled
                .iter()
                .zip(&alone)
                .all(|(a, b)| a.segment.map(|x| x / 4.0) == b.segment)
        );
    }

    #[test]
    fn nothing_in_nothing_out() {
        let config = Line3dConfig::default();
        assert!(line3d(&[], 1.0, &config).is_empty());
        for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(line3d(&observations(0.0), radius, &config).is_empty());
        }
        assert!(line3d(&observations(0.0)[..2], 1.0, &config).is_empty());
    }

    #[test]
    fn parts_count_every_view_once() {
        let shown = vec![
            (0, [0.0, 2.0]),
            (0, [1.0, 3.0]),
            (1, [0.5, 2.5]),
            (2, [2.0, 4.0]),
            (3, [2.5, 5.0]),
        ];
        assert_eq!(parts_of_many_views(shown.clone(), 3), [[2.0, 3.0]]);
        assert_eq!(parts_of_many_views(shown, 5), [[0.0; 2]; 0]);
    }
}
