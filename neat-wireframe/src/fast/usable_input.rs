//! The part of the input that can be used, in the unit of the scene radius.

use crate::{SegmentProposal, ViewObservation};
use neat_core::Camera;

/// Observations and proposals without anything unusable: every camera, segment
/// and proposal is finite, every view has a segment, and the world is scaled.
pub(crate) struct UsableInput {
    /// The usable views, in their order.
    pub views: Vec<ViewObservation>,
    /// The usable proposals, with indices into [`Self::views`].
    pub proposals: Vec<SegmentProposal>,
}

impl UsableInput {
    /// Selects what is usable and multiplies every length of the world by
    /// `scale`. Images do not change under such a scaling.
    pub(crate) fn new(
        observations: &[ViewObservation],
        proposals: &[SegmentProposal],
        scale: f64,
    ) -> Self {
        let mut views = Vec::new();
        // new_indices[view][segment] = (index in `views`, index of its segment)
        let mut new_indices = Vec::with_capacity(observations.len());
        for observation in observations {
            let mut segments = Vec::new();
            let mut new_index_of_segment = vec![None; observation.segments.len()];
            if is_usable_camera(&observation.camera) {
                for (old, detection) in observation.segments.iter().enumerate() {
                    if detection.score >= 0.0
                        && detection.score.is_finite()
                        && is_finite(&detection.segment)
                    {
                        new_index_of_segment[old] = Some((views.len(), segments.len()));
                        segments.push(*detection);
                    }
                }
            }
            if !segments.is_empty() {
                views.push(ViewObservation {
                    camera: Camera {
                        center_in_world: observation.camera.center_in_world * scale,
                        ..observation.camera
                    },
                    segments,
                    junctions: observation.junctions.clone(),
                });
            }
            new_indices.push(new_index_of_segment);
        }
        let proposals = proposals
            .iter()
            .filter_map(|proposal| {
                let (view, segment_in_view) = (*new_indices
                    .get(proposal.view)?
                    .get(proposal.segment_in_view)?)?;
                let measures = proposal.end_error_in_pixels.iter();
                let finite = is_finite(&proposal.segment)
                    && measures.chain(&proposal.end_spread).all(|x| x.is_finite());
                finite.then(|| SegmentProposal {
                    view,
                    segment_in_view,
                    segment: proposal.segment.map(|end| end * scale),
                    end_error_in_pixels: proposal.end_error_in_pixels,
                    end_spread: proposal.end_spread.map(|spread| spread * scale),
                })
            })
            .collect();
        Self { views, proposals }
    }
}

fn is_usable_camera(camera: &Camera) -> bool {
    let k = &camera.intrinsics;
    let mut numbers = [k.cx, k.cy, k.skew]
        .into_iter()
        .chain(camera.world_from_camera.iter().copied())
        .chain(camera.center_in_world.iter().copied());
    k.fx.is_normal() && k.fy.is_normal() && numbers.all(f64::is_finite)
}

fn is_finite<const D: usize>(segment: &neat_core::LineSegment<D>) -> bool {
    let mut coordinates = segment.start.iter().chain(&segment.end);
    coordinates.all(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};
    use neat_core::LineSegment3;

    #[test]
    fn unusable_views_segments_and_proposals_disappear_and_indices_follow() {
        let (junctions, edges) = cube();
        let mut observations = views_of_edges(&cameras_on_sphere(4), &junctions, &edges);
        observations[0].camera.center_in_world.x = f64::NAN;
        observations[1].segments.clear();
        observations[2].segments[0].segment.start.y = f64::INFINITY;
        let proposal = |view, segment_in_view| SegmentProposal {
            view,
            segment_in_view,
            segment: LineSegment3::new(junctions[0], junctions[1]),
            end_error_in_pixels: [1.0; 2],
            end_spread: [0.01; 2],
        };
        let mut broken = proposal(3, 1);
        broken.segment.start.x = f64::NAN;
        let proposals = [
            proposal(0, 0),
            proposal(1, 0),
            proposal(2, 0),
            proposal(2, 3),
            proposal(3, 1),
            proposal(3, 99),
            proposal(99, 0),
            broken,
        ];
        let evidence = UsableInput::new(&observations, &proposals, 0.5);
        assert_eq!(evidence.views.len(), 2);
        assert_eq!(evidence.views[0].segments.len(), edges.len() - 1);
        let kept: Vec<_> = evidence
            .proposals
            .iter()
            .map(|p| (p.view, p.segment_in_view))
            .collect();
        assert_eq!(kept, [(0, 2), (1, 1)]);
        assert_eq!(evidence.proposals[0].segment.start, junctions[0] * 0.5);
        let scaled = evidence.views[1]
            .camera
            .project(&(junctions[3] * 0.5))
            .pixel;
        let original = observations[3].camera.project(&junctions[3]).pixel;
        assert!((scaled - original).norm() < 1e-9);
    }
}
