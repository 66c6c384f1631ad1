//! Why a batch cannot be done as asked for.

use crate::shard::ShardError;
use neat_core::SceneError;
use std::path::PathBuf;

/// Why a batch cannot be done as asked for. What goes wrong within one job is in
/// its [`JobRecord`](crate::JobRecord) instead.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BatchError {
    /// A manifest that breaks the rules of TOML or of manifests.
    #[error("{path}, line {line}: {reason}")]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong there, and the remedy.
        reason: String,
    },
    /// Nothing to do.
    #[error("{source_name} names no scene: {remedy}")]
    NoJob {
        /// The manifest or the patterns.
        source_name: String,
        /// How to name some.
        remedy: &'static str,
    },
    /// A pattern for folders that follows no grammar.
    #[error("the pattern `{pattern}` cannot be understood: {reason}")]
    Pattern {
        /// The pattern.
        pattern: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A name that cannot be a folder.
    #[error("a job cannot be named `{name}`: {reason}; give it another `name` in a manifest")]
    Name {
        /// The name.
        name: String,
        /// Why not.
        reason: &'static str,
    },
    /// Two jobs of one name; systems that ignore case would mix them as well.
    #[error(
        "the scenes {first} and {second} would both be the job `{name}`: give each a `name` of its own in a manifest"
    )]
    SameName {
        /// The name.
        name: String,
        /// The first scene.
        first: PathBuf,
        /// The second scene.
        second: PathBuf,
    },
    /// An argument that the batch gives itself.
    #[error("job `{job}`: `{argument}` cannot be given, {reason}")]
    ReservedArgument {
        /// The job.
        job: String,
        /// The argument.
        argument: String,
        /// What it would be in the way of.
        reason: &'static str,
    },
    /// A file system without locks.
    #[error(
        "{path} cannot be locked: choose a folder on a file system with locks (Lustre needs the mount option `flock`)"
    )]
    NoLock {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A shard that does not exist.
    #[error(transparent)]
    Shard(#[from] ShardError),
    /// A file that could not be read or written.
    #[error(transparent)]
    File(#[from] SceneError),
}

impl BatchError {
    /// Whether the cause lies in what was asked for or in the input; otherwise the
    /// batch itself failed.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::File(error) if !error.is_bad_input())
    }
}
