//! One 3D segment for a detected 2D segment, from the segments that several rays
//! rendered for it.

use crate::{SegmentProposal, ViewObservation};
use nalgebra::Vector3;
use neat_core::LineSegment3;

/// What one ray through the attraction region of a 2D segment rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightedSegment {
    /// The rendered 3D segment, already divided by `weight` where the renderer
    /// normalises. Its ends come in any order.
    pub segment: LineSegment3,
    /// Sum of the volume rendering weights along the ray, in [0, 1].
    pub weight: f64,
}

/// Rays need more accumulated weight than this: others missed the surface.
const MIN_WEIGHT: f64 = 0.3;
/// Fewer rays than this give no proposal, and as many are always kept.
const MIN_RAYS: usize = 2;
/// Share of the rays to keep, best reprojection first.
const KEPT_FRACTION: f64 = 0.5;

/// Combines the rays of one detected segment into one proposal.
///
/// Each ray's ends are put in the order of the 2D ends; the rays with the
/// smallest larger end error stay, and the proposal is their median, coordinate
/// by coordinate. `None` where the indices name no segment or too few finite
/// rays have weight.
pub fn robust_segment(
    observations: &[ViewObservation],
    view: usize,
    segment_in_view: usize,
    rays: &[WeightedSegment],
) -> Option<SegmentProposal> {
    let observation = observations.get(view)?;
    let detected = observation.segments.get(segment_in_view)?.segment;
    let project = |segment: &LineSegment3| segment.map(|end| observation.camera.project(end).pixel);

    let mut ordered: Vec<(f64, LineSegment3)> = rays
        .iter()
        .filter(|ray| ray.weight > MIN_WEIGHT)
        .filter_map(|ray| {
            let projected = project(&ray.segment);
            let reversed = projected.reversed();
            let swap = detected.squared_end_distance(&reversed)
                < detected.squared_end_distance(&projected);
            let (segment, projected) = if swap {
                (ray.segment.reversed(), reversed)
            } else {
                (ray.segment, projected)
            };
            let [start, end] = detected.end_distances(&projected);
            (start + end)
                .is_finite()
                .then_some((start.max(end), segment))
        })
        .collect();
    let min_rays = MIN_RAYS.max(1);
    if ordered.len() < min_rays {
        return None;
    }
    ordered.sort_by(|a, b| a.0.total_cmp(&b.0));
    let kept = (KEPT_FRACTION * ordered.len() as f64) as usize;
    ordered.truncate(kept.max(min_rays));

    let median_end = |end: fn(&LineSegment3) -> Vector3<f64>| {
        Vector3::from_fn(|axis, _| median(ordered.iter().map(|(_, s)| end(s)[axis]).collect()))
    };
    let segment = LineSegment3::new(median_end(|s| s.start), median_end(|s| s.end));
    let spread = |end: usize| {
        median(
            ordered
                .iter()
                .map(|(_, s)| segment.end_distances(s)[end])
                .collect(),
        )
    };
    Some(SegmentProposal {
        view,
        segment_in_view,
        segment,
        end_error_in_pixels: detected.end_distances(&project(&segment)),
        end_spread: [spread(0), spread(1)],
    })
}

/// The middle value; the mean of the two middle ones of an even number.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 {
        values[middle]
    } else {
        0.5 * (values[middle - 1] + values[middle])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};

    #[test]
    fn the_median_of_the_best_half_ignores_order_and_outliers() {
        let (junctions, edges) = cube();
        let views = views_of_edges(&cameras_on_sphere(3), &junctions, &edges);
        let truth = LineSegment3::new(junctions[edges[4][0]], junctions[edges[4][1]]);
        let shifted = |x: f64| truth.map(|end| end + Vector3::new(x, -x, x));
        let ray = |segment, weight| WeightedSegment { segment, weight };
        let rays = [
            ray(shifted(0.001).reversed(), 0.9),
            ray(shifted(-0.001), 0.9),
            ray(shifted(0.3), 0.9),
            ray(shifted(0.4).reversed(), 0.9),
            ray(shifted(0.0), 0.2),
            ray(shifted(f64::NAN), 0.9),
        ];
        let proposal = robust_segment(&views, 1, 4, &rays).unwrap();
        assert!(proposal.segment.squared_end_distance(&truth) < 1e-20);
        assert!(proposal.end_error_in_pixels.iter().all(|e| *e < 1e-6));
        for spread in proposal.end_spread {
            assert!((spread - 0.001 * 3f64.sqrt()).abs() < 1e-12);
        }
    }

    #[test]
    fn too_few_rays_or_wrong_indices_give_nothing() {
        let (junctions, edges) = cube();
        let views = views_of_edges(&cameras_on_sphere(1), &junctions, &edges);
        let ray = WeightedSegment {
            segment: LineSegment3::new(junctions[0], junctions[1]),
            weight: 1.0,
        };
        assert_eq!(robust_segment(&views, 0, 0, &[ray]), None);
        assert_eq!(robust_segment(&views, 0, 0, &[]), None);
        assert_eq!(robust_segment(&views, 1, 0, &[ray, ray]), None);
        assert_eq!(robust_segment(&views, 0, 12, &[ray, ray]), None);
        assert!(robust_segment(&views, 0, 0, &[ray, ray]).is_some());
    }
}
