//! A document to a file.

use crate::format::Format;
use crate::target::{Target, Written};
use crate::{EdgeFilter, ExportError, ExportOptions};
use neat_wireframe::export::WireframeDocument;
use std::path::Path;

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
    let document = &options.filter.apply(document)?;
    let mut target = Target {
        format: format.name(),
        path,
        document,
        options,
        written: Written {
            files: vec![path.into()],
            junctions: document.junctions.len(),
            edges: document.edges.len(),
            arcs: document.arcs.len(),
            splines: document.splines.len(),
            remarks: Vec::new(),
        },
    };
    let counts = [
        (document.arcs.len(), "arcs"),
        (document.splines.len(), "splines"),
    ];
    for (_, what) in counts.iter().filter(|(count, _)| *count > 0) {
        if options.filter != EdgeFilter::default() {
            target.written.remarks.push(format!(
                "{what} have neither a probability nor a kind, so the filter leaves out none"
            ));
        }
    }
    format.write(&mut target)?;
    if !format.holds_faces() {
        let shells = document.shells.iter();
        let faces = shells.map(|shell| shell.faces.len()).sum();
        target.leave_out(faces, &format!("{} has no faces", format.name()));
    }
    Ok(target.written)
}
