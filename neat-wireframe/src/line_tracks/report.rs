//! What the line-track back end returns.

use crate::Wireframe3d;
use serde::{Deserialize, Serialize};

/// A wireframe with the evidence for each of its edges.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LineTracksResult {
    /// Junctions in lexicographic order of their coordinates; edges `[a, b]`,
    /// a < b, sorted.
    pub wireframe: Wireframe3d,
    /// One entry per edge of the wireframe.
    pub edges: Vec<LineEvidence>,
    /// What each step kept.
    pub report: LineTracksReport,
}

/// What speaks for an edge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineEvidence {
    /// The 2D segments that lie on the edge, by ascending view and index.
    pub supports: Vec<SegmentSupport>,
    /// Number of different views among them.
    pub views: usize,
    /// Number of views in which the surface leaves the edge visible; `None`
    /// without the occlusion test.
    pub visible_views: Option<usize>,
}

/// Names a 2D segment of the observations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct SegmentSupport {
    /// Index of the view.
    pub view: usize,
    /// Index into that view's [`crate::ViewObservation::segments`].
    pub segment_in_view: usize,
}

/// How many things each step of [`super::run`] kept, in the order of the steps.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LineTracksReport {
    /// Views with a usable camera and at least one usable segment.
    pub usable_views: usize,
    /// Finite segments that are long enough, in these views.
    pub usable_segments: usize,
    /// Pairs of a view and a neighbour.
    pub neighbour_pairs: usize,
    /// Priors that name a usable segment.
    pub usable_priors: usize,
    /// Segments with a position that enough views support.
    pub segments_with_hypotheses: usize,
    /// Segments whose partners agree mutually in enough views.
    pub segments_in_consensus: usize,
    /// Tracks as they grew.
    pub grown_tracks: usize,
    /// Tracks after merging and gathering.
    pub merged_tracks: usize,
    /// Edges of the junction graph.
    pub graph_edges: usize,
    /// Edges that the adjusted graph confirms.
    pub confirmed_edges: usize,
    /// Edges that do not float alone.
    pub accompanied_edges: usize,
    /// Edges dropped as copies of others.
    pub dropped_copies: usize,
    /// Pairs of edges that have become one.
    pub merged_pieces: usize,
    /// Pairs of free ends that have become one junction.
    pub joined_corners: usize,
    /// Free ends that have become part of a junction.
    pub attached_ends: usize,
    /// Free ends moved to the inside of the edges that they meet.
    pub ends_on_edges: usize,
    /// Places where two edges cross.
    pub crossings: usize,
    /// Edges cut at junctions on their inside.
    pub split_edges: usize,
    /// Edges left by the occlusion test.
    pub unoccluded_edges: usize,
    /// Junctions of the result.
    pub junctions: usize,
    /// Edges of the result.
    pub edges: usize,
}
