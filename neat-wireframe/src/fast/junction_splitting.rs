//! Junctions too close together for the field to tell apart: the detections see
//! them side by side.
//!
//! The ends that a field proposes scatter by several hundredths of the scene, so
//! one mode of their density may stand for several corners. Their 2D ends do not
//! scatter: for each corner they agree on a point in space to a fraction of a
//! pixel. Sequential consensus finds these points: the point that most views agree
//! on, then the next one among the ends that are left. A second point counts only
//! if it projects farther from the first than noise explains and a good share of
//! the views that show the one or the other show it, so that noise and outliers
//! around one corner do not make two of it. Detectors join what lies a few pixels
//! apart: most views show only one of the two, so none is asked to show both.

use crate::ViewObservation;
use crate::index::PointIndex;
use crate::projection::project_in_front;
use crate::triangulation::{JunctionObservation, TriangulationConfig, triangulate};
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::Camera;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Pairs of ends that are triangulated to find a point.
const HYPOTHESES: usize = 200;
/// Points of one mode at most.
const MAX_JUNCTIONS: usize = 4;
/// An end agrees with a point within this multiple of the scene's noise …
const INLIER_RADIUS_IN_SIGMAS: f64 = 4.0;
/// … but at least this …
const MIN_INLIER_RADIUS_IN_PIXELS: f64 = 0.5;
/// … and at most this.
const MAX_INLIER_RADIUS_IN_PIXELS: f64 = 2.0;
/// Two points of a mode project this many radii apart, in the median view …
const MIN_SEPARATION_IN_RADII: f64 = 3.0;
/// … and the rarer is seen in this share of the views of the other.
const MIN_SHARE_OF_VIEWS: f64 = 0.25;
/// Cosine of the angle between two sight lines that fix a point, at most.
const MAX_COSINE: f64 = 0.98;

/// The junctions after splitting.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SplitJunctions {
    /// The given junctions, some moved, then those split off.
    pub junctions: Vec<Vector3<f64>>,
    /// Pairs `[a, b]`, a < b, that the images tell apart: not to be merged for lying
    /// close together.
    pub told_apart: BTreeSet<[usize; 2]>,
}

/// Splits every junction into the points that its 2D ends agree on.
///
/// - `observations`: for every junction the ends of its neighbourhood.
/// - `required_views`: how many views a point needs, at least two.
///
/// A junction that is not split stays where it is.
///
/// # Panics
/// If there is not one list of observations per junction, or one names a view that
/// does not exist.
pub fn split_junctions(
    junctions: &[Vector3<f64>],
    observations: &[Vec<JunctionObservation>],
    views: &[ViewObservation],
    required_views: usize,
    triangulation: &TriangulationConfig,
) -> SplitJunctions {
    let sigma = noise_in_pixels(junctions, observations, views);
    let splitter = Splitter {
        views,
        required_views: required_views.max(2),
        inlier_radius: (INLIER_RADIUS_IN_SIGMAS * sigma)
            .clamp(MIN_INLIER_RADIUS_IN_PIXELS, MAX_INLIER_RADIUS_IN_PIXELS),
        triangulation,
    };
    let index = PointIndex::new(junctions.to_vec());
    let points: Vec<Vec<Vector3<f64>>> = (0..junctions.len())
        .into_par_iter()
        .map(|junction| {
            let mut of_junction = observations[junction].clone();
            // Views are counted by runs of the same one.
            of_junction.sort_by_key(|seen| seen.view);
            // A stray end of a neighbour may be the neighbour found once more.
            let is_own = |point: &Vector3<f64>| {
                let distance = (point - junctions[junction]).norm();
                let nearest = index.nearest_within(point, distance);
                nearest.is_none_or(|nearest| nearest.index == junction)
            };
            splitter.points_of(&of_junction, is_own)
        })
        .collect();
    let mut split = SplitJunctions {
        junctions: junctions.to_vec(),
        told_apart: BTreeSet::new(),
    };
    for (junction, points) in points.into_iter().enumerate() {
        let mut points = points.into_iter();
        let Some(first) = points.next() else {
            continue;
        };
        split.junctions[junction] = first;
        let mut same_mode = vec![junction];
        for point in points {
            let new = split.junctions.len();
            split.junctions.push(point);
            split
                .told_apart
                .extend(same_mode.iter().map(|other| [*other, new]));
            same_mode.push(new);
        }
    }
    split
}

