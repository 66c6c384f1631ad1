//! A document to a file.

use crate::isolated::isolated_junctions;
use crate::orthographic::Drawing;
use crate::{ExportError, ExportOptions, Format};
use crate::{colmap, dxf, geojson, gltf, npz, picture, step, svg};
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
/// `path` is a file that is replaced when the new one is complete; for
/// [`Format::Colmap`], a new or empty folder.
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
    let too_large = || ExportError::TooLarge {
        path: path.into(),
        format: format.name(),
    };
    let drawing = || {
        Drawing::new(&document.junctions, options.direction, options.width).ok_or_else(too_large)
    };
    let bytes = match format {
        Format::Json => {
            write_json(path, &document)?;
            return Ok(written);
        }
        Format::Obj => {
            write_obj(path, &document.wireframe())?;
            return Ok(written);
        }
        Format::Ply => {
            write_ply(path, &document.wireframe())?;
            return Ok(written);
        }
        Format::Npz => {
            npz::write(path, &document)?;
            return Ok(written);
        }
        Format::Png => {
            file::write_png(path, &picture::draw(&document, &drawing()?))?;
            return Ok(written);
        }
        Format::Colmap => {
            written.files = colmap::write(path, &document)?;
            return Ok(written);
        }
        Format::Step => {
            let step = step::text(&document, options.unit);
            if step.edges_without_length > 0 {
                let count = step.edges_without_length;
                let sentence = format!("STEP has no edges without length: {count} left out");
                written.left_out.push(sentence);
            }
            let isolated = isolated_junctions(&document).len();
            if isolated > 0 {
                let sentence =
                    format!("a STEP wireframe has no vertices without edges: {isolated} left out");
                written.left_out.push(sentence);
            }
            step.text.into_bytes()
        }
        Format::Gltf => gltf::text(&document).ok_or_else(too_large)?,
        Format::Glb => gltf::binary(&document).ok_or_else(too_large)?,
        Format::Dxf => dxf::text(&document).into_bytes(),
        Format::Svg => svg::text(&document, &drawing()?).into_bytes(),
        Format::GeoJson => geojson::text(&document).into_bytes(),
    };
    file::write_atomically(path, &bytes)?;
    Ok(written)
}
