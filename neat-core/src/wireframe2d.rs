//! 2D wireframes: scored vertices joined by scored edges, as HAWP writes them.

mod mapping;

use crate::LineSegment2;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use thiserror::Error;

/// A detector's confidence, with room for rounding.
const SCORES: RangeInclusive<f64> = 0.0..=1.0 + 1e-6;

/// Vertices lie within so many pixels of the image's corner, whatever the image.
const MAX_COORDINATE: f64 = 1e6;

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

/// Why a 2D wireframe cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Wireframe2dError {
    /// The image has no pixels.
    #[error("its wireframe is for an image without pixels")]
    NoPixels,
    /// Not one score per element.
    #[error("its wireframe has {elements} {kind} but {scores} scores of {kind}")]
    ScoreCount {
        /// "vertices" or "edges".
        kind: &'static str,
        /// How many there are.
        elements: usize,
        /// How many scores there are.
        scores: usize,
    },
    /// NaN or an infinite number.
    #[error("{kind} number {index} of its wireframe or the score of it is not finite")]
    NotFinite {
        /// "vertex" or "edge".
        kind: &'static str,
        /// Which one.
        index: usize,
    },
    /// A score that is no confidence.
    #[error(
        "{kind} number {index} of its wireframe has the score {score:e}: scores are from 0 to 1"
    )]
    Score {
        /// "vertex" or "edge".
        kind: &'static str,
        /// Which one.
        index: usize,
        /// What it is.
        score: f64,
    },
    /// A vertex farther out than any image is large.
    #[error(
        "vertex number {index} of its wireframe lies at ({x:e}, {y:e}) pixels, far outside of any image"
    )]
    FarOutside {
        /// Which one.
        index: usize,
        /// Where it lies.
        x: f64,
        /// Where it lies.
        y: f64,
    },
    /// An edge that names no vertex.
    #[error(
        "edge {edge} of its wireframe names vertex {vertex}, but there are {vertices} vertices"
    )]
    VertexOutOfRange {
        /// The edge.
        edge: usize,
        /// The vertex it names.
        vertex: usize,
        /// How many vertices there are.
        vertices: usize,
    },
}

fn check_score(kind: &'static str, index: usize, score: f64) -> Result<(), Wireframe2dError> {
    if SCORES.contains(&score) {
        return Ok(());
    }
    Err(Wireframe2dError::Score { kind, index, score })
}

impl Wireframe2d {
    /// Checks that every element has a score from 0 to 1, every vertex finite
    /// coordinates, and every edge two vertices.
    ///
    /// # Errors
    /// At the first element that has not.
    pub fn validate(&self) -> Result<(), Wireframe2dError> {
        if self.width == 0 || self.height == 0 {
            return Err(Wireframe2dError::NoPixels);
        }
        let counts = [
            ("vertices", self.vertices.len(), self.vertex_scores.len()),
            ("edges", self.edges.len(), self.edge_scores.len()),
        ];
        for (kind, elements, scores) in counts {
            if elements != scores {
                return Err(Wireframe2dError::ScoreCount {
                    kind,
                    elements,
                    scores,
                });
            }
        }
        for (index, (vertex, score)) in self.vertices.iter().zip(&self.vertex_scores).enumerate() {
            if ![vertex.x, vertex.y, *score].iter().all(|x| x.is_finite()) {
                let kind = "vertex";
                return Err(Wireframe2dError::NotFinite { kind, index });
            }
            check_score("vertex", index, *score)?;
            if vertex.x.abs().max(vertex.y.abs()) > MAX_COORDINATE {
                let (x, y) = (vertex.x, vertex.y);
                return Err(Wireframe2dError::FarOutside { index, x, y });
            }
        }
        for (index, (edge, score)) in self.edges.iter().zip(&self.edge_scores).enumerate() {
            if !score.is_finite() {
                let kind = "edge";
                return Err(Wireframe2dError::NotFinite { kind, index });
            }
            check_score("edge", index, *score)?;
            if let Some(&vertex) = edge.iter().find(|&&v| v >= self.vertices.len()) {
                return Err(Wireframe2dError::VertexOutOfRange {
                    edge: index,
                    vertex,
                    vertices: self.vertices.len(),
                });
            }
        }
        Ok(())
    }

    /// A wireframe of an image in which nothing was detected.
    pub fn empty(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            ..Self::default()
        }
    }

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
