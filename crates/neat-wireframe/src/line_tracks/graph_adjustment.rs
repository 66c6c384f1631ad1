//! Bundle adjustment of the graph with known correspondences, and the final test
//! of every edge against its 2D segments.

use super::clustering::{ClusteringConfig, lies_on, view_count};
use super::junction_graph::{GraphEdge, JunctionGraph};
use super::projected_line::ProjectedLine;
use super::track_merging::project_segment;
use super::view_segments::{SegmentId, TrackView, segment_of};
use crate::bundle_adjustment::{
    BundleAdjustmentConfig, EdgeObservation, ObservedEdge, adjust_observed,
};
use neat_core::LineSegment3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Settings of the adjustment and of the final test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GraphAdjustmentConfig {
    /// Loss and iteration; its association settings play no role here.
    pub adjustment: BundleAdjustmentConfig,
    /// Ends of 2D segments this near to a projected junction pull it.
    pub end_distance_in_pixels: f64,
    /// Edges whose supports lie farther from them in the mean are dropped.
    pub max_mean_distance_in_pixels: f64,
}

impl Default for GraphAdjustmentConfig {
    fn default() -> Self {
        Self {
            adjustment: BundleAdjustmentConfig {
                end_weight: 0.3,
                ..Default::default()
            },
            end_distance_in_pixels: 4.0,
            max_mean_distance_in_pixels: 1.5,
        }
    }
}

/// Moves all junctions until the projected edges lie on their supports.
pub(super) fn adjust_graph(
    views: &[TrackView],
    graph: &mut JunctionGraph,
    config: &GraphAdjustmentConfig,
) {
    let observed: Vec<ObservedEdge> = graph
        .edges
        .par_iter()
        .map(|edge| ObservedEdge {
            junctions: edge.junctions,
            observations: observations(views, graph, edge, config),
        })
        .collect();
    graph.junctions = adjust_observed(&observed, &graph.junctions, &config.adjustment);
}

fn observations(
    views: &[TrackView],
    graph: &JunctionGraph,
    edge: &GraphEdge,
    config: &GraphAdjustmentConfig,
) -> Vec<EdgeObservation> {
    let line = segment_of_edge(graph, edge);
    edge.supports
        .iter()
        .filter_map(|id| {
            let view = &views[id.view];
            let projected = project_segment(view, &line)?;
            let support = segment_of(views, *id);
            let nearest_end = |pixel: &nalgebra::Vector2<f64>| {
                support
                    .segment
                    .ends()
                    .into_iter()
                    .min_by(|a, b| (a - pixel).norm().total_cmp(&(b - pixel).norm()))
                    .filter(|end| (end - pixel).norm() <= config.end_distance_in_pixels)
            };
            Some(EdgeObservation {
                camera: view.camera,
                detection: support.segment,
                ends: [nearest_end(&projected.start), nearest_end(&projected.end)],
                weight: 1.0,
            })
        })
        .collect()
}

fn segment_of_edge(graph: &JunctionGraph, edge: &GraphEdge) -> LineSegment3 {
    let [a, b] = edge.junctions.map(|junction| graph.junctions[junction]);
    LineSegment3::new(a, b)
}

/// Gathers the supports of every edge anew, from all views, and drops edges that
/// too few views show or that lie beside their supports.
pub(super) fn confirm_edges(
    views: &[TrackView],
    graph: &mut JunctionGraph,
    min_views: usize,
    clustering: &ClusteringConfig,
    config: &GraphAdjustmentConfig,
) {
    let confirmed: Vec<Option<GraphEdge>> = graph
        .edges
        .par_iter()
        .map(|edge| {
            let line = segment_of_edge(graph, edge);
            let supports = supports_of(views, &line, clustering);
            let enough = view_count(&supports) >= min_views
                && mean_distance(views, &supports, &line) <= config.max_mean_distance_in_pixels;
            enough.then_some(GraphEdge {
                junctions: edge.junctions,
                supports,
            })
        })
        .collect();
    graph.edges = confirmed.into_iter().flatten().collect();
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
    let sum: f64 = supports
        .iter()
        .map(|id| {
            let segment = &segment_of(views, *id).segment;
            ProjectedLine::new(&views[id.view].camera, line).map_or(f64::INFINITY, |line| {
                0.5 * segment
                    .ends()
                    .iter()
                    .map(|end| line.distance(end).abs())
                    .sum::<f64>()
            })
        })
        .sum();
    sum / supports.len().max(1) as f64
}
