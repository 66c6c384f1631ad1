//! Cuts edges at the junctions that lie on their inside: bars of a window, steps
//! at a wall.

use super::certain_line::{CertainLine, certain_lines, mean_distance_in_pixels};
use super::clustering::view_count;
use super::junction_graph::{GraphEdge, JunctionGraph};
use super::line_refinement::{LineRefinementConfig, shown_interval};
use super::view_segments::{SegmentId, TrackView};
use crate::projection::project_in_front;
use nalgebra::Vector2;
use neat_core::{LineSegment2, LineSegment3};
use pathfinding::undirected::connected_components::components;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Such a junction lies this near to the edge in the images, as a multiple of
/// the noise of the 2D segments.
const MAX_DISTANCE_IN_NOISE: f64 = 2.0;
/// Sine of the angle between its own edges and the one that it cuts, at least.
pub(super) const MIN_SINE: f64 = 0.4;
/// Edges that cross on the inside of both share a junction if they pass each
/// other this near in the images, as a multiple of the noise …
pub(super) const MAX_CROSSING_MISS_IN_NOISE: f64 = 1.5;
/// … and all four pieces are at least this long.
pub(super) const MIN_CROSSING_LENGTH_IN_PIXELS: f64 = 10.0;
/// Pieces of other cuts are at least this long; junctions on one edge that are nearer to
/// each other become one.
const MIN_LENGTH_IN_PIXELS: f64 = 4.0;

/// A junction on the inside of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Split {
    /// The edge.
    pub edge: usize,
    /// The junction.
    pub junction: usize,
}

/// Cuts edges at the junctions in `on_edges`, and at junctions of several edges
/// that lie on their inside; returns how many it has cut. The edges are sorted
/// afterwards.
pub(super) fn split_edges(
    views: &[TrackView],
    graph: &mut JunctionGraph,
    on_edges: &[Split],
    min_views: usize,
    noise_in_pixels: f64,
    refinement: &LineRefinementConfig,
) -> usize {
    let lines = certain_lines(views, graph, refinement);
    let max_distance = MAX_DISTANCE_IN_NOISE * noise_in_pixels;
    let mut splits = touching(views, graph, &lines, max_distance);
    splits.extend(on_edges);
    splits.sort_unstable();
    splits.dedup();

    let mut same: Vec<Vec<usize>> = Vec::new();
    let mut pieces: Vec<GraphEdge> = Vec::new();
    let mut cut = 0;
    let mut rest = splits.as_slice();
    for (index, edge) in graph.edges.iter().enumerate() {
        let count = rest.iter().take_while(|split| split.edge == index).count();
        let (of_edge, later) = rest.split_at(count);
        rest = later;
        let places = match &lines[index] {
            Some(line) => inner_places(graph, line, of_edge, &mut same),
            None => Vec::new(),
        };
        cut += usize::from(!places.is_empty());
        pieces.extend(cut_edge(views, graph, edge, &places, min_views));
    }
    // The first of those at one place stands for all.
    let mut first: Vec<usize> = (0..graph.junctions.len()).collect();
    for place in components(&same) {
        let smallest = place.iter().copied().min();
        for junction in place {
            first[junction] = smallest.unwrap_or(junction);
        }
    }
    let mut edges: BTreeMap<[usize; 2], Vec<SegmentId>> = BTreeMap::new();
    for piece in pieces {
        let [a, b] = piece.junctions.map(|junction| first[junction]);
        if a != b {
            edges
                .entry([a.min(b), a.max(b)])
                .or_default()
                .extend(piece.supports);
        }
    }
    graph.edges = edges
        .into_iter()
        .map(|(junctions, mut supports)| {
            supports.sort_unstable();
            supports.dedup();
            GraphEdge {
                junctions,
                supports,
            }
        })
        .collect();
    cut
}

/// Junctions of several edges with the edges on whose inside they lie.
fn touching(
    views: &[TrackView],
    graph: &JunctionGraph,
    lines: &[Option<CertainLine>],
    max_distance: f64,
) -> Vec<Split> {
    let edges_of = graph.edges_of_segments(views);
    let mut edges_at: Vec<Vec<usize>> = vec![Vec::new(); graph.junctions.len()];
    for (edge, of_graph) in graph.edges.iter().enumerate() {
        for junction in of_graph.junctions {
            edges_at[junction].push(edge);
        }
    }
    let found: Vec<Vec<Split>> = (0..graph.junctions.len())
        .into_par_iter()
        .filter(|junction| edges_at[*junction].len() > 1)
        .map(|junction| {
            let place = graph.junctions[junction];
            let own: Vec<&CertainLine> = edges_at[junction]
                .iter()
                .filter_map(|edge| lines[*edge].as_ref())
                .collect();
            let mut own_views: Vec<usize> = own.iter().flat_map(|l| l.views.clone()).collect();
            own_views.sort_unstable();
            own_views.dedup();
            let mut near: Vec<usize> = Vec::new();
            for view in &own_views {
                if let Some(pixel) = project_in_front(&views[*view].camera, &place) {
                    let beside = pixel + Vector2::new(1.0, 0.0);
                    let segments = views[*view].index.near(&LineSegment2::new(pixel, beside));
                    near.extend(
                        segments
                            .into_iter()
                            .flat_map(|s| edges_of[*view][s].iter().copied()),
                    );
                }
            }
            near.sort_unstable();
            near.dedup();
            near.retain(|edge| {
                let Some(line) = &lines[*edge] else {
                    return false;
                };
                let across =
                    |own: &&CertainLine| own.direction.cross(&line.direction).norm() >= MIN_SINE;
                is_inside(line, &place)
                    && own.iter().all(across)
                    && line.distance_in_pixels(views, &place) <= max_distance
                    && mean_distance_in_pixels(views, &own_views, &line.line, &place)
                        <= max_distance
            });
            near.into_iter()
                .map(|edge| Split { edge, junction })
                .collect()
        })
        .collect();
    found.into_iter().flatten().collect()
}

