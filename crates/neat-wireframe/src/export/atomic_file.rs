//! Files that are either complete or not there.

use super::ExportError;
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

/// Writes `bytes` to a temporary file beside `path`, flushes it to the disk and
/// renames it to `path`, replacing what was there.
///
/// # Errors
/// If the folder does not exist or cannot be written, or the disk is full. An
/// existing file is then unchanged and the temporary one is gone.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    let failed = |action| {
        move |source| ExportError::Io {
            path: path.into(),
            action,
            source,
        }
    };
    let Some(name) = path.file_name() else {
        return Err(failed("be written: it is not the name of a file")(
            std::io::ErrorKind::InvalidInput.into(),
        ));
    };
    // The process id keeps two runs that write the same file apart.
    let mut temporary_name = std::ffi::OsString::from(".");
    temporary_name.push(name);
    temporary_name.push(format!(".{}.tmp", std::process::id()));
    let temporary = path.with_file_name(temporary_name);

    let written = File::create(&temporary)
        .and_then(|mut file| {
            file.write_all(bytes)?;
            file.sync_all()
        })
        .map_err(failed("write"))
        .and_then(|()| fs::rename(&temporary, path).map_err(failed("replace")));
    if written.is_err() {
        // Nothing to report if even this fails: the first error says more.
        let _ = fs::remove_file(&temporary);
    }
    written
}