/// Standard deviation of a coordinate of the ends that belong to a junction: of
/// every junction the lower quartile of its ends' distances (many ends are those
/// of fragments and of other junctions), of these the median.
fn noise_in_pixels(
    junctions: &[Vector3<f64>],
    observations: &[Vec<JunctionObservation>],
    views: &[ViewObservation],
) -> f64 {
    /// Lower quartile of the length of a standard normal vector in the plane.
    const QUARTILE_OF_RAYLEIGH: f64 = 0.7585;
    let mut quartiles: Vec<f64> = junctions
        .iter()
        .zip(observations)
        .filter_map(|(junction, observations)| {
            let mut distances: Vec<f64> = observations
                .iter()
                .filter_map(|seen| {
                    let pixel = project_in_front(&views[seen.view].camera, junction)?;
                    Some((pixel - seen.pixel).norm())
                })
                .collect();
            distances.sort_by(f64::total_cmp);
            distances.get(distances.len() / 4).copied()
        })
        .collect();
    quartiles.sort_by(f64::total_cmp);
    let middle = quartiles.get(quartiles.len() / 2);
    middle.map_or(0.0, |quartile| quartile / QUARTILE_OF_RAYLEIGH)
}

struct Splitter<'a> {
    views: &'a [ViewObservation],
    required_views: usize,
    inlier_radius: f64,
    triangulation: &'a TriangulationConfig,
}

