//! Joins the ends of edges that hang free: to each other, to a junction, or to
//! the inside of another edge.
//!
//! Detectors stop short of corners or run past them, and few of their segments
//! share a vertex. Two edges meet if one point lies on both of their images, in
//! all views that show them; their distance in space says less, since few views
//! leave depth uncertain. An end moves along its own edge by a few pixels, or as
//! far as 2D segments cover the gap.

use super::edge_splitting::Split;
use super::free_end_search::{Found, Search, Target};
use super::junction_graph::JunctionGraph;
use super::line_refinement::LineRefinementConfig;
use super::view_segments::TrackView;
use std::collections::BTreeSet;

/// Joined ends let others find them: the search is repeated up to this many
/// times. 0 switches the step off.
const ROUNDS: usize = 3;
/// Edges that meet pass each other this near in their images, as a multiple of
/// the noise of the 2D segments.
pub(super) const MAX_MISS_IN_NOISE: f64 = 3.0;
/// An edge on which another one ends bends by at most this multiple of the
/// noise.
pub(super) const MAX_BEND_IN_NOISE: f64 = 1.0;
/// Sine of the angle between two edges that meet, at least.
pub(super) const MIN_SINE: f64 = 0.4;
/// An end moves this far along its edge without further evidence …
pub(super) const MAX_SHIFT_IN_PIXELS: f64 = 12.0;
/// … and by at most this share of its edge.
pub(super) const MAX_RELATIVE_SHIFT: f64 = 0.25;
/// It grows by up to this share of its edge where 2D segments cover the gap.
pub(super) const MAX_COVERED_EXTENSION: f64 = 0.5;
/// A view covers a gap if its segments on the line show this share of it.
pub(super) const MIN_COVERED_SHARE: f64 = 0.6;
/// Views that cover a gap, at least …
pub(super) const MIN_COVERING_VIEWS: usize = 2;
/// … and as a share of the views that show the edge.
pub(super) const MIN_COVERING_SHARE: f64 = 0.2;

/// What the step has done.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct JoinedEnds {
    /// Pairs of free ends that have become one junction.
    pub corners: usize,
    /// Free ends that have become part of a junction.
    pub attached: usize,
    /// Ends that lie on the inside of another edge now.
    pub on_edges: Vec<Split>,
}

/// Moves and joins free ends. Edges stay whole: those that others end on are to be
/// split.
pub(super) fn join_free_ends(
    views: &[TrackView],
    graph: &mut JunctionGraph,
    noise_in_pixels: f64,
    refinement: &LineRefinementConfig,
) -> JoinedEnds {
    let mut joined = JoinedEnds::default();
    for _ in 0..ROUNDS {
        let found =
            Search::new(views, graph, &joined.on_edges, noise_in_pixels, refinement).found();
        if !apply(graph, &found, &mut joined) {
            break;
        }
    }
    joined
}

/// The best first, each free end once. Returns whether anything has been joined.
fn apply(graph: &mut JunctionGraph, found: &[Found], joined: &mut JoinedEnds) -> bool {
    let mut changed = vec![false; graph.junctions.len()];
    let mut pairs: BTreeSet<[usize; 2]> = graph.edges.iter().map(|e| sorted(e.junctions)).collect();
    let mut edge_of: Vec<usize> = vec![usize::MAX; graph.junctions.len()];
    for (i, edge) in graph.edges.iter().enumerate() {
        for junction in edge.junctions {
            edge_of[junction] = i;
        }
    }
    let mut any = false;
    for Found {
        junction, target, ..
    } in found
    {
        if changed[*junction] {
            continue;
        }
        match *target {
            Target::FreeEnd {
                junction: other,
                place,
            } => {
                if changed[other]
                    || !replace(graph, &mut pairs, edge_of[*junction], *junction, other)
                {
                    continue;
                }
                graph.junctions[other] = place;
                changed[other] = true;
                joined.corners += 1;
            }
            Target::Junction { junction: other } => {
                if changed[other]
                    || !replace(graph, &mut pairs, edge_of[*junction], *junction, other)
                {
                    continue;
                }
                joined.attached += 1;
            }
            Target::Inside { edge, place } => {
                graph.junctions[*junction] = place;
                joined.on_edges.push(Split {
                    edge,
                    junction: *junction,
                });
            }
        }
        changed[*junction] = true;
        any = true;
    }
    any
}

/// Gives an edge another junction, unless it would become a loop or a copy.
fn replace(
    graph: &mut JunctionGraph,
    pairs: &mut BTreeSet<[usize; 2]>,
    edge: usize,
    old: usize,
    new: usize,
) -> bool {
    let before = graph.edges[edge].junctions;
    let after = before.map(|junction| if junction == old { new } else { junction });
    if after[0] == after[1] || !pairs.insert(sorted(after)) {
        return false;
    }
    pairs.remove(&sorted(before));
    graph.edges[edge].junctions = after;
    true
}

