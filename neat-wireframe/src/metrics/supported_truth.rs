//! What of a true wireframe the 2D input supports: a fair yardstick for results
//! that can only know what was detected.
//!
//! An edge is supported if detections lie along most of it in enough views.
//! Where supported edges run straight through a junction, and nothing else that is
//! supported ends there, no image shows the junction: the edge goes on. Junctions
//! that lie within the resolution of all images are one.
//!
//! Visibility is not asked for, so a hidden edge counts where detections happen to
//! lie on its projection: the yardstick is too strict there, never too lenient.

use crate::interval_cover::covered_length;
use crate::projection::project_in_front;
use crate::used_junctions::UsedJunctions;
use crate::{ViewObservation, Wireframe3d};
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment2;
use neat_core::ground_truth::Curve;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Settings of [`supported_truth`].
#[derive(Clone, Debug, PartialEq)]
pub struct SupportedTruthConfig {
    /// Detections lie on an edge within this distance of its projected line.
    pub max_distance_in_pixels: f64,
    /// Share of the projected edge that detections must cover.
    pub min_coverage: f64,
    /// Edges that turn less than this at a junction go straight on.
    pub max_turn_in_degrees: f64,
    /// Junctions never farther apart than this in any image are one.
    pub resolution_in_pixels: f64,
}

impl Default for SupportedTruthConfig {
    fn default() -> Self {
        Self {
            max_distance_in_pixels: 2.0,
            min_coverage: 0.5,
            max_turn_in_degrees: 2.0,
            resolution_in_pixels: 2.0,
        }
    }
}

/// The number of views that must support an edge in a scene of `views` views, a
/// fifth of them, but 2 to 5 (the paper's visibility check asks for 5 of some 50).
pub fn required_views(views: usize) -> usize {
    const SHARE: f64 = 0.2;
    let share = (SHARE * views as f64).round_ties_even();
    (share as usize).clamp(2, 5)
}

/// The part of `truth` that detections support in at least `required_views`
/// views, without junctions that have no supported edge.
///
/// # Panics
/// If an edge names a junction that does not exist.
pub fn supported_truth(
    truth: &Wireframe3d,
    views: &[ViewObservation],
    required_views: usize,
    config: &SupportedTruthConfig,
) -> Wireframe3d {
    let supported: Vec<[usize; 2]> = truth
        .edges
        .par_iter()
        .filter(|edge| {
            let [a, b] = edge.map(|junction| truth.junctions[junction]);
            let covered = |view: &&ViewObservation| is_covered(view, &a, &b, config);
            views.iter().filter(covered).count() >= required_views
        })
        .copied()
        .collect();
    let representative = merge_unresolved(&truth.junctions, views, config);
    let edges: BTreeSet<[usize; 2]> = supported
        .into_iter()
        .map(|edge| sorted(edge.map(|junction| representative[junction])))
        .filter(|[a, b]| a != b)
        .collect();
    let edges = dissolve_straight(&truth.junctions, edges, config);
    let used = UsedJunctions::new(truth.junctions.len(), edges.iter());
    let mut junctions = truth.junctions.clone();
    used.retain(&mut junctions);
    Wireframe3d {
        junctions,
        edges: edges.into_iter().map(|edge| used.renamed(edge)).collect(),
    }
}

