//! The final test of every edge against the 2D segments of all views.
//!
//! An edge stays if enough views show it, among those that ought to, with
//! segments that no stronger edge explains.

use super::clustering::{ClusteringConfig, lies_on, view_count};
use super::graph_adjustment::segment_of_edge;
use super::junction_graph::{GraphEdge, JunctionGraph};
use super::line_refinement::shown_interval;
use super::projected_line::ProjectedLine;
use super::track_merging::project_segment;
use super::view_segments::{SegmentId, TrackView, segment_of};
use nalgebra::Vector3;
use neat_core::LineSegment3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Settings of the final test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EdgeConfirmationConfig {
    /// Supports lie this near to the edge in the mean.
    pub max_mean_distance_in_pixels: f64,
    /// Share of the views that ought to show the edge which do.
    pub min_support_share: f64,
    /// Views within this angle of a view that shows the edge, with the whole edge
    /// in the image, ought to show it too: what hides it would hide it there.
    pub expected_angle_in_degrees: f64,
    /// An edge explains a 2D segment if it covers this share of it.
    pub min_explained_share: f64,
}

impl Default for EdgeConfirmationConfig {
    fn default() -> Self {
        Self {
            max_mean_distance_in_pixels: 1.5,
            min_support_share: 0.4,
            expected_angle_in_degrees: 15.0,
            min_explained_share: 0.5,
        }
    }
}

/// An edge with what speaks for it.
struct Candidate {
    edge: GraphEdge,
    /// Pixels of 2D segments that it explains.
    strength: f64,
    /// Those of its supports that it explains.
    explained: Vec<SegmentId>,
}

/// Gathers the supports of every edge anew, from all views, and drops the edges
/// that fail the test.
pub(super) fn confirm_edges(
    views: &[TrackView],
    graph: &mut JunctionGraph,
    min_views: usize,
    clustering: &ClusteringConfig,
    config: &EdgeConfirmationConfig,
) {
    let candidates: Vec<Option<Candidate>> = graph
        .edges
        .par_iter()
        .map(|edge| candidate(views, graph, edge, min_views, clustering, config))
        .collect();
    let mut candidates: Vec<Candidate> = candidates.into_iter().flatten().collect();
    candidates.sort_by(|a, b| {
        let by_strength = b.strength.total_cmp(&a.strength);
        by_strength.then(a.edge.junctions.cmp(&b.edge.junctions))
    });
    // What a stronger edge explains speaks for no other one.
    let mut free: Vec<Vec<bool>> = views.iter().map(|v| vec![true; v.segments.len()]).collect();
    graph.edges.clear();
    for candidate in candidates {
        let own: Vec<SegmentId> = candidate
            .explained
            .iter()
            .copied()
            .filter(|id| free[id.view][id.segment])
            .collect();
        if view_count(&own) < min_views {
            continue;
        }
        for id in own {
            free[id.view][id.segment] = false;
        }
        graph.edges.push(candidate.edge);
    }
    graph.edges.sort_by_key(|edge| edge.junctions);
}

fn candidate(
    views: &[TrackView],
    graph: &JunctionGraph,
    edge: &GraphEdge,
    min_views: usize,
    clustering: &ClusteringConfig,
    config: &EdgeConfirmationConfig,
) -> Option<Candidate> {
    let line = segment_of_edge(graph, edge);
    let supports = supports_of(views, &line, clustering);
    let enough = view_count(&supports) >= min_views
        && mean_distance(views, &supports, &line) <= config.max_mean_distance_in_pixels
        && support_share(views, &supports, &line, config) >= config.min_support_share;
    if !enough {
        return None;
    }
    let mut strength = 0.0;
    let mut explained = Vec::new();
    for id in &supports {
        let Some([low, high]) = shown_interval(views, *id, &line) else {
            continue;
        };
        let share = (high.min(1.0) - low.max(0.0)) / (high - low);
        if share >= config.min_explained_share {
            strength += share * segment_of(views, *id).segment.length();
            explained.push(*id);
        }
    }
    Some(Candidate {
        edge: GraphEdge {
            junctions: edge.junctions,
            supports,
        },
        strength,
        explained,
    })
}

/// All 2D segments that lie on a 3D segment, ascending.
fn supports_of(
    views: &[TrackView],
    line: &LineSegment3,
    clustering: &ClusteringConfig,
) -> Vec<SegmentId> {
    let mut supports = Vec::new();
    for (view, prepared) in views.iter().enumerate() {
        let Some(projected) = project_segment(prepared, line) else {
            continue;
        };
        supports.extend(
            prepared
                .index
                .near(&projected)
                .into_iter()
                .map(|segment| SegmentId { view, segment })
                .filter(|id| lies_on(views, *id, line, clustering)),
        );
    }
    supports
}

/// Mean distance of the supports' ends from the projected line.
fn mean_distance(views: &[TrackView], supports: &[SegmentId], line: &LineSegment3) -> f64 {
    let of_support = |id: &SegmentId| {
        let ends = segment_of(views, *id).segment.ends();
        ProjectedLine::new(&views[id.view].camera, line).map_or(f64::INFINITY, |line| {
            0.5 * ends
                .map(|end| line.distance(&end).abs())
                .iter()
                .sum::<f64>()
        })
    };
    supports.iter().map(of_support).sum::<f64>() / supports.len().max(1) as f64
}

/// The views that show an edge as a share of those that ought to.
fn support_share(
    views: &[TrackView],
    supports: &[SegmentId],
    line: &LineSegment3,
    config: &EdgeConfirmationConfig,
) -> f64 {
    let middle = line.point_at(0.5);
    let toward =
        |view: usize| -> Vector3<f64> { (views[view].camera.center_in_world - middle).normalize() };
    let showing: Vec<usize> = supports
        .chunk_by(|a, b| a.view == b.view)
        .map(|group| group[0].view)
        .collect();
    let directions: Vec<Vector3<f64>> = showing.iter().map(|view| toward(*view)).collect();
    let min_cosine = config.expected_angle_in_degrees.to_radians().cos();
    let expected = (0..views.len())
        .filter(|view| {
            showing.binary_search(view).is_ok()
                || (!views[*view].segments.is_empty()
                    && line.ends().iter().all(|end| views[*view].camera.sees(end))
                    && directions
                        .iter()
                        .any(|d| d.dot(&toward(*view)) >= min_cosine))
        })
        .count();
    showing.len() as f64 / expected.max(1) as f64
}