/// Whether a place lies on the inside of a segment, both pieces being long enough.
fn is_inside(line: &CertainLine, place: &nalgebra::Vector3<f64>) -> bool {
    let parameter = line.line.line_parameter(place);
    parameter.min(1.0 - parameter) * line.length_in_pixels() >= MIN_LENGTH_IN_PIXELS
}

/// The junctions that cut an edge, in its order; those that lie at one place
/// become the same.
fn inner_places(
    graph: &JunctionGraph,
    line: &CertainLine,
    splits: &[Split],
    same: &mut Vec<Vec<usize>>,
) -> Vec<usize> {
    let mut places: Vec<(f64, usize)> = splits
        .iter()
        .map(|split| split.junction)
        .filter(|junction| is_inside(line, &graph.junctions[*junction]))
        .map(|junction| {
            (
                line.line.line_parameter(&graph.junctions[junction]),
                junction,
            )
        })
        .collect();
    places.sort_by(|(s, a), (t, b)| s.total_cmp(t).then(a.cmp(b)));
    places.dedup_by(|later, earlier| {
        let near = (later.0 - earlier.0) * line.length_in_pixels() < MIN_LENGTH_IN_PIXELS;
        if near {
            same.push(vec![later.1, earlier.1]);
        }
        near
    });
    places.into_iter().map(|(_, junction)| junction).collect()
}

/// The pieces between an edge's ends and the junctions on it, each with the 2D
/// segments that show it. Pieces that too few views show, such as what runs past a
/// corner, are left out.
fn cut_edge(
    views: &[TrackView],
    graph: &JunctionGraph,
    edge: &GraphEdge,
    places: &[usize],
    min_views: usize,
) -> Vec<GraphEdge> {
    if places.is_empty() {
        return vec![edge.clone()];
    }
    let [first, last] = edge.junctions;
    let stops: Vec<usize> = std::iter::once(first)
        .chain(places.iter().copied())
        .chain(std::iter::once(last))
        .collect();
    stops
        .windows(2)
        .map(|ends| {
            let piece = LineSegment3::new(graph.junctions[ends[0]], graph.junctions[ends[1]]);
            let shows = |id: &SegmentId| {
                shown_interval(views, *id, &piece).is_some_and(|[low, high]| {
                    high.min(1.0) - low.max(0.0) > 0.5 * (high - low).min(1.0)
                })
            };
            GraphEdge {
                junctions: [ends[0], ends[1]],
                supports: edge.supports.iter().copied().filter(shows).collect(),
            }
        })
        .filter(|piece| view_count(&piece.supports) >= min_views)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use nalgebra::Vector3;

    #[test]
    fn an_edge_is_cut_where_others_end_on_it() {
        // A post; a bar that ends on it at 0.1; a corner of two bars on it at -0.2.
        let junctions = vec![
            Vector3::new(0.0, -0.4, 0.0),
            Vector3::new(0.0, 0.4, 0.0),
            Vector3::new(0.0, 0.1, 0.0),
            Vector3::new(0.5, 0.1, 0.0),
            Vector3::new(0.0, -0.2, 0.0),
            Vector3::new(0.3, -0.2, 0.0),
            Vector3::new(0.0, -0.2, 0.4),
        ];
        let pairs = [[0, 1], [2, 3], [4, 5], [4, 6]];
        let views: Vec<TrackView> = views_of_edges(&cameras_on_sphere(10), &junctions, &pairs)
            .iter()
            .map(|observation| TrackView::new(observation, 1.0, 1.0))
            .collect();
        let edges: Vec<GraphEdge> = pairs
            .iter()
            .enumerate()
            .map(|(segment, pair)| GraphEdge {
                junctions: *pair,
                supports: (0..10).map(|view| SegmentId { view, segment }).collect(),
            })
            .collect();
        let mut graph = JunctionGraph { junctions, edges };
        let split = |graph: &mut JunctionGraph, on_edges: &[Split]| {
            let refinement = LineRefinementConfig::default();
            split_edges(&views, graph, on_edges, 3, 0.5, &refinement)
        };
        let bar = Split {
            edge: 0,
            junction: 2,
        };
        assert_eq!(split(&mut graph, &[bar]), 1);
        let pairs: Vec<_> = graph.edges.iter().map(|edge| edge.junctions).collect();
        assert_eq!(pairs, [[0, 4], [1, 2], [2, 3], [2, 4], [4, 5], [4, 6]]);
        assert!(graph.edges.iter().all(|edge| edge.supports.len() == 10));
        let again = graph.clone();
        assert_eq!(split(&mut graph, &[]), 0);
        assert_eq!(graph, again);
    }
}
