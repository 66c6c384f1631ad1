//! Junctions re-estimated from the 2D ends that belong to them.

use crate::ViewObservation;
use crate::index::{GrowingPointGrid, PointIndex};
use crate::projection::{project_in_front, project_with_jacobian};
use crate::segment_ends::SegmentEnd;
use nalgebra::{Matrix3, Vector2, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// When an end belongs to a junction, in one round of [`retriangulate`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AssociationRound {
    /// Its 3D position must be closer than this to the junction, in world units.
    pub max_distance: f64,
    /// Its 2D end must be closer than this to the projected junction.
    pub max_distance_in_pixels: f64,
}

/// Settings of [`triangulate`] and [`retriangulate`]; lengths in world units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TriangulationConfig {
    /// Association limits, one per round.
    pub rounds: Vec<AssociationRound>,
    /// Final scale of the Cauchy weight.
    pub cauchy_scale_in_pixels: f64,
    /// The scale starts this many times larger and is halved in every iteration
    /// until it is final.
    pub initial_scale_factor: f64,
    /// Gauss-Newton steps.
    pub iterations: usize,
    /// Share of the mean curvature that is added to the diagonal: keeps points
    /// seen under small angles where they are.
    pub damping: f64,
    /// A junction that would move farther stays where it was.
    pub max_move: f64,
    /// Views that must see a junction, where the required support is not less.
    pub min_views: usize,
    /// Of two junctions this close the one seen in more views stays.
    pub separation: f64,
    /// Junctions with a coordinate this large have left the scene.
    pub max_coordinate: f64,
}

impl Default for TriangulationConfig {
    fn default() -> Self {
        Self {
            rounds: vec![
                AssociationRound {
                    max_distance: 0.06,
                    max_distance_in_pixels: 15.0,
                },
                AssociationRound {
                    max_distance: 0.04,
                    max_distance_in_pixels: 8.0,
                },
            ],
            cauchy_scale_in_pixels: 2.0,
            initial_scale_factor: 8.0,
            iterations: 12,
            damping: 1e-3,
            max_move: 0.15,
            min_views: 3,
            separation: 0.02,
            max_coordinate: 2.0,
        }
    }
}

/// A detected 2D junction of one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JunctionObservation {
    /// The view.
    pub view: usize,
    /// Where the junction appears, in image coordinates.
    pub pixel: Vector2<f64>,
    /// How much it counts.
    pub weight: f64,
}

/// Moves `junction` to where it reprojects best: Gauss-Newton on Cauchy-weighted
/// pixel distances whose scale is annealed.
///
/// Returns `junction` itself for fewer than two observations and where the
/// result is not finite or too far away.
pub fn triangulate(
    junction: &Vector3<f64>,
    observations: &[JunctionObservation],
    views: &[ViewObservation],
    config: &TriangulationConfig,
) -> Vector3<f64> {
    if observations.len() < 2 {
        return *junction;
    }
    let mut point = *junction;
    let mut scale_factor = config.initial_scale_factor;
    for _ in 0..config.iterations {
        let scale = config.cauchy_scale_in_pixels * scale_factor.max(1.0);
        scale_factor *= 0.5;
        let mut hessian = Matrix3::zeros();
        let mut gradient = Vector3::zeros();
        for observation in observations {
            let Some((pixel, jacobian)) = views
                .get(observation.view)
                .and_then(|view| project_with_jacobian(&view.camera, &point))
            else {
                continue;
            };
            let residual = pixel - observation.pixel;
            let weight = observation.weight / (1.0 + residual.norm_squared() / (scale * scale));
            hessian += weight * jacobian.tr_mul(&jacobian);
            gradient += weight * jacobian.tr_mul(&residual);
        }
        let damping = config.damping * hessian.trace() / 3.0;
        match (hessian + Matrix3::identity() * damping).cholesky() {
            Some(factor) => point -= factor.solve(&gradient),
            None => return *junction,
        }
    }
    if (point - junction).norm() < config.max_move {
        point
    } else {
        *junction
    }
}

/// Re-triangulates all junctions in rounds of tightening association, each
/// followed by a selection: junctions seen in enough views, one per place, those
/// seen in most views first.
///
/// Every end belongs to at most the nearest junction. `required_support` is the
/// number of views that an edge of the scene needs.
pub fn retriangulate(
    junctions: &[Vector3<f64>],
    ends: &[SegmentEnd],
    views: &[ViewObservation],
    required_support: usize,
    config: &TriangulationConfig,
) -> Vec<Vector3<f64>> {
    let min_views = config.min_views.min(required_support);
    let mut junctions = junctions.to_vec();
    for round in &config.rounds {
        let observations = associate(&junctions, ends, views, round);
        let candidates = junctions
            .par_iter()
            .zip(&observations)
            .map(|(junction, observations)| Candidate {
                position: triangulate(junction, observations, views, config),
                views: observations
                    .iter()
                    .map(|observation| observation.view)
                    .collect::<BTreeSet<_>>()
                    .len(),
            })
            .collect();
        junctions = select(candidates, min_views, config);
    }
    junctions
}