fn sorted([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::junction_graph::GraphEdge;
    use crate::line_tracks::view_segments::SegmentId;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use nalgebra::Vector3;

    /// Every edge with junctions of its own, as it is seen by ten cameras, and the
    /// graph of shown edges, which may be shorter.
    fn scene(seen: &[[[f64; 3]; 2]], known: &[[[f64; 3]; 2]]) -> (Vec<TrackView>, JunctionGraph) {
        let junctions = |edges: &[[[f64; 3]; 2]]| -> Vec<Vector3<f64>> {
            edges.iter().flatten().map(|x| Vector3::from(*x)).collect()
        };
        let pairs: Vec<[usize; 2]> = (0..seen.len()).map(|i| [2 * i, 2 * i + 1]).collect();
        let views = views_of_edges(&cameras_on_sphere(10), &junctions(seen), &pairs)
            .iter()
            .map(|observation| TrackView::new(observation, 1.0, 1.0))
            .collect();
        let edges = (0..known.len())
            .map(|segment| GraphEdge {
                junctions: pairs[segment],
                supports: (0..10).map(|view| SegmentId { view, segment }).collect(),
            })
            .collect();
        let graph = JunctionGraph {
            junctions: junctions(known),
            edges,
        };
        (views, graph)
    }

    fn join(views: &[TrackView], graph: &mut JunctionGraph) -> JoinedEnds {
        let refinement = LineRefinementConfig::default();
        join_free_ends(views, graph, 0.5, &refinement)
    }

    #[test]
    fn a_bar_that_runs_past_a_post_ends_on_it() {
        // A post, a bar that runs 0.01 (about 3 pixels) past it, and one that
        // crosses it.
        let edges = [
            [[0.0, -0.4, 0.0], [0.0, 0.4, 0.0]],
            [[-0.01, 0.1, 0.0], [0.5, 0.1, 0.0]],
            [[-0.3, -0.1, 0.0], [0.3, -0.1, 0.0]],
        ];
        let (views, mut graph) = scene(&edges, &edges);
        let before = graph.clone();
        let joined = join(&views, &mut graph);
        assert_eq!((joined.corners, joined.attached), (0, 0));
        assert_eq!(
            joined.on_edges,
            [Split {
                edge: 0,
                junction: 2
            }]
        );
        assert!((graph.junctions[2] - Vector3::new(0.0, 0.1, 0.0)).norm() < 1e-9);
        for untouched in [0, 1, 3, 4, 5] {
            assert_eq!(graph.junctions[untouched], before.junctions[untouched]);
        }
    }

    #[test]
    fn ends_that_stop_short_of_a_corner_meet_in_it() {
        let edges = [
            [[0.02, 0.0, 0.0], [0.4, 0.0, 0.0]],
            [[0.0, 0.015, 0.0], [0.0, 0.4, 0.0]],
            [[0.0, 0.0, 0.01], [0.0, 0.0, 0.4]],
        ];
        let (views, mut graph) = scene(&edges, &edges);
        let joined = join(&views, &mut graph);
        assert_eq!((joined.corners, joined.attached), (1, 1));
        let corner = graph.edges[0].junctions[0];
        assert!(
            graph
                .edges
                .iter()
                .all(|edge| edge.junctions.contains(&corner))
        );
        assert!(graph.junctions[corner].norm() < 1e-9);
    }

    #[test]
    fn an_edge_grows_only_where_segments_show_it() {
        let seen = [
            [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]],
            [[0.0, -0.3, 0.0], [0.0, 0.3, 0.0]],
        ];
        let short = [[[0.1, 0.0, 0.0], [0.4, 0.0, 0.0]], seen[1]];
        let (views, mut graph) = scene(&seen, &short);
        let joined = join(&views, &mut graph);
        assert_eq!(
            joined.on_edges,
            [Split {
                edge: 1,
                junction: 0
            }]
        );
        assert!(graph.junctions[0].norm() < 1e-9);

        let (views, mut graph) = scene(&short, &short);
        assert_eq!(join(&views, &mut graph), JoinedEnds::default());
    }

    #[test]
    fn edges_that_cross_in_some_images_only_do_not_meet() {
        let edges = [
            [[0.0, -0.4, 0.0], [0.0, 0.4, 0.0]],
            [[0.01, 0.1, 0.06], [0.5, 0.1, 0.06]],
        ];
        let (views, mut graph) = scene(&edges, &edges);
        assert_eq!(join(&views, &mut graph), JoinedEnds::default());
    }
}
