//! Bundle adjustment of the graph with known correspondences.

use super::junction_graph::{GraphEdge, JunctionGraph};
use super::projected_line::ProjectedLine;
use super::track_merging::project_segment;
use super::view_segments::{TrackView, segment_of};
use crate::bundle_adjustment::{EdgeObservation, Loss, ObservedEdge, adjust_observed};
use crate::solve::Cauchy;
use neat_core::LineSegment3;
use rayon::prelude::*;

/// Ends of 2D segments this near to a projected junction pull it.
const END_DISTANCE_IN_PIXELS: f64 = 4.0;
/// What such an end weighs, where the line of a segment weighs 1.
const END_WEIGHT: f64 = 0.3;
/// Scale of the Cauchy loss.
const CAUCHY_SCALE_IN_PIXELS: f64 = 1.0;

/// Moves all junctions until the projected edges lie on their supports.
pub(super) fn adjust_graph(views: &[TrackView], graph: &mut JunctionGraph) {
    let observed: Vec<ObservedEdge> = graph
        .edges
        .par_iter()
        .map(|edge| ObservedEdge {
            junctions: edge.junctions,
            observations: observations(views, graph, edge),
        })
        .collect();
    let loss = Loss {
        cauchy: Cauchy {
            scale: CAUCHY_SCALE_IN_PIXELS,
        },
        end_weight: END_WEIGHT,
    };
    graph.junctions = adjust_observed(&observed, &graph.junctions, loss).junctions;
}

fn observations(
    views: &[TrackView],
    graph: &JunctionGraph,
    edge: &GraphEdge,
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
                    .filter(|end| (end - pixel).norm() <= END_DISTANCE_IN_PIXELS)
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

/// Standard deviation of the distances of 2D segments from the edges that they
/// support, were it not for outliers; never below a tenth of a pixel.
pub(super) fn noise_in_pixels(views: &[TrackView], graph: &JunctionGraph) -> f64 {
    /// Standard deviation of a normal distribution by its median absolute value.
    const DEVIATION_BY_MEDIAN: f64 = 1.4826;
    const LEAST: f64 = 0.1;
    let mut distances: Vec<f64> = Vec::new();
    for edge in &graph.edges {
        let line = segment_of_edge(graph, edge);
        for id in &edge.supports {
            if let Some(projected) = ProjectedLine::new(&views[id.view].camera, &line) {
                let ends = segment_of(views, *id).segment.ends();
                distances.extend(ends.map(|end| projected.distance(&end).abs()));
            }
        }
    }
    distances.sort_by(f64::total_cmp);
    let median = distances.get(distances.len() / 2).copied().unwrap_or(0.0);
    (DEVIATION_BY_MEDIAN * median).max(LEAST)
}

/// The 3D segment of an edge.
pub(super) fn segment_of_edge(graph: &JunctionGraph, edge: &GraphEdge) -> LineSegment3 {
    let [a, b] = edge.junctions.map(|junction| graph.junctions[junction]);
    LineSegment3::new(a, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::junction_graph::junction_graph;
    use crate::line_tracks::test_tracks::{cube_tracks, cube_views};
    use crate::test_scenes::{Noise, cube};

    #[test]
    fn displaced_corners_return() {
        let views = cube_views(12);
        let tracks = cube_tracks(&views);
        let mut graph = junction_graph(&views, &tracks, 3);
        let mut noise = Noise(5);
        for junction in &mut graph.junctions {
            *junction += 0.01 * noise.vector();
        }
        adjust_graph(&views, &mut graph);
        for corner in cube().0 {
            assert!(graph.junctions.iter().any(|x| (x - corner).norm() < 1e-4));
        }
    }
}