/// A triangulated junction with the number of views that see it.
struct Candidate {
    position: Vector3<f64>,
    views: usize,
}

/// The observations of every junction: the 2D ends of the segment ends near it.
pub(crate) fn associate(
    junctions: &[Vector3<f64>],
    ends: &[SegmentEnd],
    views: &[ViewObservation],
    round: &AssociationRound,
) -> Vec<Vec<JunctionObservation>> {
    let index = PointIndex::new(junctions.to_vec());
    let mut observations = vec![Vec::new(); junctions.len()];
    for end in ends {
        let Some(nearest) = index
            .nearest_within(&end.position, round.max_distance)
            .filter(|nearest| nearest.distance < round.max_distance)
        else {
            continue;
        };
        let projected = views
            .get(end.view)
            .and_then(|view| project_in_front(&view.camera, &junctions[nearest.index]));
        if projected.is_some_and(|pixel| (pixel - end.pixel).norm() < round.max_distance_in_pixels)
        {
            observations[nearest.index].push(JunctionObservation {
                view: end.view,
                pixel: end.pixel,
                weight: end.weight,
            });
        }
    }
    observations
}

fn select(
    mut candidates: Vec<Candidate>,
    min_views: usize,
    config: &TriangulationConfig,
) -> Vec<Vector3<f64>> {
    candidates.retain(|candidate| {
        candidate.views >= min_views && candidate.position.amax() < config.max_coordinate
    });
    // A stable sort: of equally seen junctions the first comes first.
    candidates.sort_by_key(|candidate| std::cmp::Reverse(candidate.views));
    let mut kept = Vec::new();
    let mut grid = GrowingPointGrid::new(config.separation);
    for Candidate { position, .. } in candidates {
        let near = grid.first_near(&position, |_, distance| distance <= config.separation);
        if near.is_none() {
            kept.push(position);
            grid.push(position);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere, views_of_edges};

    fn observations_of(
        point: &Vector3<f64>,
        views: &[ViewObservation],
    ) -> Vec<JunctionObservation> {
        views
            .iter()
            .enumerate()
            .map(|(view, observation)| JunctionObservation {
                view,
                pixel: observation.camera.project(point).pixel,
                weight: 1.0,
            })
            .collect()
    }

    #[test]
    fn outliers_do_not_move_a_junction() {
        let views = views_of_edges(&cameras_on_sphere(12), &[], &[]);
        let truth = Vector3::new(0.2, -0.3, 0.1);
        let mut observations = observations_of(&truth, &views);
        for outlier in &mut observations[..3] {
            outlier.pixel += Vector2::new(60.0, -45.0);
        }
        let config = TriangulationConfig::default();
        let start = truth + Vector3::new(0.03, 0.02, -0.03);
        let point = triangulate(&start, &observations, &views, &config);
        assert!((point - truth).norm() < 1e-3, "{point}");
    }

    #[test]
    fn a_junction_stays_where_the_evidence_is_poor_or_far() {
        let views = views_of_edges(&cameras_on_sphere(6), &[], &[]);
        let start = Vector3::new(0.2, -0.3, 0.1);
        let config = TriangulationConfig::default();
        let observations = observations_of(&start, &views);
        assert_eq!(triangulate(&start, &[], &views, &config), start);
        assert_eq!(
            triangulate(&start, &observations[..1], &views, &config),
            start
        );
        let far = observations_of(&Vector3::new(0.2, 0.0, 0.1), &views);
        assert_eq!(triangulate(&start, &far, &views, &config), start);
        let nan = Vector3::repeat(f64::NAN);
        assert!(triangulate(&nan, &observations, &views, &config).x.is_nan());
    }

    #[test]
    fn rounds_merge_doubles_and_drop_what_few_views_see() {
        let views = views_of_edges(&cameras_on_sphere(10), &[], &[]);
        let truth = Vector3::new(0.1, 0.2, 0.3);
        let seldom = Vector3::new(-0.4, 0.2, 0.0);
        let mut noise = Noise(5);
        let mut ends = Vec::new();
        for (point, count) in [(truth, 10), (seldom, 2)] {
            for observation in &observations_of(&point, &views)[..count] {
                ends.push(SegmentEnd {
                    position: point + 0.01 * noise.vector(),
                    view: observation.view,
                    pixel: observation.pixel,
                    weight: 1.0,
                });
            }
        }
        let shift = Vector3::new(0.0, 0.02, 0.0);
        let start = [truth + shift, seldom, truth - 1.1 * shift];
        let config = TriangulationConfig::default();
        let junctions = retriangulate(&start, &ends, &views, 5, &config);
        assert_eq!(junctions.len(), 1);
        assert!((junctions[0] - truth).norm() < 1e-4);
        let lenient = retriangulate(&start, &ends, &views, 2, &config);
        assert_eq!(lenient.len(), 2);
        assert!(retriangulate(&[], &ends, &views, 2, &config).is_empty());
        assert!(retriangulate(&start, &[], &views, 2, &config).is_empty());
    }
}
