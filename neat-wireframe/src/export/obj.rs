//! Wavefront OBJ: `v` and `l` elements.

use super::{ExportError, check};
use crate::Wireframe3d;
use neat_core::file;
use std::fmt::Write;
use std::path::Path;

/// Writes junctions as `v x y z` and edges as `l i j`, counted from 1.
///
/// # Errors
/// If a junction is not finite, an edge names no junction, or the file cannot be
/// written.
pub fn write_obj(path: &Path, wireframe: &Wireframe3d) -> Result<(), ExportError> {
    check(path, &wireframe.junctions, &wireframe.edges)?;
    let mut text = String::new();
    for p in &wireframe.junctions {
        // `{:?}` is the shortest text that reads back as the same number.
        let _ = writeln!(text, "v {:?} {:?} {:?}", p.x, p.y, p.z);
    }
    for [a, b] in &wireframe.edges {
        let _ = writeln!(text, "l {} {}", a + 1, b + 1);
    }
    Ok(file::write_atomically(path, text.as_bytes())?)
}
