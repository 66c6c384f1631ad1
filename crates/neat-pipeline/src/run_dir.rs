//! The folder that a run leaves behind.
//!
//! ```text
//! config.toml         every choice of the run
//! manifest.json       what ran, where, on which inputs, and how long
//! metrics.jsonl       one line of losses every few steps
//! junctions.jsonl     where the global junctions were, fifty times over the training
//! checkpoints/        the last two, step-NNNNNNNN.safetensors
//! wireframe.json      junctions and edges, in the frame of the user's files
//! wireframe.obj, .ply the same for other programs
//! wireframe.png       a picture of it
//! report.html         all of it to look at, with the evidence for every edge
//! overlays/           the wireframe drawn on some of the photographs
//! detections/         2D wireframes, where the scene came without
//! ```
//!
//! `neat render` and `neat export` add `renders/` and `mesh.ply` if they are asked to.
//! Every file is complete or not there; the logs (`.jsonl`) only grow, but for the
//! steps that a resumed run takes again.

use crate::config::Config;
use crate::manifest::Manifest;
use neat_core::{SceneError, file};
use neat_tensor::checkpoint::{Checkpoint, CheckpointError};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// So many checkpoints stay on disk: one to continue from, and one more in case
/// that one turns out to be damaged.
const KEPT_CHECKPOINTS: usize = 2;

const CONFIG: &str = "config.toml";
const MANIFEST: &str = "manifest.json";
const METRICS: &str = "metrics.jsonl";
const JUNCTIONS: &str = "junctions.jsonl";
const REPORT: &str = "report.html";
const CHECKPOINTS: &str = "checkpoints";
const OVERLAYS: &str = "overlays";
const DETECTIONS: &str = "detections";
const RENDERS: &str = "renders";
const MESH: &str = "mesh.ply";
const RESULT_FILES: [&str; 4] = [
    "wireframe.json",
    "wireframe.obj",
    "wireframe.ply",
    "wireframe.png",
];

/// What to do about a folder that already holds something.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Existing {
    /// Refuse to use it.
    #[default]
    Refuse,
    /// Remove the files of an earlier run and start anew; other files stay.
    Overwrite,
    /// Continue from the last checkpoint in it.
    Resume,
}

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
    /// A run that ended before its first checkpoint.
    #[error("{0} has no checkpoint: train again with --overwrite")]
    NoCheckpoint(PathBuf),
    /// `config.toml` or `manifest.json` does not parse.
    #[error("{path} cannot be understood: {reason}; correct it or train again with --overwrite")]
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

/// The folder of one run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunDir {
    root: PathBuf,
}