impl Splitter<'_> {
    /// The points that the ends, sorted by view, agree on, if there are two or more
    /// that the images tell apart; the one with most views first.
    fn points_of(
        &self,
        observations: &[JunctionObservation],
        is_own: impl Fn(&Vector3<f64>) -> bool,
    ) -> Vec<Vector3<f64>> {
        let mut left = observations.to_vec();
        let mut points: Vec<Vector3<f64>> = Vec::new();
        for _ in 0..MAX_JUNCTIONS {
            let Some(point) = self.consensus(&left) else {
                break;
            };
            left.retain(|seen| self.distance(seen, &point) >= self.inlier_radius);
            let apart = |other: &Vector3<f64>| self.are_apart(observations, other, &point);
            if is_own(&point) && points.iter().all(apart) {
                points.push(point);
            }
        }
        if points.len() < 2 {
            points.clear();
        }
        points
    }

    /// The point that most views agree on, refined; `None` if too few do.
    fn consensus(&self, observations: &[JunctionObservation]) -> Option<Vector3<f64>> {
        let mut best: Option<(usize, Vector3<f64>)> = None;
        for [a, b] in spread_pairs(observations.len(), HYPOTHESES) {
            let (a, b) = (&observations[a], &observations[b]);
            let Some(point) = self.intersect(a, b) else {
                continue;
            };
            let views = self.agreeing(observations, &point).1;
            if best.is_none_or(|(most, _)| views > most) {
                best = Some((views, point));
            }
        }
        let (_, mut point) = best?;
        for _ in 0..2 {
            let (inliers, _) = self.agreeing(observations, &point);
            point = triangulate(&point, &inliers, self.views, &self.precise());
        }
        let (_, views) = self.agreeing(observations, &point);
        (views >= self.required_views).then_some(point)
    }

    /// Triangulation that starts with inliers only: no annealing.
    fn precise(&self) -> TriangulationConfig {
        TriangulationConfig {
            cauchy_scale_in_pixels: 0.5 * self.inlier_radius,
            initial_scale_factor: 1.0,
            ..self.triangulation.clone()
        }
    }

    /// The ends within the inlier radius of the projected point, and their number
    /// of views. Ends of one view stand together.
    fn agreeing(
        &self,
        observations: &[JunctionObservation],
        point: &Vector3<f64>,
    ) -> (Vec<JunctionObservation>, usize) {
        let inliers: Vec<_> = observations
            .iter()
            .filter(|seen| self.distance(seen, point) < self.inlier_radius)
            .copied()
            .collect();
        let views = inliers.chunk_by(|a, b| a.view == b.view).count();
        (inliers, views)
    }

    /// Whether the images can tell two points apart: in the median of the views
    /// that show either, they project farther from each other than noise explains,
    /// and the rarer one is seen often enough beside the other.
    fn are_apart(
        &self,
        observations: &[JunctionObservation],
        a: &Vector3<f64>,
        b: &Vector3<f64>,
    ) -> bool {
        let (of_a, views_of_a) = self.agreeing(observations, a);
        let (of_b, views_of_b) = self.agreeing(observations, b);
        let mut separations: Vec<f64> = of_a
            .iter()
            .chain(&of_b)
            .filter_map(|seen| {
                let camera = self.camera(seen);
                Some((project_in_front(camera, a)? - project_in_front(camera, b)?).norm())
            })
            .collect();
        separations.sort_by(f64::total_cmp);
        let median = separations.get(separations.len() / 2);
        let limit = MIN_SEPARATION_IN_RADII * self.inlier_radius;
        let (few, many) = (views_of_a.min(views_of_b), views_of_a.max(views_of_b));
        median.is_some_and(|median| *median > limit)
            && few as f64 >= MIN_SHARE_OF_VIEWS * many as f64
    }

    fn camera(&self, observation: &JunctionObservation) -> &Camera {
        &self.views[observation.view].camera
    }

    fn distance(&self, observation: &JunctionObservation, point: &Vector3<f64>) -> f64 {
        project_in_front(self.camera(observation), point)
            .map_or(f64::INFINITY, |pixel| (pixel - observation.pixel).norm())
    }

    /// The point nearest to two sight lines, unless they are nearly parallel.
    fn intersect(&self, a: &JunctionObservation, b: &JunctionObservation) -> Option<Vector3<f64>> {
        let sight_line = |seen: &JunctionObservation| {
            let camera = self.camera(seen);
            (camera.center_in_world, direction(camera, &seen.pixel))
        };
        let ((origin_a, a), (origin_b, b)) = (sight_line(a), sight_line(b));
        if a.dot(&b).abs() > MAX_COSINE {
            return None;
        }
        let off_line = |d: &Vector3<f64>| Matrix3::identity() - d * d.transpose();
        let (off_a, off_b) = (off_line(&a), off_line(&b));
        (off_a + off_b)
            .cholesky()
            .map(|factor| factor.solve(&(off_a * origin_a + off_b * origin_b)))
    }
}

fn direction(camera: &Camera, pixel: &Vector2<f64>) -> Vector3<f64> {
    camera.ray_through(pixel).direction.normalize()
}

