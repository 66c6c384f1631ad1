//! The golden tensors of the published code, as points and segments.

#![allow(dead_code, reason = "every test uses its own part of this")]

#[path = "../../../tests/data/golden/reader.rs"]
mod reader;

use nalgebra::Vector3;
use neat_core::LineSegment3;
pub use reader::Golden;
use std::path::{Path, PathBuf};

/// The root of the repository.
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Golden tensors read as geometry.
pub trait Geometry {
    /// A tensor `[n, 3]` as points.
    fn points(&self, name: &str) -> Vec<Vector3<f64>>;

    /// A tensor `[n, 2, 3]` as segments.
    fn segments(&self, name: &str) -> Vec<LineSegment3> {
        let points = self.points(name);
        let (ends, _) = points.as_chunks::<2>();
        ends.iter()
            .map(|[a, b]| LineSegment3::new(*a, *b))
            .collect()
    }
}

impl Geometry for Golden {
    fn points(&self, name: &str) -> Vec<Vector3<f64>> {
        self.rows::<3>(name)
            .into_iter()
            .map(Vector3::from)
            .collect()
    }
}
