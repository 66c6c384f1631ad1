//! Files of JSON, and absolute paths, with errors that name them.

use neat_core::{SceneError, file};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The path from the root: children of the batch may run elsewhere.
pub fn absolute(path: &Path) -> Result<PathBuf, SceneError> {
    std::path::absolute(path).map_err(|source| SceneError::Read {
        path: path.into(),
        source,
    })
}

/// Understands the bytes of the file at `path`.
pub fn parse<'a, T: Deserialize<'a>>(
    bytes: &'a [u8],
    path: &Path,
    format: &'static str,
) -> Result<T, SceneError> {
    serde_json::from_slice(bytes).map_err(|source| malformed(path, format, source))
}

/// Writes a file, completely or not at all.
pub fn write(path: &Path, format: &'static str, value: &impl Serialize) -> Result<(), SceneError> {
    let text = serde_json::to_vec_pretty(value);
    let mut text = text.map_err(|source| malformed(path, format, source))?;
    text.push(b'\n');
    file::write_atomically(path, &text)
}

fn malformed(path: &Path, format: &'static str, source: serde_json::Error) -> SceneError {
    SceneError::Json {
        path: path.into(),
        format,
        source,
    }
}
