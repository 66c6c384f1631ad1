//! PLY, ASCII: a `vertex` and an `edge` element.

use super::{ExportError, check};
use crate::Wireframe3d;
use neat_core::file;
use std::fmt::Write;
use std::path::Path;

/// Writes junctions as `vertex` (double x, y, z) and edges as `edge` (int
/// vertex1, vertex2), counted from 0.
///
/// # Errors
/// If a junction is not finite, an edge names no junction, or the file cannot be
/// written.
pub fn write_ply(path: &Path, wireframe: &Wireframe3d) -> Result<(), ExportError> {
    check(path, &wireframe.junctions, &wireframe.edges)?;
    let mut text = format!(
        "ply\n\
         format ascii 1.0\n\
         element vertex {}\n\
         property double x\n\
         property double y\n\
         property double z\n\
         element edge {}\n\
         property int vertex1\n\
         property int vertex2\n\
         end_header\n",
        wireframe.junctions.len(),
        wireframe.edges.len(),
    );
    for p in &wireframe.junctions {
        // `{:?}` is the shortest text that reads back as the same number.
        let _ = writeln!(text, "{:?} {:?} {:?}", p.x, p.y, p.z);
    }
    for [a, b] in &wireframe.edges {
        let _ = writeln!(text, "{a} {b}");
    }
    Ok(file::write_atomically(path, text.as_bytes())?)
}
