//! What can be wrong with the folder of a run.

use neat_core::SceneError;
use neat_tensor::checkpoint::CheckpointError;
use std::io;
use std::path::{Path, PathBuf};

/// Why a run folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RunDirError {
    /// A new run would mix with what is there.
    #[error(
        "{0} is not empty: choose another folder, or pass --overwrite to replace the run in it"
    )]
    NotEmpty(PathBuf),
    /// The path leads to something else.
    #[error("{0} is not a folder: choose another path for the run")]
    NotAFolder(PathBuf),
    /// No run has been here.
    #[error("{0} is not the folder of a run: it has no config.toml")]
    NotARun(PathBuf),
    /// A run that has lost a file that says what it is.
    #[error(
        "{path} has checkpoints but no {missing}: put it back, or begin again with --overwrite"
    )]
    Incomplete {
        /// The folder.
        path: PathBuf,
        /// Name of the file.
        missing: &'static str,
    },
    /// Another process is at work in the folder.
    #[error("another process works on the run in {0}: wait for it, or choose another folder")]
    InUse(PathBuf),
    /// Every checkpoint is damaged.
    #[error(
        "none of the checkpoints in {path} can be read: put one back, or train again with --overwrite"
    )]
    NoUsableCheckpoint {
        /// The folder of the run.
        path: PathBuf,
        /// What is wrong with the last one.
        source: Box<CheckpointError>,
    },
    /// A run without a field, or that ended before its first checkpoint.
    #[error("{0} holds no trained field: reconstruct again with --train and --overwrite")]
    NoField(PathBuf),
    /// `config.toml`, `plan.toml` or `manifest.json` does not parse.
    #[error(
        "{path} cannot be understood: {reason}; if another version of neat wrote it, use that one, else correct it or train again with --overwrite"
    )]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The configuration has no TOML form.
    #[error("the configuration cannot be written as TOML")]
    Serialize(#[from] toml::ser::Error),
    /// The folder cannot hold a run.
    #[error(
        "no run can be written to {path}: check the permissions and the space on the disk, or choose another folder"
    )]
    Unwritable {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: SceneError,
    },
    /// A file or folder could not be read or written.
    #[error(transparent)]
    File(#[from] SceneError),
    /// A checkpoint could not be read or written.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

pub(crate) fn malformed(path: &Path, error: &dyn std::error::Error) -> RunDirError {
    RunDirError::Malformed {
        path: path.into(),
        reason: error.to_string().trim_end().to_owned(),
    }
}

pub(crate) fn read_error(path: &Path, source: io::Error) -> SceneError {
    SceneError::Read {
        path: path.into(),
        source,
    }
}

pub(crate) fn write_error(path: &Path, source: io::Error) -> SceneError {
    SceneError::Write {
        path: path.into(),
        source,
    }
}

pub(super) fn ignore_missing(result: io::Result<()>, path: &Path) -> Result<(), SceneError> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(write_error(path, error)),
        _ => Ok(()),
    }
}