/// At most `count` different pairs below `n`, as if drawn at random, the same ones
/// every time.
fn spread_pairs(n: usize, count: usize) -> impl Iterator<Item = [usize; 2]> {
    let all = n * n.saturating_sub(1) / 2;
    // Steps by the golden ratio land far from all earlier ones; a step without a
    // common divisor meets every pair before it returns to one.
    let golden = (0.618 * all as f64) as usize;
    let step = (golden.max(1)..).find(|step| greatest_common_divisor(*step, all) == 1);
    let step = step.unwrap_or(1);
    (0..all.min(count)).map(move |i| {
        let pair = i * step % all;
        // Pairs by their larger member: 01 02 12 03 13 23 …
        let mut larger = ((1.0 + (1.0 + 8.0 * pair as f64).sqrt()) / 2.0) as usize;
        while larger * (larger - 1) / 2 > pair {
            larger -= 1;
        }
        [pair - larger * (larger - 1) / 2, larger]
    })
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 {
        a
    } else {
        greatest_common_divisor(b, a % b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere};

    /// Noisy ends at corners, seen in turn: view `i` shows corner `i % corners`.
    fn seen_in_turn(
        corners: &[Vector3<f64>],
        noise_in_pixels: f64,
    ) -> (Vec<ViewObservation>, Vec<JunctionObservation>) {
        let mut noise = Noise(9);
        let views: Vec<_> = cameras_on_sphere(40)
            .into_iter()
            .map(|camera| ViewObservation {
                camera,
                segments: Vec::new(),
                junctions: Vec::new(),
            })
            .collect();
        let observations = views
            .iter()
            .enumerate()
            .map(|(view, observation)| {
                let corner = &corners[view % corners.len()];
                let pixel = project_in_front(&observation.camera, corner).unwrap();
                JunctionObservation {
                    view,
                    pixel: pixel + noise_in_pixels * noise.vector().xy(),
                    weight: 1.0,
                }
            })
            .collect();
        (views, observations)
    }

    fn split(
        junction: Vector3<f64>,
        observations: Vec<JunctionObservation>,
        views: &[ViewObservation],
    ) -> SplitJunctions {
        split_junctions(
            &[junction],
            &[observations],
            views,
            5,
            &TriangulationConfig::default(),
        )
    }

    #[test]
    fn two_corners_four_pixels_apart_are_found() {
        let corners = [Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.3, 0.115, 0.2)];
        // Two more junctions, without neighbours, show how noisy ends are.
        let others = [Vector3::new(-0.4, 0.0, 0.1), Vector3::new(0.0, -0.3, 0.1)];
        let (views, of_pair) = seen_in_turn(&corners, 0.1);
        let [a, b] = others.map(|other| seen_in_turn(&[other], 0.1).1);
        let found = split_junctions(
            &[others[0], (corners[0] + corners[1]) / 2.0, others[1]],
            &[a, of_pair, b],
            &views,
            5,
            &TriangulationConfig::default(),
        );
        assert_eq!(found.told_apart, BTreeSet::from([[1, 3]]));
        assert_eq!([found.junctions[0], found.junctions[2]], others);
        for corner in &corners {
            let nearest = found.junctions.iter().map(|x| (x - corner).norm());
            let nearest = nearest.min_by(f64::total_cmp).unwrap();
            assert!(nearest < 3e-4, "{nearest}");
        }
    }

    #[test]
    fn what_noise_explains_stays_one_junction_in_its_place() {
        let near = [Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.3, 0.104, 0.2)];
        for corners in [&near[..], &near[..1]] {
            for noise in [0.1, 1.0] {
                let (views, mut observations) = seen_in_turn(corners, noise);
                for outlier in [3, 17, 30] {
                    observations[outlier].pixel.x += 9.0;
                }
                let found = split(near[0], observations, &views);
                assert_eq!(found.junctions, [near[0]]);
                assert!(found.told_apart.is_empty());
            }
        }
    }

    #[test]
    fn stray_ends_of_a_neighbour_do_not_make_it_twice() {
        let corners = [Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.3, 0.15, 0.2)];
        let (views, observations) = seen_in_turn(&corners, 0.1);
        let found = split_junctions(
            &corners,
            &[observations, Vec::new()],
            &views,
            5,
            &TriangulationConfig::default(),
        );
        assert_eq!(found.junctions.len(), 2);
        assert_eq!(found.junctions, corners);
    }

    #[test]
    fn nothing_is_split_off_nothing() {
        let found = split(Vector3::x(), Vec::new(), &[]);
        assert_eq!(found.junctions, [Vector3::x()]);
        let pairs: Vec<_> = spread_pairs(4, 100).collect();
        let unique: BTreeSet<_> = pairs.iter().copied().collect();
        assert_eq!((pairs.len(), unique.len()), (6, 6));
        assert_eq!(spread_pairs(1, 9).count() + spread_pairs(0, 9).count(), 0);
        for n in 2..500 {
            let pairs: Vec<_> = spread_pairs(n, 200).collect();
            let unique: BTreeSet<_> = pairs.iter().copied().collect();
            assert_eq!(unique.len(), pairs.len(), "{n}");
            assert!(pairs.iter().all(|[a, b]| a < b && *b < n), "{n}");
            let members: BTreeSet<_> = pairs.iter().flatten().collect();
            assert!(members.len() >= n.min(64), "{n}: {}", members.len());
        }
    }
}
