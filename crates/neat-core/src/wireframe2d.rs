//! 2D wireframes: scored vertices joined by scored edges, as HAWP writes them.

use crate::LineSegment2;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// A segment of a 2D wireframe with the detector's score.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoredSegment2 {
    /// The segment, in image coordinates.
    pub segment: LineSegment2,
    /// The detector's confidence, in [0, 1].
    pub score: f64,
    /// Which edge of the [`Wireframe2d`] this is.
    pub edge: usize,
}

/// Junctions and edges that a detector found in one image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wireframe2d {
    /// Vertices in image coordinates (see [`crate::Scene::pixel_center`]).
    pub vertices: Vec<Vector2<f64>>,
    /// One score per vertex.
    pub vertex_scores: Vec<f64>,
    /// Index pairs into `vertices`.
    pub edges: Vec<[usize; 2]>,
    /// One score per edge (`edges-weights` in HAWP's files).
    pub edge_scores: Vec<f64>,
    /// Width of the image it was detected in.
    pub width: u32,
    /// Height of the image it was detected in.
    pub height: u32,
}

impl Wireframe2d {
    /// The segments whose score is strictly greater than `min_score`, in file
    /// order.
    pub fn segments(&self, min_score: f64) -> Vec<ScoredSegment2> {
        self.edges
            .iter()
            .zip(&self.edge_scores)
            .enumerate()
            .filter(|(_, (_, score))| **score > min_score)
            .map(|(edge, ([a, b], score))| ScoredSegment2 {
                segment: LineSegment2::new(self.vertices[*a], self.vertices[*b]),
                score: *score,
                edge,
            })
            .collect()
    }
}
