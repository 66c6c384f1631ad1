//! Views without noise, mostly of a cube, for the unit tests of the steps.

use super::edge_samples::Images;
use super::line_selection::ChosenLine;
use super::view_segments::PreparedView;
use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};
use nalgebra::Vector3;
use neat_core::{Camera, EdgelMap, LineSegment3};

/// Views whose edgels are their segments.
pub(super) struct TestViews {
    views: Vec<PreparedView>,
    maps: Vec<EdgelMap>,
}

impl TestViews {
    /// Of all edges of the cube of half side 0.5; segment e shows edge e.
    pub(super) fn of_cube(count: usize) -> Self {
        let (junctions, edges) = cube();
        Self::of_edges(&cameras_on_sphere(count), &junctions, &edges)
    }

    /// Of all edges between junctions; segment e shows edge e.
    pub(super) fn of_edges(
        cameras: &[Camera],
        junctions: &[Vector3<f64>],
        edges: &[[usize; 2]],
    ) -> Self {
        let observations = views_of_edges(cameras, junctions, edges);
        let prepared = observations
            .iter()
            .map(|observation| PreparedView::new(observation, 1.0, 1.0));
        Self::of(prepared.collect())
    }

    pub(super) fn of(views: Vec<PreparedView>) -> Self {
        Self {
            maps: views.iter().map(super::edgels_of_segments).collect(),
            views,
        }
    }

    pub(super) fn images(&self) -> Images<'_> {
        Images {
            views: &self.views,
            maps: &self.maps,
            reach: 0.5,
            rounding: 0.0,
        }
    }
}

/// The true segment of an edge of the cube.
pub(super) fn cube_edge(edge: usize) -> LineSegment3 {
    let (junctions, edges) = cube();
    let [a, b] = edges[edge];
    LineSegment3::new(junctions[a], junctions[b])
}

/// A line with what the images say about it.
pub(super) fn chosen(images: &Images, line: &LineSegment3) -> ChosenLine {
    ChosenLine {
        line: *line,
        evidence: images.evidence(line, None, 0.0),
        placed: false,
    }
}

/// Larger distance of corresponding ends, in the better order.
pub(super) fn end_distance(a: &LineSegment3, b: &LineSegment3) -> f64 {
    let farther = |b: &LineSegment3| {
        let [start, end] = a.end_distances(b);
        start.max(end)
    };
    farther(b).min(farther(&b.reversed()))
}
