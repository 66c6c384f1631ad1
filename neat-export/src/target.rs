//! What a format is given to write.

use crate::orthographic::{Drawing, Frame};
use crate::{ExportError, ExportOptions};
use neat_core::file;
use neat_wireframe::export::WireframeDocument;
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
    /// Number of arcs in the files; no filter leaves them out.
    pub arcs: usize,
    /// Number of splines in the files, likewise.
    pub splines: usize,
    /// What the format has no words for and the files therefore lack, and what no filter could
    /// judge, one sentence each.
    pub remarks: Vec<String>,
}

/// A valid document, and where and how to write it.
pub(crate) struct Target<'a> {
    /// Name of the format, for messages.
    pub format: &'static str,
    /// The file, or the folder.
    pub path: &'a Path,
    /// What passed the filter.
    pub document: &'a WireframeDocument,
    /// All options, in their ranges.
    pub options: &'a ExportOptions,
    /// Names `path`, unless the format says otherwise.
    pub written: Written,
}

impl Target<'_> {
    /// Writes the file, which is replaced when the new one is complete.
    pub fn write(&self, bytes: impl AsRef<[u8]>) -> Result<(), ExportError> {
        Ok(file::write_atomically(self.path, bytes.as_ref())?)
    }

    /// The name of the scene, as a title.
    pub fn title(&self) -> &str {
        let scene = self.document.metadata.get("scene");
        scene.and_then(|name| name.as_str()).unwrap_or("wireframe")
    }

    /// The orthographic view that was asked for.
    ///
    /// # Errors
    /// If no picture can hold the extent of the wireframe.
    pub fn drawing(&self, frame: Frame) -> Result<Drawing, ExportError> {
        let options = self.options;
        Drawing::new(
            &self.document.drawn().junctions,
            frame,
            options.direction,
            options.width,
        )
        .ok_or_else(|| self.out_of_range())
    }

    /// Says, if there are some, that so many things are not in the files.
    pub fn leave_out(&mut self, count: usize, sentence: &str) {
        if count > 0 {
            (self.written.remarks).push(format!("{sentence}: {count} left out"));
        }
    }

    /// Says what the format has instead of arcs and splines.
    pub fn leave_out_curves(&mut self, what: &str) {
        self.leave_out(self.document.arcs.len(), &format!("{what} and no arcs"));
        self.leave_out(
            self.document.splines.len(),
            &format!("{what} and no splines"),
        );
        (self.written.arcs, self.written.splines) = (0, 0);
    }

    /// That the format has no numbers for the extent of the wireframe.
    pub fn out_of_range(&self) -> ExportError {
        ExportError::OutOfRange {
            path: self.path.into(),
            format: self.format,
        }
    }
}
