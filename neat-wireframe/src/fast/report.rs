//! What the fast back end returns.

use super::step_report::StepChange;
use neat_core::Wireframe3d;
use serde::{Deserialize, Serialize};

/// A wireframe with the evidence for each of its edges.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FastBackEndResult {
    /// Junctions in lexicographic order of their coordinates; edges `[a, b]`,
    /// a < b, sorted.
    pub wireframe: Wireframe3d,
    /// One entry per edge of the wireframe.
    pub edges: Vec<EdgeEvidence>,
    /// What each step kept.
    pub report: FastBackEndReport,
}

/// What speaks for an edge, as counted when it was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeEvidence {
    /// Number of views with a detection on the edge.
    pub support: usize,
    /// Number of views in which the surface leaves it visible; `None` without
    /// the occlusion test.
    pub visible_views: Option<usize>,
    /// Support divided by visible views, see
    /// [`crate::evidence::OcclusionConfig::support_ratio`].
    pub support_ratio: Option<f64>,
}

/// How many things each step of [`super::run`] kept, in the order of the steps.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FastBackEndReport {
    /// Views with a finite camera and at least one finite segment.
    pub usable_views: usize,
    /// Finite proposals for a segment of such a view.
    pub usable_proposals: usize,
    /// Views that must support an edge.
    pub required_views: usize,
    /// Proposal ends that reproject well and on which the rays agree.
    pub segment_ends: usize,
    /// Junction candidates that are modes of these ends.
    pub junction_modes: usize,
    /// Perceived junctions that the ends support and no mode stands for.
    pub added_perceived_junctions: usize,
    /// Junctions after re-triangulation.
    pub triangulated_junctions: usize,
    /// Junctions split off from these.
    pub split_junctions: usize,
    /// Edges with enough support before any bundle adjustment.
    pub supported_edges: usize,
    /// Edges with enough support after it.
    pub supported_edges_after_adjustment: usize,
    /// Edges left by the occlusion test.
    pub unoccluded_edges: usize,
    /// Junctions of the result.
    pub junctions: usize,
    /// Edges of the result.
    pub edges: usize,
    /// What each step that ran added and removed, in their order.
    pub steps: Vec<StepChange>,
}
