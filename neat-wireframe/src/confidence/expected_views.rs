//! The views that ought to show an edge.

use super::config::ProvenanceConfig;
use super::occlusion::Occluder;
use crate::ViewObservation;
use crate::metrics::visible_projection;
use neat_core::LineSegment3;

/// The share of an edge that must lie in the image.
const MIN_SHARE_IN_IMAGE: f64 = 0.6;

/// The views in which most of an edge lies in the image, is long enough to be
/// detected, and is not hidden by the surface where there is one. Ascending.
pub(super) fn expected_views(
    observations: &[ViewObservation],
    edge: &LineSegment3,
    occluder: Option<&Occluder>,
    config: &ProvenanceConfig,
) -> Vec<usize> {
    let seen = occluder.map(|occluder| occluder.views_that_see(observations, edge));
    let is_seen = |view: usize| {
        let sees = |seen: &Vec<bool>| seen.get(view).copied().unwrap_or(false);
        seen.as_ref().is_none_or(sees)
    };
    observations
        .iter()
        .enumerate()
        .filter(|(view, observation)| {
            observation.camera.validate().is_ok()
                && is_in_view(observation, edge, config)
                && is_seen(*view)
        })
        .map(|(view, _)| view)
        .collect()
}

fn is_in_view(
    observation: &ViewObservation,
    edge: &LineSegment3,
    config: &ProvenanceConfig,
) -> bool {
    /// Evenly spaced places on the edge that are tested.
    const SAMPLES: usize = 10;
    let long_enough = visible_projection(&observation.camera, edge)
        .is_some_and(|projected| projected.length() >= config.min_projected_length_in_pixels);
    let in_image = (0..SAMPLES)
        .map(|sample| edge.point_at((sample as f64 + 0.5) / SAMPLES as f64))
        .filter(|point| observation.camera.sees(point))
        .count();
    long_enough && in_image as f64 >= MIN_SHARE_IN_IMAGE * SAMPLES as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{CubeSurface, cameras_on_sphere, cube, views_of_edges};

    #[test]
    fn images_lengths_and_the_surface_decide() {
        let (junctions, edges) = cube();
        let mut observations = views_of_edges(&cameras_on_sphere(12), &junctions, &edges);
        for observation in &mut observations {
            observation.camera.center_in_world *= 3.0;
        }
        observations[3].camera.intrinsics.cx = 5000.0;
        observations[4].camera.intrinsics.fx = f64::NAN;
        let config = ProvenanceConfig::default();
        let edge = LineSegment3::new(3.0 * junctions[0], 3.0 * junctions[1]);
        let expected = |occluder| expected_views(&observations, &edge, occluder, &config);
        let unhidden = expected(None);
        assert_eq!(unhidden.len(), 10);
        assert!(!unhidden.contains(&3) && !unhidden.contains(&4));

        let visible = expected(Some(&Occluder {
            surface: &CubeSurface(1.5),
            scene_radius: 3.0,
        }));
        // The edge y = z = -0.5 is seen from below or from one side.
        let outside = |view: &usize| {
            let center = observations[*view].camera.center_in_world;
            center.y < -1.5 || center.z < -1.5
        };
        let from_outside: Vec<_> = unhidden.into_iter().filter(outside).collect();
        assert_eq!(visible, from_outside);
    }
}
