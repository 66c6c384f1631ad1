//! Visibility checking: a 3D segment must be seen as a 2D segment in enough
//! views (paper §4.3 and supplement C.2, eqs. 10 and 11).

use crate::ViewObservation;
use neat_core::LineSegment3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// When a segment counts as seen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VisibilityConfig {
    /// Only 2D segments with a score strictly above this are looked at.
    pub min_segment_score: f64,
    /// Seen in a view: the projection lies nearer than this to a 2D segment, in
    /// squared pixels summed over both ends, strict (τ_v of eq. 10).
    pub max_squared_distance: f64,
    /// Seen in so many views or more (τ_ck).
    pub min_views: usize,
}

impl Default for VisibilityConfig {
    fn default() -> Self {
        Self {
            min_segment_score: 0.05,
            max_squared_distance: 100.0,
            min_views: 5,
        }
    }
}

/// Distance of the projected segment to the nearest 2D segment of a view
/// (left side of eq. 10): squared pixels, summed over both ends, in the better
/// order of ends. Infinite where the view has no segment above `min_score`.
///
/// As in the paper there is no test for occlusion, for the image border or for
/// points behind the camera.
pub fn squared_reprojection_distance(
    segment: &LineSegment3,
    view: &ViewObservation,
    min_score: f64,
) -> f64 {
    let in_image = segment.map(|p| view.camera.project(p).pixel);
    view.segments
        .iter()
        .filter(|detected| detected.score > min_score)
        .map(|detected| detected.segment.unordered_squared_end_distance(&in_image))
        .fold(f64::INFINITY, f64::min)
}

/// In how many views each segment is seen (eq. 11), in the order of `segments`.
///
/// A segment passes if the number is at least [`VisibilityConfig::min_views`].
pub fn seeing_views(
    segments: &[LineSegment3],
    views: &[ViewObservation],
    config: &VisibilityConfig,
) -> Vec<usize> {
    segments
        .par_iter()
        .map(|segment| {
            views
                .iter()
                .map(|view| squared_reprojection_distance(segment, view, config.min_segment_score))
                .filter(|distance| *distance < config.max_squared_distance)
                .count()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::observation;
    use nalgebra::Vector3;

    /// Projects onto pixels (20, 50) and (80, 50).
    fn segment() -> LineSegment3 {
        LineSegment3::new(Vector3::new(-0.6, 0.0, 2.0), Vector3::new(0.6, 0.0, 2.0))
    }

    #[test]
    fn distance_takes_the_better_order_and_the_nearest_segment() {
        let view = observation(&[
            ([80.0, 53.0], [20.0, 54.0], 0.9),
            ([20.0, 60.0], [80.0, 60.0], 0.9),
        ]);
        let distance = squared_reprojection_distance(&segment(), &view, 0.05);
        assert!((distance - 25.0).abs() < 1e-9);
    }

    #[test]
    fn weak_segments_do_not_count() {
        let view = observation(&[([20.0, 50.0], [80.0, 50.0], 0.05)]);
        assert_eq!(
            squared_reprojection_distance(&segment(), &view, 0.05),
            f64::INFINITY
        );
    }

    #[test]
    fn views_are_counted_by_a_strict_threshold() {
        let seen = observation(&[([20.0, 51.0], [80.0, 51.0], 0.9)]);
        let border = observation(&[([20.0, 60.0], [80.0, 50.0], 0.9)]);
        let blind = observation(&[]);
        let views = [seen.clone(), border, blind, seen];
        let config = VisibilityConfig::default();
        let off_by_one = LineSegment3::new(segment().start, Vector3::new(0.6, 0.5, 2.0));
        assert_eq!(
            seeing_views(&[segment(), off_by_one], &views, &config),
            [2, 0]
        );
        assert!(seeing_views(&[], &views, &config).is_empty());
        assert_eq!(seeing_views(&[segment()], &[], &config), [0]);
    }
}
