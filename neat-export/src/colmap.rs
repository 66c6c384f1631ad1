//! A COLMAP text model: the junctions as points, the edges in a file beside them.
//!
//! `cameras.txt` and `images.txt` have no entries, but COLMAP opens a model only with
//! all three. `lines3D.txt` is ours: COLMAP has no lines and ignores it.

use crate::ExportError;
use crate::target::Target;
use neat_core::file;
use neat_wireframe::export::WireframeDocument;
use std::fmt::Write;

/// Fills a new or empty folder. Ids count from 1.
pub fn write(to: &mut Target) -> Result<(), ExportError> {
    let (dir, document) = (to.path, to.document);
    let files = [
        (
            "cameras.txt",
            "# No cameras: a wireframe does not know them\n".into(),
        ),
        (
            "images.txt",
            "# No images: a wireframe does not know them\n".into(),
        ),
        ("points3D.txt", points(document)),
        ("lines3D.txt", lines(document)),
    ];
    file::write_dir_atomically(dir, |dir| {
        files
            .iter()
            .try_for_each(|(name, text)| file::write_atomically(&dir.join(name), text.as_bytes()))
    })?;
    to.leave_out_curves("lines3D.txt has pairs of junctions");
    to.written.files = files.iter().map(|(name, _)| dir.join(name)).collect();
    Ok(())
}

fn points(document: &WireframeDocument) -> String {
    let mut text = String::from(
        "# The junctions of a wireframe, a line each:\n\
         #   POINT3D_ID, X, Y, Z, R, G, B, ERROR (-1: unknown), without TRACK[]\n",
    );
    for (junction, p) in document.junctions.iter().enumerate() {
        let id = junction + 1;
        // `{:?}` is the shortest text that reads back as the same number.
        let _ = writeln!(text, "{id} {:?} {:?} {:?} 0 114 178 -1", p.x, p.y, p.z);
    }
    text
}

fn lines(document: &WireframeDocument) -> String {
    let mut text = String::from(
        "# The edges of a wireframe, a line each:\n\
         #   LINE3D_ID, POINT3D_ID, POINT3D_ID\n",
    );
    for (edge, [a, b]) in document.edges.iter().enumerate() {
        let _ = writeln!(text, "{} {} {}", edge + 1, a + 1, b + 1);
    }
    text
}
