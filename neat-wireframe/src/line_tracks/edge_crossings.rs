//! Edges that cross each other on the inside of both, such as the bars of a
//! window: the crossing is a junction too.

use super::certain_line::{CertainLine, certain_lines, meeting};
use super::edge_splitting::{self, Split};
use super::junction_graph::JunctionGraph;
use super::line_refinement::LineRefinementConfig;
use super::track_merging::project_segment;
use super::view_segments::TrackView;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Views of an edge in which the edges that cross it are looked for: who crosses
/// it in space crosses it in all of them.
const SEARCHED_VIEWS: usize = 4;

/// Adds a junction to the graph for every two edges that cross; returns where the
/// edges are to be split.
pub(super) fn add_crossings(
    views: &[TrackView],
    graph: &mut JunctionGraph,
    noise_in_pixels: f64,
    refinement: &LineRefinementConfig,
) -> Vec<Split> {
    let lines = certain_lines(views, graph, refinement);
    let edges_of = graph.edges_of_segments(views);
    let max_miss = edge_splitting::MAX_CROSSING_MISS_IN_NOISE * noise_in_pixels;
    let found: Vec<Vec<(usize, Vector3<f64>)>> = (0..lines.len())
        .into_par_iter()
        .map(|edge| {
            let Some(line) = &lines[edge] else {
                return Vec::new();
            };
            near_edges(views, line, &edges_of)
                .into_iter()
                .filter(|other| edge < *other && !share_junction(graph, edge, *other))
                .filter_map(|other| {
                    let other_line = lines[other].as_ref()?;
                    let place = crossing(views, line, other_line, max_miss)?;
                    Some((other, place))
                })
                .collect()
        })
        .collect();
    let mut splits = Vec::new();
    for (edge, crossings) in found.into_iter().enumerate() {
        for (other, place) in crossings {
            let junction = graph.junctions.len();
            graph.junctions.push(place);
            splits.extend([edge, other].map(|edge| Split { edge, junction }));
        }
    }
    splits
}

fn share_junction(graph: &JunctionGraph, a: usize, b: usize) -> bool {
    let of_b = &graph.edges[b].junctions;
    graph.edges[a].junctions.iter().any(|j| of_b.contains(j))
}

/// The edges that some views of a line show near it, ascending.
fn near_edges(views: &[TrackView], line: &CertainLine, edges_of: &[Vec<Vec<usize>>]) -> Vec<usize> {
    let step = line.views.len().div_ceil(SEARCHED_VIEWS).max(1);
    let mut near = Vec::new();
    for view in line.views.iter().step_by(step) {
        if let Some(projected) = project_segment(&views[*view], &line.line) {
            for segment in views[*view].index.near(&projected) {
                near.extend(&edges_of[*view][segment]);
            }
        }
    }
    near.sort_unstable();
    near.dedup();
    near
}

/// The point in which two edges cross, well within both.
fn crossing(
    views: &[TrackView],
    a: &CertainLine,
    b: &CertainLine,
    max_miss: f64,
) -> Option<Vector3<f64>> {
    // Most pairs end here, before anything is projected.
    let within = |parameters: [f64; 2]| {
        [a, b].iter().zip(parameters).all(|(line, t)| {
            t.min(1.0 - t) * line.length_in_pixels()
                >= edge_splitting::MIN_CROSSING_LENGTH_IN_PIXELS
        })
    };
    let found = meeting(views, a, b, edge_splitting::MIN_SINE)?;
    (found.miss_in_pixels <= max_miss && within(found.parameters)).then_some(found.place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::junction_graph::GraphEdge;
    use crate::line_tracks::view_segments::SegmentId;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};

    #[test]
    fn bars_that_cross_share_a_junction_and_those_apart_do_not() {
        let junctions = vec![
            Vector3::new(0.0, -0.4, 0.0),
            Vector3::new(0.0, 0.4, 0.0),
            Vector3::new(-0.3, 0.1, 0.0),
            Vector3::new(0.5, 0.1, 0.0),
            // Crosses the first in the images from the front only.
            Vector3::new(-0.3, -0.1, 0.1),
            Vector3::new(0.5, -0.1, 0.1),
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
        let mut graph = JunctionGraph { junctions, edges };
        let refinement = LineRefinementConfig::default();
        let splits = add_crossings(&views, &mut graph, 0.5, &refinement);
        assert_eq!(splits, [0, 1].map(|edge| Split { edge, junction: 6 }));
        assert!((graph.junctions[6] - Vector3::new(0.0, 0.1, 0.0)).norm() < 1e-9);
    }
}
