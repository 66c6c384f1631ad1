//! The trustworthy ends of the proposals: evidence for junctions.

use crate::{SegmentProposal, ViewObservation};
use nalgebra::{Vector2, Vector3};

/// One end of a proposal with the 2D end it was rendered for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentEnd {
    /// Where the field puts it.
    pub position: Vector3<f64>,
    /// The view it was detected in.
    pub view: usize,
    /// The detected 2D end, in image coordinates.
    pub pixel: Vector2<f64>,
    /// `sqrt(score) · exp(−(error / scale)²)`, in [0, 1] for scores in [0, 1].
    pub weight: f64,
}

/// Ends must project closer than this to their 2D end.
const MAX_ERROR_IN_PIXELS: f64 = 12.0;
/// Rays must agree on the end better than this, in world units.
const MAX_SPREAD: f64 = 0.05;
/// Error at which the weight has fallen to 1/e.
const ERROR_SCALE_IN_PIXELS: f64 = 6.0;

/// The ends that reproject well and on which the rays agree, in the order of the
/// proposals. Proposals that name no observed segment are passed over.
pub fn segment_ends(views: &[ViewObservation], proposals: &[SegmentProposal]) -> Vec<SegmentEnd> {
    let mut ends = Vec::new();
    for proposal in proposals {
        let Some(detection) = views
            .get(proposal.view)
            .and_then(|view| view.segments.get(proposal.segment_in_view))
        else {
            continue;
        };
        let positions = proposal.segment.ends();
        let pixels = detection.segment.ends();
        for side in 0..2 {
            let error = proposal.end_error_in_pixels[side];
            if error < MAX_ERROR_IN_PIXELS && proposal.end_spread[side] < MAX_SPREAD {
                let relative_error = error / ERROR_SCALE_IN_PIXELS;
                ends.push(SegmentEnd {
                    position: positions[side],
                    view: proposal.view,
                    pixel: pixels[side],
                    weight: detection.score.sqrt() * (-relative_error * relative_error).exp(),
                });
            }
        }
    }
    ends
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};
    use neat_core::LineSegment3;

    #[test]
    fn an_end_counts_only_when_it_reprojects_and_agrees() {
        let (junctions, edges) = cube();
        let mut views = views_of_edges(&cameras_on_sphere(1), &junctions, &edges);
        views[0].segments[0].score = 0.25;
        let proposal = |error: [f64; 2], spread: [f64; 2]| SegmentProposal {
            view: 0,
            segment_in_view: 0,
            segment: LineSegment3::new(junctions[0], junctions[1]),
            end_error_in_pixels: error,
            end_spread: spread,
        };
        let proposals = [
            proposal([6.0, 13.0], [0.01, 0.01]),
            proposal([0.0, 0.0], [0.06, 0.01]),
            SegmentProposal {
                segment_in_view: 12,
                ..proposal([0.0; 2], [0.0; 2])
            },
        ];
        let ends = segment_ends(&views, &proposals);
        assert_eq!(ends.len(), 2);
        assert_eq!(ends[0].position, junctions[0]);
        assert_eq!(ends[0].pixel, views[0].segments[0].segment.start);
        assert!((ends[0].weight - 0.5 * (-1f64).exp()).abs() < 1e-12);
        assert_eq!(ends[1].position, junctions[1]);
        assert_eq!(ends[1].weight, 0.5);
    }
}
