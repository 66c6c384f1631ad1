//! Ends of edges that stop on the inside of another edge: bars of a window, steps
//! at a wall.
//!
//! Detectors run past such places or stop short of them. A free end moves along
//! its own edge to the edge that it meets; the graph stays as it is, since the
//! other edge goes on.

use super::graph_adjustment::segment_of_edge;
use super::junction_graph::JunctionGraph;
use super::view_segments::{TrackView, segment_of};
use crate::projection::project_in_front;
use nalgebra::Vector3;
use neat_core::{LineSegment2, LineSegment3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Which free ends stop on another edge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TJunctionsConfig {
    /// An end moves this far at most; 0 switches the step off …
    pub max_shift_in_pixels: f64,
    /// … and by at most this share of its edge.
    pub max_relative_shift: f64,
    /// Both lines pass each other this near.
    pub max_line_distance_in_pixels: f64,
    /// Sine of the angle between them at least.
    pub min_sine: f64,
}

impl Default for TJunctionsConfig {
    fn default() -> Self {
        Self {
            max_shift_in_pixels: 8.0,
            max_relative_shift: 0.2,
            max_line_distance_in_pixels: 1.5,
            min_sine: 0.5,
        }
    }
}

/// Moves the ends of single edges to the edges that they all but touch; returns
/// how many moved.
pub(super) fn snap_free_ends(
    views: &[TrackView],
    graph: &mut JunctionGraph,
    config: &TJunctionsConfig,
) -> usize {
    let mut degree = vec![0; graph.junctions.len()];
    for junction in graph.edges.iter().flat_map(|edge| edge.junctions) {
        degree[junction] += 1;
    }
    let lines: Vec<LineSegment3> = graph
        .edges
        .iter()
        .map(|edge| segment_of_edge(graph, edge))
        .collect();
    let mut edges_of: Vec<Vec<Vec<usize>>> = views
        .iter()
        .map(|view| vec![Vec::new(); view.segments.len()])
        .collect();
    for (edge, of_graph) in graph.edges.iter().enumerate() {
        for id in &of_graph.supports {
            edges_of[id.view][id.segment].push(edge);
        }
    }
    // All from the positions before the step, so that the order does not matter.
    let before: &JunctionGraph = graph;
    let places: Vec<[Option<Vector3<f64>>; 2]> = (0..lines.len())
        .into_par_iter()
        .map(|edge| {
            [0, 1].map(|side| {
                let free = degree[before.edges[edge].junctions[side]] == 1;
                free.then(|| meeting_place(views, before, &lines, &edges_of, edge, side, config))?
            })
        })
        .collect();
    let mut moved = 0;
    for (edge, places) in graph.edges.iter().zip(places) {
        for (junction, place) in edge.junctions.into_iter().zip(places) {
            if let Some(place) = place {
                graph.junctions[junction] = place;
                moved += 1;
            }
        }
    }
    moved
}

/// The nearest place on an edge, near one of its ends, where another edge passes.
fn meeting_place(
    views: &[TrackView],
    graph: &JunctionGraph,
    lines: &[LineSegment3],
    edges_of: &[Vec<Vec<usize>>],
    edge: usize,
    side: usize,
    config: &TJunctionsConfig,
) -> Option<Vector3<f64>> {
    let line = &lines[edge];
    let end = line.ends()[side];
    let mut candidates: Vec<usize> = Vec::new();
    let mut pixel_sizes = Vec::new();
    for group in graph.edges[edge].supports.chunk_by(|a, b| a.view == b.view) {
        let view = &views[group[0].view];
        pixel_sizes.push(view.pixel_size_at(&end));
        let Some(pixel) = project_in_front(&view.camera, &end) else {
            continue;
        };
        // A short piece: the index finds what lies within a cell of it.
        let direction = group
            .iter()
            .map(|id| segment_of(views, *id).segment)
            .map(|segment| (segment.end - segment.start).normalize())
            .next()?;
        let piece = LineSegment2::new(pixel - direction, pixel + direction);
        for segment in view.index.near(&piece) {
            candidates.extend(&edges_of[group[0].view][segment]);
        }
    }
    candidates.sort_unstable();
    candidates.dedup();
    pixel_sizes.sort_by(f64::total_cmp);
    let pixel = *pixel_sizes.get(pixel_sizes.len() / 2)?;
    let max_shift =
        (config.max_shift_in_pixels * pixel).min(config.max_relative_shift * line.length());
    candidates
        .into_iter()
        .filter(|other| *other != edge)
        .filter_map(|other| crossing(line, &lines[other], pixel, config))
        .map(|place| ((place - end).norm(), place))
        .filter(|(shift, _)| *shift <= max_shift)
        .min_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, place)| place)
}

/// The point of `line`, prolonged, where the inside of `other` passes it.
fn crossing(
    line: &LineSegment3,
    other: &LineSegment3,
    pixel: f64,
    config: &TJunctionsConfig,
) -> Option<Vector3<f64>> {
    let direction = (line.end - line.start).try_normalize(1e-12)?;
    let other_direction = (other.end - other.start).try_normalize(1e-12)?;
    let cosine = direction.dot(&other_direction);
    let squared_sine = 1.0 - cosine * cosine;
    if squared_sine < config.min_sine * config.min_sine {
        return None;
    }
    let offset = other.start - line.start;
    let along = (offset.dot(&direction) - cosine * offset.dot(&other_direction)) / squared_sine;
    let place = line.start + along * direction;
    // The foot lies within the other segment: its end would be a corner.
    (other.distance_to_point(&place) <= config.max_line_distance_in_pixels * pixel).then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::junction_graph::GraphEdge;
    use crate::line_tracks::view_segments::SegmentId;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};

    #[test]
    fn a_bar_that_runs_past_a_frame_ends_on_it() {
        // A post, a bar that runs 0.01 (about 3 pixels) past it, and one that
        // crosses it.
        let junctions = vec![
            Vector3::new(0.0, -0.4, 0.0),
            Vector3::new(0.0, 0.4, 0.0),
            Vector3::new(-0.01, 0.1, 0.0),
            Vector3::new(0.5, 0.1, 0.0),
            Vector3::new(-0.3, -0.1, 0.0),
            Vector3::new(0.3, -0.1, 0.0),
        ];
        let pairs = [[0, 1], [2, 3], [4, 5]];
        let views: Vec<TrackView> = views_of_edges(&cameras_on_sphere(10), &junctions, &pairs)
            .iter()
            .map(|observation| TrackView::new(observation, 1.0, 1.0))
            .collect();
        let edges = pairs
            .iter()
            .enumerate()
            .map(|(segment, pair)| GraphEdge {
                junctions: *pair,
                supports: (0..10).map(|view| SegmentId { view, segment }).collect(),
            })
            .collect();
        let mut graph = JunctionGraph {
            junctions: junctions.clone(),
            edges,
        };
        let config = TJunctionsConfig::default();
        assert_eq!(snap_free_ends(&views, &mut graph, &config), 1);
        assert!((graph.junctions[2] - Vector3::new(0.0, 0.1, 0.0)).norm() < 1e-12);
        for untouched in [0, 1, 3, 4, 5] {
            assert_eq!(graph.junctions[untouched], junctions[untouched]);
        }
    }
}
