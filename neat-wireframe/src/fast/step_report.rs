//! What the steps of a back end add to the graph and take from it.

use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// A step of [`crate::fast::run`], in the order in which they come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// Modes of the segment ends become junctions.
    JunctionModes,
    /// Perceived junctions that segment ends support come in.
    PerceivedJunctions,
    /// Junctions move to where their 2D ends meet; few-view ones and doubles go.
    Retriangulation,
    /// Junctions that the images tell apart become two or more.
    JunctionSplitting,
    /// Pairs of junctions that detections join become edges.
    Edges,
    /// Junctions move until the projected edges lie on the detections.
    BundleAdjustment,
    /// Edges are chosen once more, with the junctions where they are now.
    EdgesAfterAdjustment,
    /// Edges go that are supported where the surface hides them, or are not
    /// where it does not.
    OcclusionTest,
    /// Near junctions merge, one edge per line stays, isolated junctions go.
    CleanUp,
    /// The bundle adjustment of the final graph.
    FinalAdjustment,
    /// Edges are split where others end on them or cross them.
    EdgeSplitting,
}

/// What one step did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepChange {
    /// The step.
    pub step: Step,
    /// Junctions after it.
    pub junctions: usize,
    /// Edges after it.
    pub edges: usize,
    /// Junctions that came in.
    pub added_junctions: usize,
    /// Junctions that went.
    pub removed_junctions: usize,
    /// Edges that came in.
    pub added_edges: usize,
    /// Edges that went.
    pub removed_edges: usize,
}

/// The size of a graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct GraphSize {
    pub junctions: usize,
    pub edges: usize,
}

impl StepChange {
    /// Of a step that only adds or only removes things of a kind.
    pub(crate) fn from_sizes(step: Step, before: GraphSize, after: GraphSize) -> Self {
        Self {
            step,
            junctions: after.junctions,
            edges: after.edges,
            added_junctions: after.junctions.saturating_sub(before.junctions),
            removed_junctions: before.junctions.saturating_sub(after.junctions),
            added_edges: after.edges.saturating_sub(before.edges),
            removed_edges: before.edges.saturating_sub(after.edges),
        }
    }

    /// Of a step that chose edges anew between the same junctions. Both lists of
    /// pairs are sorted and without doubles.
    pub(crate) fn from_edges(
        step: Step,
        junctions: usize,
        before: &[[usize; 2]],
        after: &[[usize; 2]],
    ) -> Self {
        let common = count_common(before, after);
        Self {
            step,
            junctions,
            edges: after.len(),
            added_junctions: 0,
            removed_junctions: 0,
            added_edges: after.len() - common,
            removed_edges: before.len() - common,
        }
    }
}

/// How many pairs two sorted lists without doubles share.
fn count_common(a: &[[usize; 2]], b: &[[usize; 2]]) -> usize {
    let (mut i, mut j, mut common) = (0, 0, 0);
    while let (Some(left), Some(right)) = (a.get(i), b.get(j)) {
        match left.cmp(right) {
            Ordering::Less => i += 1,
            Ordering::Greater => j += 1,
            Ordering::Equal => {
                common += 1;
                i += 1;
                j += 1;
            }
        }
    }
    common
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_came_and_what_went() {
        let before = [[0, 1], [1, 2], [2, 3]];
        let after = [[0, 2], [1, 2], [2, 3], [2, 4]];
        let report = StepChange::from_edges(Step::EdgesAfterAdjustment, 5, &before, &after);
        assert_eq!((report.added_edges, report.removed_edges), (2, 1));
        assert_eq!((report.junctions, report.edges), (5, 4));
        let size = |junctions, edges| GraphSize { junctions, edges };
        let report = StepChange::from_sizes(Step::CleanUp, size(9, 4), size(7, 4));
        assert_eq!((report.added_junctions, report.removed_junctions), (0, 2));
        assert_eq!((report.added_edges, report.removed_edges), (0, 0));
    }
}
