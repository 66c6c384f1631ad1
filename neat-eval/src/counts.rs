//! How large a wireframe is.

use neat_core::Wireframe3d;
use serde::{Deserialize, Serialize};
use std::fmt;

/// How large a wireframe is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WireframeCounts {
    /// Number of junctions, isolated ones included.
    pub junctions: usize,
    /// Number of segments.
    pub segments: usize,
    /// Mean length of the segments; `None` without segments.
    pub mean_length: Option<f64>,
}

impl WireframeCounts {
    /// Of a wireframe whose edges name junctions that exist.
    ///
    /// # Panics
    /// If one does not.
    pub fn of(wireframe: &Wireframe3d) -> Self {
        let segments = wireframe.segments();
        let total_length: f64 = segments.iter().map(|segment| segment.length()).sum();
        Self {
            junctions: wireframe.junctions.len(),
            segments: segments.len(),
            mean_length: (!segments.is_empty()).then(|| total_length / segments.len() as f64),
        }
    }
}

impl fmt::Display for WireframeCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (junctions, segments) = (self.junctions, self.segments);
        write!(f, "{junctions} junctions, {segments} segments")?;
        match self.mean_length {
            Some(length) => write!(f, " of mean length {length:.4}"),
            None => Ok(()),
        }
    }
}
