//! One hypothesis per 2D segment: the one that its partners hold as well.
//!
//! In repeated structures, such as the windows of a façade, wrong positions find
//! support in several views. But the partners of a wrong position mostly have
//! better explanations of their own, so every segment chooses among its
//! alternatives by what its partners and the segments at its vertices have
//! chosen, in a few rounds.

use super::hypothesis_scoring::{Alternatives, Hypothesis};
use super::projected_line::ProjectedLine;
use super::view_segments::{SegmentId, TrackView, VertexEnd, segment_of};
use rayon::prelude::*;

/// Rounds of choosing again.
const ROUNDS: usize = 4;
/// Share of a partner's agreement that counts where the partner has chosen
/// another position.
const ONE_SIDED_SHARE: f64 = 0.2;
/// What a segment at the same vertex and the same depth adds; once per
/// vertex.
const VERTEX_WEIGHT: f64 = 0.5;
/// A partner's position agrees if it projects this near to the segment.
const TOLERANCE_IN_PIXELS: f64 = 3.0;

/// A segment's position and the partners that hold it too.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Consensus {
    /// The chosen position.
    pub hypothesis: Hypothesis,
    /// Its partners whose own position agrees, by ascending id.
    pub partners: Vec<SegmentId>,
    /// Value of the choice: agreements, mutual ones in full.
    pub score: f64,
}

/// For every segment of every view the choice, if mutual agreement makes up at
/// least `min_views` views, its own included.
pub(super) fn find_consensus(
    views: &[TrackView],
    alternatives: &Alternatives,
    min_views: usize,
) -> Vec<Vec<Option<Consensus>>> {
    // All choose the best supported position at first.
    let mut chosen: Vec<Vec<Option<usize>>> = alternatives
        .iter()
        .map(|view| {
            view.iter()
                .map(|list| (!list.is_empty()).then_some(0))
                .collect()
        })
        .collect();
    for _ in 0..ROUNDS {
        let choices = Choices {
            views,
            alternatives,
            chosen: &chosen,
        };
        chosen = choices.map_segments(|id, list| {
            (0..list.len())
                .map(|a| (choices.value(id, &list[a]), a))
                .max_by(|(x, a), (y, b)| x.total_cmp(y).then(b.cmp(a)))
                .map(|(_, a)| a)
        });
    }
    let choices = Choices {
        views,
        alternatives,
        chosen: &chosen,
    };
    choices.map_segments(|id, list| {
        let hypothesis = &list[choices.chosen[id.view][id.segment]?];
        let partners: Vec<SegmentId> = hypothesis
            .supports
            .iter()
            .filter(|support| choices.agrees(support.id, id))
            .map(|support| support.id)
            .collect();
        (partners.len() + 1 >= min_views).then(|| Consensus {
            hypothesis: hypothesis.clone(),
            partners,
            score: choices.value(id, hypothesis),
        })
    })
}

/// The state of one round.
struct Choices<'a> {
    views: &'a [TrackView],
    alternatives: &'a Alternatives,
    chosen: &'a [Vec<Option<usize>>],
}

impl Choices<'_> {
    fn map_segments<T: Send>(
        &self,
        f: impl Fn(SegmentId, &[Hypothesis]) -> T + Sync,
    ) -> Vec<Vec<T>> {
        let f = &f;
        self.alternatives
            .par_iter()
            .enumerate()
            .map(|(view, lists)| {
                lists
                    .par_iter()
                    .enumerate()
                    .map(|(segment, list)| f(SegmentId { view, segment }, list))
                    .collect()
            })
            .collect()
    }

    fn hypothesis(&self, id: SegmentId) -> Option<&Hypothesis> {
        let choice = self.chosen[id.view][id.segment]?;
        self.alternatives[id.view][id.segment].get(choice)
    }

    fn value(&self, id: SegmentId, hypothesis: &Hypothesis) -> f64 {
        let partners: f64 = hypothesis
            .supports
            .iter()
            .map(|support| {
                let share = if self.agrees(support.id, id) {
                    1.0
                } else {
                    ONE_SIDED_SHARE
                };
                share * support.weight
            })
            .sum();
        partners + VERTEX_WEIGHT * self.vertex_agreement(id, hypothesis)
    }

    /// Whether the position that a partner has chosen projects onto the segment.
    /// The partner's position lies in the plane of the partner, so that it is
    /// then the position that both planes make.
    fn agrees(&self, partner: SegmentId, id: SegmentId) -> bool {
        let Some(hypothesis) = self.hypothesis(partner) else {
            return false;
        };
        let position = self.views[partner.view].back_project(partner.segment, hypothesis.depths);
        let segment = &segment_of(self.views, id).segment;
        ProjectedLine::new(&self.views[id.view].camera, &position)
            .is_some_and(|line| line.segment_distance(segment) <= TOLERANCE_IN_PIXELS)
    }

    /// The number of the segment's ends at which another segment, with the same
    /// vertex, has chosen the same depth.
    fn vertex_agreement(&self, id: SegmentId, hypothesis: &Hypothesis) -> f64 {
        let view = &self.views[id.view];
        let agrees = |side: usize, end: &VertexEnd| {
            let other = SegmentId {
                view: id.view,
                segment: end.segment,
            };
            other != id
                && self.hypothesis(other).is_some_and(|other| {
                    let noise = hypothesis.depth_noise[side].hypot(other.depth_noise[end.side]);
                    let difference = hypothesis.depths[side] - other.depths[end.side];
                    difference.abs() <= TOLERANCE_IN_PIXELS * noise
                })
        };
        (0..2)
            .filter(|&side| {
                let vertex = view.segments[id.segment].vertices[side];
                view.vertices[vertex].iter().any(|end| agrees(side, end))
            })
            .count() as f64
    }
}
