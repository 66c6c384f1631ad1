//! Edges that proposals suggest by attracting their ends to junctions.

use crate::SegmentProposal;
use crate::index::PointIndex;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Both ends must be closer than this to their junctions, in world units.
const MAX_DISTANCE: f64 = 0.15;
/// The same limit as a share of the proposal's length.
const MAX_RELATIVE_DISTANCE: f64 = 0.3;
/// Proposals that must suggest the same edge.
const MIN_PROPOSALS: usize = 3;

/// The pairs `[a, b]`, a < b, of junctions nearest to the ends of enough
/// proposals, sorted.
///
/// The attraction of NEAT's distillation with tighter limits than the paper's,
/// which accepts distances up to the length of the segment.
pub fn attraction_hypotheses(
    junctions: &[Vector3<f64>],
    proposals: &[SegmentProposal],
) -> Vec<[usize; 2]> {
    let index = PointIndex::new(junctions.to_vec());
    let mut votes = BTreeMap::new();
    for proposal in proposals {
        let limit = (MAX_RELATIVE_DISTANCE * proposal.segment.length()).min(MAX_DISTANCE);
        let [start, end] = proposal.segment.ends().map(|end| {
            index
                .nearest_within(&end, limit)
                .filter(|nearest| nearest.distance < limit)
                .map(|nearest| nearest.index)
        });
        if let (Some(a), Some(b)) = (start, end)
            && a != b
        {
            *votes.entry([a.min(b), a.max(b)]).or_insert(0) += 1;
        }
    }
    votes
        .into_iter()
        .filter(|(_, votes)| *votes >= MIN_PROPOSALS)
        .map(|(pair, _)| pair)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::LineSegment3;

    #[test]
    fn three_proposals_near_both_junctions_make_a_hypothesis() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        let junctions = [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)];
        let proposal = |start, end| SegmentProposal {
            view: 0,
            segment_in_view: 0,
            segment: LineSegment3::new(start, end),
            end_error_in_pixels: [0.0; 2],
            end_spread: [0.0; 2],
        };
        let near = proposal(at(0.02, 0.0), at(0.97, 0.01));
        let reversed = proposal(at(1.0, 0.1), at(0.0, -0.1));
        let far = proposal(at(0.0, 0.2), at(1.0, 0.0));
        let loop_at_one_junction = proposal(at(0.0, 0.0), at(0.01, 0.0));
        let hypotheses = |proposals: &[_]| attraction_hypotheses(&junctions, proposals);
        assert_eq!(hypotheses(&[near, reversed, near]), [[0, 1]]);
        assert!(hypotheses(&[near, reversed, far]).is_empty());
        assert!(hypotheses(&[loop_at_one_junction; 3]).is_empty());
        assert!(attraction_hypotheses(&[], &[near; 3]).is_empty());
    }
}
