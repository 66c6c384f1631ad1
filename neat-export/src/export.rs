//! A document to a file.

use crate::orthographic::Drawing;
use crate::{ExportError, ExportOptions, Format};
use crate::{colmap, dxf, geojson, gltf, limap, npz, picture, step, svg};
use neat_core::file;
use neat_wireframe::export::{WireframeDocument, write_json, write_obj, write_ply};
use std::path::{Path, PathBuf};

/// What an export has written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The files, complete.
    pub files: Vec<PathBuf>,
    /// Number of junctions that passed the filter.
    pub junctions: usize,
    /// Number of edges that passed the filter.
    pub edges: usize,
    /// What the format has no words for and the files therefore lack, one sentence
    /// each.
    pub left_out: Vec<String>,
}

/// Writes a document in a format, in the frame and the unit of the document.
///
/// `path` is a file that is replaced when the new one is complete; for a
/// [`Format::is_folder`], a new or empty folder.
///
/// # Errors
/// If an option is out of range, the document is not valid or lacks a field that
/// the filter needs, the format cannot hold it, or the system refuses to write.
pub fn export(
    document: &WireframeDocument,
    path: &Path,
    format: Format,
    options: &ExportOptions,
) -> Result<Written, ExportError> {
    options.check()?;
    document.check(path)?;
    let document = options.filter.apply(document)?;
    let mut written = Written {
        files: vec![path.into()],
        junctions: document.junctions.len(),
        edges: document.edges.len(),
        left_out: Vec::new(),
    };
    let out_of_range = || ExportError::OutOfRange {
        path: path.into(),
        format: format.name(),
    };
    let drawing = || {
        Drawing::new(&document.junctions, options.direction, options.width).ok_or_else(out_of_range)
    };
    let write = |bytes: &[u8]| file::write_atomically(path, bytes);
    match format {
        Format::Json => write_json(path, &document)?,
        Format::Obj => write_obj(path, &document.wireframe())?,
        Format::Ply => write_ply(path, &document.wireframe())?,
        Format::Gltf => write(&gltf::text(&document).ok_or_else(out_of_range)?)?,
        Format::Glb => write(&gltf::binary(&document).ok_or_else(out_of_range)?)?,
        Format::Dxf => write(dxf::text(&document).as_bytes())?,
        Format::Step => {
            let step = step::text(&document, options.unit);
            let lacking = [
                (step.edges_without_length, "edges without length"),
                (step.lonely_junctions, "junctions without edges"),
            ];
            for (count, what) in lacking.into_iter().filter(|(count, _)| *count > 0) {
                let sentence = format!("a STEP wireframe has no {what}: {count} left out");
                written.left_out.push(sentence);
            }
            write(step.text.as_bytes())?;
        }
        Format::Svg => write(svg::text(&document, &drawing()?).as_bytes())?,
        Format::Png => file::write_png(path, &picture::draw(&document, &drawing()?))?,
        Format::GeoJson => write(geojson::text(&document).as_bytes())?,
        Format::Npz => npz::write(path, &document)?,
        Format::Colmap => written.files = colmap::write(path, &document)?,
        Format::Limap => written.files = limap::write(path, &document)?,
    }
    Ok(written)
}