impl RunDir {
    /// Checks, without changing anything, that a run may use `root`.
    ///
    /// # Errors
    /// If it is no folder, is not empty although `existing` is
    /// [`Existing::Refuse`], or holds no run although it is [`Existing::Resume`].
    pub fn check(root: &Path, existing: Existing) -> Result<(), RunDirError> {
        if existing == Existing::Resume {
            return Self::open(root).map(|_| ());
        }
        let mut entries = match fs::read_dir(root) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
                return Err(RunDirError::NotAFolder(root.into()));
            }
            Err(error) => return Err(read_error(root, error).into()),
        };
        if existing == Existing::Refuse && entries.next().is_some() {
            return Err(RunDirError::NotEmpty(root.into()));
        }
        Ok(())
    }

    /// Makes `root` ready for a run: creates it where needed and, for
    /// [`Existing::Overwrite`], removes the files of an earlier run.
    ///
    /// # Errors
    /// As [`Self::check`], or if the folder cannot be written.
    pub fn create(root: &Path, existing: Existing) -> Result<Self, RunDirError> {
        Self::check(root, existing)?;
        let dir = Self { root: root.into() };
        let cleared = match existing {
            Existing::Overwrite => dir.remove_earlier_run(),
            Existing::Refuse | Existing::Resume => Ok(()),
        };
        cleared
            .and_then(|()| file::create_dir(&root.join(CHECKPOINTS)))
            .map_err(|source| RunDirError::Unwritable {
                path: root.into(),
                source,
            })?;
        Ok(dir)
    }

    /// The folder of a run that has been.
    ///
    /// # Errors
    /// If there is no `config.toml` in it.
    pub fn open(root: &Path) -> Result<Self, RunDirError> {
        if !root.join(CONFIG).is_file() {
            return Err(RunDirError::NotARun(root.into()));
        }
        Ok(Self { root: root.into() })
    }

    fn remove_earlier_run(&self) -> Result<(), SceneError> {
        let files = [CONFIG, MANIFEST, METRICS, JUNCTIONS, REPORT, MESH]
            .iter()
            .chain(&RESULT_FILES);
        for name in files {
            ignore_missing(fs::remove_file(self.root.join(name)), &self.root.join(name))?;
        }
        for name in [CHECKPOINTS, OVERLAYS, DETECTIONS, RENDERS] {
            let path = self.root.join(name);
            ignore_missing(fs::remove_dir_all(&path), &path)?;
        }
        Ok(())
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// `wireframe.json`, `wireframe.obj` or `wireframe.ply`, by `extension`.
    pub fn wireframe(&self, extension: &str) -> PathBuf {
        self.root.join("wireframe").with_extension(extension)
    }

    /// The picture of the wireframe on the photograph of `view`.
    pub fn overlay(&self, view: &str) -> PathBuf {
        self.root.join(OVERLAYS).join(format!("{view}.png"))
    }

    /// The folder of 2D wireframes that were detected, for want of files.
    pub fn detections(&self) -> PathBuf {
        self.root.join(DETECTIONS)
    }

    /// The 2D wireframe that was detected in `view`.
    pub fn detection(&self, view: &str) -> PathBuf {
        self.detections().join(format!("{view}.json"))
    }

    /// Writes `config.toml`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_config(&self, config: &Config) -> Result<(), RunDirError> {
        let text = toml::to_string_pretty(config)?;
        Ok(file::write_atomically(
            &self.root.join(CONFIG),
            text.as_bytes(),
        )?)
    }

    /// Reads `config.toml`.
    ///
    /// # Errors
    /// If it is missing or not a configuration of this version.
    pub fn config(&self) -> Result<Config, RunDirError> {
        let path = self.root.join(CONFIG);
        parse_config(&path)
    }

    /// Writes `manifest.json`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_manifest(&self, manifest: &Manifest) -> Result<(), RunDirError> {
        let path = self.root.join(MANIFEST);
        let mut text =
            serde_json::to_vec_pretty(manifest).map_err(|error| malformed(&path, &error))?;
        text.push(b'\n');
        Ok(file::write_atomically(&path, &text)?)
    }

    /// Reads `manifest.json`.
    ///
    /// # Errors
    /// If it is missing or not a manifest of this version.
    pub fn manifest(&self) -> Result<Manifest, RunDirError> {
        let path = self.root.join(MANIFEST);
        let bytes = file::read(&path, "train again")?;
        serde_json::from_slice(&bytes).map_err(|error| malformed(&path, &error))
    }

    /// `metrics.jsonl`: losses and the like, see [`crate::step_log`].
    pub fn metrics(&self) -> PathBuf {
        self.root.join(METRICS)
    }

    /// `junctions.jsonl`: where the global junctions were during training.
    pub fn junctions(&self) -> PathBuf {
        self.root.join(JUNCTIONS)
    }

    /// `report.html`.
    pub fn report(&self) -> PathBuf {
        self.root.join(REPORT)
    }

    /// Removes `report.html`, if there is one.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn remove_report(&self) -> Result<(), RunDirError> {
        let path = self.report();
        Ok(ignore_missing(fs::remove_file(&path), &path)?)
    }

    /// Writes the checkpoint of a step and removes all but the last two.
    ///
    /// # Errors
    /// If the disk is full or the folder cannot be written; earlier checkpoints
    /// are then untouched.
    pub fn write_checkpoint(
        &self,
        iteration: u64,
        checkpoint: &Checkpoint,
    ) -> Result<PathBuf, RunDirError> {
        let path = self
            .root
            .join(CHECKPOINTS)
            .join(format!("step-{iteration:08}.safetensors"));
        checkpoint.write(&path)?;
        let mut checkpoints = self.checkpoints()?;
        checkpoints.truncate(checkpoints.len().saturating_sub(KEPT_CHECKPOINTS));
        for (_, old) in checkpoints {
            ignore_missing(fs::remove_file(&old), &old)?;
        }
        Ok(path)
    }

    /// Reads the last checkpoint.
    ///
    /// # Errors
    /// If there is none, or it is damaged.
    pub fn read_latest_checkpoint(&self) -> Result<Checkpoint, RunDirError> {
        Ok(Checkpoint::read(&self.latest_checkpoint()?)?)
    }

    /// The last checkpoint's file.
    ///
    /// # Errors
    /// If there is none, or the folder cannot be read.
    pub fn latest_checkpoint(&self) -> Result<PathBuf, RunDirError> {
        self.checkpoints()?
            .pop()
            .map(|(_, path)| path)
            .ok_or_else(|| RunDirError::NoCheckpoint(self.root.clone()))
    }

    /// All checkpoints with their steps, in the order of these.
    fn checkpoints(&self) -> Result<Vec<(u64, PathBuf)>, SceneError> {
        let dir = self.root.join(CHECKPOINTS);
        let entries = match fs::read_dir(&dir) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(read_error(&dir, error)),
        };
        let mut checkpoints = Vec::new();
        for entry in entries {
            let path = entry.map_err(|error| read_error(&dir, error))?.path();
            if let Some(iteration) = checkpoint_iteration(&path) {
                checkpoints.push((iteration, path));
            }
        }
        checkpoints.sort();
        Ok(checkpoints)
    }
}