fn sorted([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

/// Whether detections along the projected edge cover enough of it.
fn is_covered(
    view: &ViewObservation,
    a: &Vector3<f64>,
    b: &Vector3<f64>,
    config: &SupportedTruthConfig,
) -> bool {
    let projected = Option::zip(
        project_in_front(&view.camera, a),
        project_in_front(&view.camera, b),
    );
    let Some((start, end)) = projected else {
        return false;
    };
    let edge = LineSegment2::new(start, end);
    let covered = view
        .segments
        .iter()
        .map(|detection| &detection.segment)
        .filter(|detection| {
            let near = |end| edge.distance_to_line(end) < config.max_distance_in_pixels;
            detection.ends().iter().all(near)
        })
        .map(|detection| {
            let [t, u] = detection
                .ends()
                .map(|end| edge.line_parameter(&end).clamp(0.0, 1.0));
            [t.min(u), t.max(u)]
        })
        .collect();
    covered_length(covered, [0.0, 1.0]) >= config.min_coverage
}

/// For every junction the first one that stands for itself and from which no image
/// tells it apart.
fn merge_unresolved(
    junctions: &[Vector3<f64>],
    views: &[ViewObservation],
    config: &SupportedTruthConfig,
) -> Vec<usize> {
    let pixels: Vec<Vec<Option<Vector2<f64>>>> = junctions
        .par_iter()
        .map(|junction| {
            let views = views.iter();
            let pixels = views.map(|view| project_in_front(&view.camera, junction));
            pixels.collect()
        })
        .collect();
    let same = |a: usize, b: usize| {
        let mut distances = (pixels[a].iter().zip(&pixels[b]))
            .filter_map(|(a, b)| Some((a.as_ref()? - b.as_ref()?).norm()))
            .peekable();
        // What no view shows is told apart by none.
        distances.peek().is_some() && distances.all(|d| d < config.resolution_in_pixels)
    };
    let mut kept: Vec<usize> = Vec::new();
    (0..junctions.len())
        .map(|junction| {
            let representative = kept.iter().copied().find(|other| same(*other, junction));
            representative.unwrap_or_else(|| {
                kept.push(junction);
                junction
            })
        })
        .collect()
}

/// Joins pairs of edges that run straight through a junction without others.
fn dissolve_straight(
    junctions: &[Vector3<f64>],
    mut edges: BTreeSet<[usize; 2]>,
    config: &SupportedTruthConfig,
) -> BTreeSet<[usize; 2]> {
    let max_cosine = -config.max_turn_in_degrees.to_radians().cos();
    for middle in 0..junctions.len() {
        let here: Vec<[usize; 2]> = edges
            .iter()
            .filter(|edge| edge.contains(&middle))
            .copied()
            .collect();
        let [first, second] = here[..] else {
            continue;
        };
        let other_end = |[a, b]: [usize; 2]| if a == middle { b } else { a };
        let (a, b) = (other_end(first), other_end(second));
        let direction = |end: usize| (junctions[end] - junctions[middle]).normalize();
        if direction(a).dot(&direction(b)) <= max_cosine {
            edges.remove(&first);
            edges.remove(&second);
            edges.insert(sorted([a, b]));
        }
    }
    edges
}

/// A result without its pieces of curved rims.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WithoutCurves {
    /// What is left.
    pub wireframe: Wireframe3d,
    /// Junctions on curves that were left out.
    pub junctions_on_curves: usize,
    /// Edges with both ends on curves that were left out.
    pub edges_on_curves: usize,
}

/// Leaves out what lies on curved edges of the truth: edges with both ends within
/// `distance` of a curve, and junctions there, unless they are as near to a
/// junction of the truth or an edge that stays needs them.
///
/// Straight pieces approximate a curve but are no edges of the true wireframe;
/// they are neither right nor wrong, and to be counted apart.
///
/// # Panics
/// If an edge names a junction that does not exist.
pub fn without_curves(
    predicted: &Wireframe3d,
    truth: &Wireframe3d,
    curves: &[Curve],
    distance: f64,
) -> WithoutCurves {
    let on_curve: Vec<bool> = predicted
        .junctions
        .iter()
        .map(|junction| {
            curves
                .iter()
                .any(|curve| touches(curve, junction, distance))
        })
        .collect();
    let is_true = |edge: &[usize; 2]| {
        truth.edges.iter().any(|true_edge| {
            let ends = edge.map(|junction| predicted.junctions[junction]);
            let near = |[a, b]: [usize; 2]| {
                (ends[0] - truth.junctions[a]).norm() < distance
                    && (ends[1] - truth.junctions[b]).norm() < distance
            };
            near(*true_edge) || near([true_edge[1], true_edge[0]])
        })
    };
    let (left_out, edges): (Vec<[usize; 2]>, Vec<[usize; 2]>) = predicted
        .edges
        .iter()
        .partition(|edge| edge.iter().all(|end| on_curve[*end]) && !is_true(edge));
    let needed: BTreeSet<usize> = edges.iter().flatten().copied().collect();
    let near_truth = |junction: &Vector3<f64>| {
        let distances = truth.junctions.iter().map(|x| (x - junction).norm());
        distances.into_iter().any(|d| d < distance)
    };
    let kept: Vec<usize> = (0..predicted.junctions.len())
        .filter(|&index| {
            !on_curve[index] || needed.contains(&index) || near_truth(&predicted.junctions[index])
        })
        .collect();
    let new_index = |old: usize| kept.partition_point(|index| *index < old);
    WithoutCurves {
        junctions_on_curves: predicted.junctions.len() - kept.len(),
        edges_on_curves: left_out.len(),
        wireframe: Wireframe3d {
            junctions: kept.iter().map(|i| predicted.junctions[*i]).collect(),
            edges: edges.iter().map(|edge| edge.map(new_index)).collect(),
        },
    }
}

fn touches(curve: &Curve, point: &Vector3<f64>, distance: f64) -> bool {
    let segments = curve.points.windows(2);
    segments.into_iter().any(|ends| {
        let segment = neat_core::LineSegment3::new(ends[0], ends[1]);
        let place = segment.line_parameter(point).clamp(0.0, 1.0);
        // A piece without length has no parameter: its end is the nearest point.
        let nearest = if place.is_nan() {
            ends[0]
        } else {
            segment.point_at(place)
        };
        (nearest - point).norm() < distance
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};

    fn cube_wireframe() -> Wireframe3d {
        let (junctions, edges) = cube();
        Wireframe3d { junctions, edges }
    }

    fn supported(truth: &Wireframe3d, views: &[ViewObservation]) -> Wireframe3d {
        supported_truth(truth, views, 5, &SupportedTruthConfig::default())
    }

    #[test]
    fn required_views_are_a_share_of_all() {
        let required = [0, 1, 10, 12, 13, 20, 25, 100].map(required_views);
        assert_eq!(required, [2, 2, 2, 2, 3, 4, 5, 5]);
    }

    #[test]
    fn what_is_detected_everywhere_is_supported_and_the_rest_is_not() {
        let truth = cube_wireframe();
        let cameras = cameras_on_sphere(12);
        let all = views_of_edges(&cameras, &truth.junctions, &truth.edges);
        assert_eq!(supported(&truth, &all), truth);
        // Nothing seen of corner 7.
        let seen: Vec<_> = truth.edges.iter().filter(|e| !e.contains(&7)).collect();
        let seen: Vec<[usize; 2]> = seen.into_iter().copied().collect();
        let views = views_of_edges(&cameras, &truth.junctions, &seen);
        let without_corner = supported(&truth, &views);
        assert_eq!(without_corner.junctions, truth.junctions[..7]);
        assert_eq!(without_corner.edges, seen);
        // Seen in too few views.
        let views = views_of_edges(&cameras[..4], &truth.junctions, &truth.edges);
        assert_eq!(supported(&truth, &views), Wireframe3d::default());
    }

    #[test]
    fn a_junction_that_no_image_shows_joins_its_edges() {
        let truth = cube_wireframe();
        let views = views_of_edges(&cameras_on_sphere(12), &truth.junctions, &truth.edges);
        let mut with_middle = truth.clone();
        let [a, b] = with_middle.edges.remove(0);
        with_middle
            .junctions
            .push((truth.junctions[a] + truth.junctions[b]) / 2.0);
        // Its third edge is not seen.
        with_middle.junctions.push(Vector3::zeros());
        with_middle.edges.extend([[a, 8], [b, 8], [8, 9]]);
        assert_eq!(supported(&with_middle, &views), truth);
    }

    #[test]
    fn junctions_within_the_resolution_are_one() {
        let truth = cube_wireframe();
        let views = views_of_edges(&cameras_on_sphere(12), &truth.junctions, &truth.edges);
        let mut doubled = truth.clone();
        doubled
            .junctions
            .push(truth.junctions[0] + Vector3::new(0.001, 0.002, 0.0));
        doubled.edges.push([0, 8]);
        let last = doubled.edges[2];
        doubled.edges.push([8, last[1]]);
        assert_eq!(supported(&doubled, &views), truth);
    }

    #[test]
    fn a_junction_that_no_view_shows_stands_for_no_other() {
        let mut truth = cube_wireframe();
        // All cameras are within 2.5 and look at the origin.
        let cameras = [cameras_on_sphere(12)[5]; 5];
        let views = views_of_edges(&cameras, &truth.junctions, &truth.edges);
        let behind = 3.0 * cameras[0].center_in_world;
        truth.junctions.insert(0, behind);
        truth.edges.iter_mut().flatten().for_each(|end| *end += 1);
        assert_eq!(supported(&truth, &views), cube_wireframe());
        assert_eq!(supported(&truth, &[]), Wireframe3d::default());
    }

    #[test]
    fn pieces_of_rims_are_counted_apart() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        let rim = |i: usize| {
            let (sin, cos) = (0.2 * i as f64).sin_cos();
            at(cos, sin)
        };
        let curve = Curve {
            kind: "Circle".into(),
            points: (0..=5).map(rim).collect(),
        };
        let truth = Wireframe3d {
            junctions: vec![rim(0), at(2.0, 0.0)],
            edges: vec![[0, 1]],
        };
        let predicted = Wireframe3d {
            junctions: vec![at(2.0, 0.0), rim(0), rim(2), rim(4), at(0.0, 3.0)],
            edges: vec![[0, 1], [1, 2], [2, 3], [3, 4]],
        };
        let counted = without_curves(&predicted, &truth, &[curve], 0.01);
        assert_eq!(counted.edges_on_curves, 2);
        // The last one hangs on an edge that is simply wrong.
        assert_eq!(counted.junctions_on_curves, 1);
        assert_eq!(counted.wireframe.edges, [[0, 1], [2, 3]]);
        let none = without_curves(&predicted, &truth, &[], 0.01);
        assert_eq!(none.wireframe, predicted);
    }
}
