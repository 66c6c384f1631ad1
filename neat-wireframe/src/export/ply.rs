//! PLY, ASCII: a `vertex`, a `face` and an `edge` element.

use super::{ExportError, check, check_triangles};
use crate::Wireframe3d;
use neat_core::file;
use std::fmt::Write;
use std::path::Path;

/// Writes junctions as `vertex` (double x, y, z), edges as `edge` (int
/// vertex1, vertex2) and triangles, if there are any, as `face` (list vertex_indices), counted
/// from 0.
///
/// # Errors
/// If a junction is not finite, an edge names no junction, or the file cannot be
/// written.
///
/// # Panics
/// If a triangle names no junction.
pub fn write_ply(
    path: &Path,
    wireframe: &Wireframe3d,
    triangles: &[[usize; 3]],
) -> Result<(), ExportError> {
    check(path, &wireframe.junctions, &wireframe.edges)?;
    check_triangles(triangles, wireframe);
    let faces = match triangles.len() {
        0 => String::new(),
        count => format!("element face {count}\nproperty list uchar int vertex_indices\n"),
    };
    let mut text = format!(
        "ply\n\
         format ascii 1.0\n\
         element vertex {}\n\
         property double x\n\
         property double y\n\
         property double z\n\
         {faces}element edge {}\n\
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
    for [a, b, c] in triangles {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    for [a, b] in &wireframe.edges {
        let _ = writeln!(text, "{a} {b}");
    }
    Ok(file::write_atomically(path, text.as_bytes())?)
}
