//! The bare 3D wireframe: points joined by edges.

use crate::LineSegment3;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Junctions in space and the pairs of them that a segment joins.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wireframe3d {
    /// Positions of the junctions.
    pub junctions: Vec<Vector3<f64>>,
    /// Index pairs into `junctions`.
    pub edges: Vec<[usize; 2]>,
}

impl Wireframe3d {
    /// The segment of an edge.
    ///
    /// # Panics
    /// If the edge names a junction that does not exist.
    pub fn segment(&self, edge: usize) -> LineSegment3 {
        let [a, b] = self.edges[edge];
        LineSegment3::new(self.junctions[a], self.junctions[b])
    }

    /// The segments of all edges, in their order.
    pub fn segments(&self) -> Vec<LineSegment3> {
        (0..self.edges.len()).map(|e| self.segment(e)).collect()
    }

    /// The same graph with every junction mapped by `f`.
    pub fn map(&self, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        Self {
            junctions: self.junctions.iter().map(f).collect(),
            edges: self.edges.clone(),
        }
    }
}
