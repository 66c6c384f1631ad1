//! The final test of every edge against the 2D segments of all views.
//!
//! An edge stays if enough views show it, among those that ought to, with
//! segments that no stronger edge explains.

use super::clustering::{lies_on, view_count};
use super::graph_adjustment::segment_of_edge;
use super::junction_graph::{GraphEdge, JunctionGraph};
use super::line_refinement::shown_interval;
use super::projected_line::ProjectedLine;
use super::track_merging::project_segment;
use super::view_segments::{SegmentId, TrackView, segment_of};
use nalgebra::Vector3;
use neat_core::LineSegment3;
use rayon::prelude::*;

/// Supports lie this near to the edge in the mean.
const MAX_MEAN_DISTANCE_IN_PIXELS: f64 = 1.5;
/// Share of the views that ought to show the edge which do …
const MIN_SUPPORT_SHARE: f64 = 0.4;
/// … and the same with the detector's score in the place of each view: texture
/// and curves make many weak detections.
const MIN_SCORE_SHARE: f64 = 0.15;
/// Views within this angle of a view that shows the edge, with the whole edge
/// in the image, ought to show it too: what hides it would hide it there.
const EXPECTED_ANGLE_IN_DEGREES: f64 = 15.0;
/// A view shows an edge if its segments cover this share of what of it lies in
/// the image: short pieces at a place here and there make no long edge.
const MIN_COVERED_SHARE: f64 = 0.3;
/// An edge explains a 2D segment if it covers this share of it.
const MIN_EXPLAINED_SHARE: f64 = 0.5;

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
pub(super) fn confirm_edges(views: &[TrackView], graph: &mut JunctionGraph, min_views: usize) {
    let candidates: Vec<Option<Candidate>> = graph
        .edges
        .par_iter()
        .map(|edge| candidate(views, graph, edge, min_views))
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
) -> Option<Candidate> {
    let line = segment_of_edge(graph, edge);
    let supports = supports_of(views, &line);
    if view_count(&supports) < min_views {
        return None;
    }
    let (views_share, score_share) = support_shares(views, &supports, &line);
    let enough = views_share >= MIN_SUPPORT_SHARE
        && score_share >= MIN_SCORE_SHARE
        && mean_distance(views, &supports, &line) <= MAX_MEAN_DISTANCE_IN_PIXELS;
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
        if share >= MIN_EXPLAINED_SHARE {
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

/// All 2D segments that lie on a 3D segment, of the views that show enough of it,
/// ascending.
fn supports_of(views: &[TrackView], line: &LineSegment3) -> Vec<SegmentId> {
    let mut supports = Vec::new();
    for (view, prepared) in views.iter().enumerate() {
        let Some(projected) = project_segment(prepared, line) else {
            continue;
        };
        let near = prepared.index.near(&projected).into_iter();
        let on_line: Vec<SegmentId> = near
            .map(|segment| SegmentId { view, segment })
            .filter(|id| lies_on(views, *id, line))
            .collect();
        if covered_share(views, view, &on_line, line) >= MIN_COVERED_SHARE {
            supports.extend(on_line);
        }
    }
    supports
}

/// The share of the part of a 3D segment within a view's image that 2D segments
/// of the view show.
fn covered_share(
    views: &[TrackView],
    view: usize,
    supports: &[SegmentId],
    line: &LineSegment3,
) -> f64 {
    /// Evenly spaced places on the line that are tested.
    const SAMPLES: usize = 16;
    let shown: Vec<[f64; 2]> = supports
        .iter()
        .filter_map(|id| shown_interval(views, *id, line))
        .collect();
    let (mut covered, mut within) = (0, 0_usize);
    for sample in 0..SAMPLES {
        let place = (sample as f64 + 0.5) / SAMPLES as f64;
        if views[view].camera.sees(&line.point_at(place)) {
            within += 1;
            let is_shown = |[low, high]: &[f64; 2]| (*low..=*high).contains(&place);
            covered += usize::from(shown.iter().any(is_shown));
        }
    }
    covered as f64 / within.max(1) as f64
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

/// The views that show an edge as a share of those that ought to: as they are, and
/// weighted by the score of the best detection.
fn support_shares(views: &[TrackView], supports: &[SegmentId], line: &LineSegment3) -> (f64, f64) {
    let middle = line.point_at(0.5);
    let toward =
        |view: usize| -> Vector3<f64> { (views[view].camera.center_in_world - middle).normalize() };
    let mut showing = Vec::new();
    let mut scores = 0.0;
    for group in supports.chunk_by(|a, b| a.view == b.view) {
        showing.push(group[0].view);
        scores += group
            .iter()
            .map(|id| segment_of(views, *id).score)
            .fold(0.0, f64::max);
    }
    let directions: Vec<Vector3<f64>> = showing.iter().map(|view| toward(*view)).collect();
    let min_cosine = EXPECTED_ANGLE_IN_DEGREES.to_radians().cos();
    let expected = (0..views.len())
        .filter(|view| {
            showing.binary_search(view).is_ok()
                || (!views[*view].segments.is_empty()
                    && line.ends().iter().all(|end| views[*view].camera.sees(end))
                    && directions
                        .iter()
                        .any(|d| d.dot(&toward(*view)) >= min_cosine))
        })
        .count()
        .max(1) as f64;
    (showing.len() as f64 / expected, scores / expected)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::junction_graph::junction_graph;
    use crate::line_tracks::test_tracks::{cube_tracks, cube_views};

    fn confirmed(views: &[TrackView], mut graph: JunctionGraph) -> JunctionGraph {
        confirm_edges(views, &mut graph, 3);
        graph
    }

    fn cube_graph(views: &[TrackView]) -> JunctionGraph {
        junction_graph(views, &cube_tracks(views), 3)
    }

    #[test]
    fn true_edges_stay_and_others_go() {
        let views = cube_views(12);
        let graph = cube_graph(&views);
        let mut with_false = graph.clone();
        // The diagonal, and a near copy of an edge.
        with_false.edges.push(GraphEdge {
            junctions: [0, 7],
            supports: graph.edges[0].supports.clone(),
        });
        let [a, b] = graph.edges[3].junctions;
        let copies = [a, b].map(|junction| {
            with_false
                .junctions
                .push(graph.junctions[junction].add_scalar(1e-3));
            with_false.junctions.len() - 1
        });
        with_false.edges.push(GraphEdge {
            junctions: copies,
            supports: graph.edges[3].supports.clone(),
        });
        let found = confirmed(&views, with_false);
        assert_eq!(found.edges.len(), 12);
        let pairs =
            |graph: &JunctionGraph| graph.edges.iter().map(|e| e.junctions).collect::<Vec<_>>();
        assert_eq!(pairs(&found), pairs(&graph));
    }

    #[test]
    fn edges_that_most_views_ought_to_show_and_do_not_go() {
        let mut views = cube_views(60);
        let graph = cube_graph(&views);
        // Only every tenth view shows edge 4.
        for (i, view) in views.iter_mut().enumerate() {
            if i % 10 != 0 {
                view.segments[4].score = 0.0;
            }
        }
        assert_eq!(confirmed(&views, graph).edges.len(), 11);
    }

    #[test]
    fn short_pieces_do_not_confirm_a_long_edge() {
        use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};
        let graph = cube_graph(&cube_views(12));
        let (junctions, edges) = cube();
        let mut observations = views_of_edges(&cameras_on_sphere(12), &junctions, &edges);
        for observation in &mut observations {
            let whole = observation.segments[3].segment;
            observation.segments[3].segment.start = whole.point_at(0.4);
            observation.segments[3].segment.end = whole.point_at(0.6);
        }
        let views: Vec<TrackView> = observations
            .iter()
            .map(|observation| TrackView::new(observation, 1.0, 1.0))
            .collect();
        assert_eq!(confirmed(&views, graph).edges.len(), 11);
    }
}