/// Reads a configuration file.
///
/// # Errors
/// If it is missing, has unknown keys, lacks some, or has values of the wrong
/// kind; the message has line and column.
pub fn parse_config(path: &Path) -> Result<Config, RunDirError> {
    let bytes = file::read(
        path,
        "give a configuration such as the config.toml of a run",
    )?;
    let text = String::from_utf8(bytes).map_err(|error| malformed(path, &error))?;
    toml::from_str(&text).map_err(|error| malformed(path, &error))
}

/// The step in the name of a checkpoint.
fn checkpoint_iteration(path: &Path) -> Option<u64> {
    let name = path.file_name()?.to_str()?;
    let digits = name.strip_prefix("step-")?.strip_suffix(".safetensors")?;
    digits.parse().ok()
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

fn ignore_missing(result: io::Result<()>, path: &Path) -> Result<(), SceneError> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(write_error(path, error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_with_something_in_it_is_refused_unless_told_otherwise() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().join("run");
        RunDir::check(&root, Existing::Refuse).unwrap();
        assert!(!root.exists(), "checking creates nothing");
        RunDir::create(&root, Existing::Refuse).unwrap();

        fs::write(root.join("wireframe.obj"), "v").unwrap();
        fs::write(root.join("notes.txt"), "mine").unwrap();
        assert!(matches!(
            RunDir::create(&root, Existing::Refuse),
            Err(RunDirError::NotEmpty(_))
        ));
        assert!(matches!(
            RunDir::create(&root, Existing::Resume),
            Err(RunDirError::NotARun(_))
        ));
        let ours = [CONFIG, MANIFEST, METRICS, JUNCTIONS, REPORT, MESH];
        for name in ours.iter().chain(&RESULT_FILES) {
            fs::write(root.join(name), "old").unwrap();
        }
        fs::create_dir(root.join(RENDERS)).unwrap();
        RunDir::create(&root, Existing::Overwrite).unwrap();
        let entries = fs::read_dir(&root).unwrap();
        let mut left: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, [CHECKPOINTS, "notes.txt"]);
        assert_eq!(fs::read(root.join("notes.txt")).unwrap(), b"mine");

        assert!(matches!(
            RunDir::create(&root.join("notes.txt"), Existing::Overwrite),
            Err(RunDirError::NotAFolder(_))
        ));
    }

    #[test]
    fn the_last_two_checkpoints_stay() {
        let dir = tempfile::tempdir().unwrap();
        let run = RunDir::create(dir.path(), Existing::Refuse).unwrap();
        assert!(matches!(
            run.latest_checkpoint(),
            Err(RunDirError::NoCheckpoint(_))
        ));
        for iteration in [5, 50, 100_000_000, 200_000_000] {
            let path = run
                .write_checkpoint(iteration, &Checkpoint::default())
                .unwrap();
            assert_eq!(run.latest_checkpoint().unwrap(), path);
        }
        let kept: Vec<u64> = run.checkpoints().unwrap().iter().map(|c| c.0).collect();
        assert_eq!(kept, [100_000_000, 200_000_000]);
    }
}
