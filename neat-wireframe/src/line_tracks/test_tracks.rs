//! A cube without noise, as tracks, for the unit tests of the steps.

use super::clustering::Track;
use super::view_segments::{SegmentId, TrackView};
use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};
use neat_core::LineSegment3;

/// Views of all edges of the cube of half side 0.5; segment e shows edge e.
pub(super) fn cube_views(count: usize) -> Vec<TrackView> {
    let (junctions, edges) = cube();
    views_of_edges(&cameras_on_sphere(count), &junctions, &edges)
        .iter()
        .map(|observation| TrackView::new(observation, 1.0, 1.0))
        .collect()
}

/// The true segment of an edge of the cube.
pub(super) fn cube_edge(edge: usize) -> LineSegment3 {
    let (junctions, edges) = cube();
    let [a, b] = edges[edge];
    LineSegment3::new(junctions[a], junctions[b])
}

/// The segments that show an edge, in all views.
pub(super) fn members_of_edge(views: &[TrackView], edge: usize) -> Vec<SegmentId> {
    (0..views.len())
        .map(|view| SegmentId {
            view,
            segment: edge,
        })
        .collect()
}

/// The true track of every edge.
pub(super) fn cube_tracks(views: &[TrackView]) -> Vec<Track> {
    (0..12)
        .map(|edge| Track {
            line: cube_edge(edge),
            members: members_of_edge(views, edge),
        })
        .collect()
}

/// Larger distance of corresponding ends, in the better order.
pub(super) fn end_distance(a: &LineSegment3, b: &LineSegment3) -> f64 {
    let farther = |b: &LineSegment3| {
        let [start, end] = a.end_distances(b);
        start.max(end)
    };
    farther(b).min(farther(&b.reversed()))
}
