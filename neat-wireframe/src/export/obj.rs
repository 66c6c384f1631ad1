//! Wavefront OBJ: `v`, `l` and `f` elements.

use super::{ExportError, check, check_triangles};
use crate::Wireframe3d;
use neat_core::file;
use std::fmt::Write;
use std::path::Path;

/// Writes junctions as `v x y z`, edges as `l i j` and triangles of them as `f i j k`, counted from
/// 1.
///
/// # Errors
/// If a junction is not finite, an edge names no junction, or the file cannot be
/// written.
///
/// # Panics
/// If a triangle names no junction.
pub fn write_obj(
    path: &Path,
    wireframe: &Wireframe3d,
    triangles: &[[usize; 3]],
) -> Result<(), ExportError> {
    check(path, &wireframe.junctions, &wireframe.edges)?;
    check_triangles(triangles, wireframe);
    let mut text = String::new();
    for p in &wireframe.junctions {
        // `{:?}` is the shortest text that reads back as the same number.
        let _ = writeln!(text, "v {:?} {:?} {:?}", p.x, p.y, p.z);
    }
    for [a, b] in &wireframe.edges {
        let _ = writeln!(text, "l {} {}", a + 1, b + 1);
    }
    for [a, b, c] in triangles {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    Ok(file::write_atomically(path, text.as_bytes())?)
}
