//! The folder that a run leaves behind.
//!
//! ```text
//! config.toml         what was asked for
//! plan.toml           what was settled: the same with every choice made
//! manifest.json       what ran, where, on which inputs, and how long
//! metrics.jsonl       one line of losses every few steps
//! junctions.jsonl     where the global junctions were, fifty times over the training
//! checkpoints/        the last ones, step-NNNNNNNN.safetensors
//! wireframe.json      junctions and edges, in the frame of the user's files
//! wireframe.obj, .ply the same for other programs
//! wireframe.png       a picture of it
//! report.html         all of it to look at, with the evidence for every edge
//! overlays/           the wireframe drawn on some of the photographs
//! detections/         2D wireframes, where the scene came without
//! failure/            a run that shows a numerical failure again, after one
//! .lock               held while a process works in the folder
//! ```
//!
//! `neat render` and `neat export` add `renders/` and `mesh.ply` if they are asked to.
//! Every file is complete or not there; the logs (`.jsonl`) only grow, but for the
//! steps that a resumed run takes again. The folder holds a run once `manifest.json`
//! is there.

mod checkpoints;
mod error;

pub use checkpoints::UsableCheckpoint;
pub use error::RunDirError;
pub(crate) use error::{malformed, read_error, write_error};

use crate::config::Config;
use crate::manifest::Manifest;
use crate::plan::{Plan, PlanError};
use error::ignore_missing;
use neat_core::{SceneError, file};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

const CONFIG: &str = "config.toml";
const PLAN: &str = "plan.toml";
const MANIFEST: &str = "manifest.json";
const METRICS: &str = "metrics.jsonl";
const JUNCTIONS: &str = "junctions.jsonl";
const REPORT: &str = "report.html";
const CHECKPOINTS: &str = "checkpoints";
const OVERLAYS: &str = "overlays";
const DETECTIONS: &str = "detections";
const RENDERS: &str = "renders";
const FAILURE: &str = "failure";
const LOCK: &str = ".lock";
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
    /// Continue the run in it from its last checkpoint; begin one where none is.
    Resume,
}

/// The folder of one run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunDir {
    root: PathBuf,
}

/// As long as it lives, no other process works in the folder.
#[derive(Debug)]
pub struct RunLock {
    _file: File,
}

impl RunDir {
    /// Checks, without changing anything, that a run may use `root`.
    ///
    /// # Errors
    /// If it is no folder, is not empty although `existing` is
    /// [`Existing::Refuse`], or holds something but no run although it is
    /// [`Existing::Resume`].
    pub fn check(root: &Path, existing: Existing) -> Result<(), RunDirError> {
        if existing == Existing::Resume {
            return Self::to_resume(root).map(|_| ());
        }
        let not_empty = !entries(root)?.is_empty();
        if existing == Existing::Refuse && not_empty {
            return Err(RunDirError::NotEmpty(root.into()));
        }
        Ok(())
    }

    /// The run in `root` that can be continued; `None` where a run can only begin: in
    /// no folder, an empty one, or one with nothing but what a run leaves that was
    /// killed before its beginning was on disk.
    ///
    /// # Errors
    /// If there is something else in the folder, or a part of the run is missing.
    pub fn to_resume(root: &Path) -> Result<Option<Self>, RunDirError> {
        let dir = Self { root: root.into() };
        // First of all: it must be a folder, if it is there.
        let present = entries(root)?;
        let files = [CONFIG, MANIFEST];
        let missing: Vec<_> = (files.into_iter())
            .filter(|name| !root.join(name).is_file())
            .collect();
        let Some(&missing) = missing.first() else {
            return Ok(Some(dir));
        };
        if !dir.checkpoints()?.is_empty() {
            let path = root.into();
            return Err(RunDirError::Incomplete { path, missing });
        }
        let beginning = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default();
            [CONFIG, PLAN, CHECKPOINTS, DETECTIONS, LOCK]
                .iter()
                .any(|known| name == *known)
                || file::is_temporary(path)
        };
        match present.iter().all(beginning) {
            true => Ok(None),
            false => Err(RunDirError::NotARun(root.into())),
        }
    }

    /// Makes `root` ready for a run and keeps other processes out of it: creates it
    /// where needed, removes the files of an earlier run for
    /// [`Existing::Overwrite`], and what killed writers left for
    /// [`Existing::Resume`].
    ///
    /// # Errors
    /// As [`Self::check`], or if the folder cannot be written or is in use.
    pub fn create(root: &Path, existing: Existing) -> Result<(Self, RunLock), RunDirError> {
        Self::check(root, existing)?;
        let dir = Self { root: root.into() };
        let unwritable = |source| RunDirError::Unwritable {
            path: root.into(),
            source,
        };
        file::create_dir(root).map_err(unwritable)?;
        let lock = dir.lock()?;
        match existing {
            Existing::Overwrite => dir.remove_earlier_run(),
            Existing::Resume => dir.remove_temporaries(),
            Existing::Refuse => Ok(()),
        }
        .map_err(unwritable)?;
        Ok((dir, lock))
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

    /// Keeps other processes from working in the folder until the lock is dropped; a
    /// process that ends in any way drops it.
    ///
    /// # Errors
    /// If another process has it, or the folder cannot be written.
    pub fn lock(&self) -> Result<RunLock, RunDirError> {
        let path = self.root.join(LOCK);
        let file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(|source| RunDirError::Unwritable {
                path: self.root.clone(),
                source: write_error(&path, source),
            })?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(RunDirError::InUse(self.root.clone())),
            // A file system without locks: as before there were any.
            Err(TryLockError::Error(_)) => {}
        }
        Ok(RunLock { _file: file })
    }

    fn remove_temporaries(&self) -> Result<(), SceneError> {
        let folders = [CHECKPOINTS, OVERLAYS, DETECTIONS, RENDERS].map(|name| self.root.join(name));
        for dir in folders.iter().filter(|dir| dir.is_dir()) {
            file::remove_temporaries(dir)?;
        }
        file::remove_temporaries(&self.root)
    }

    fn remove_earlier_run(&self) -> Result<(), SceneError> {
        let files = [CONFIG, PLAN, MANIFEST, METRICS, JUNCTIONS, REPORT, MESH]
            .iter()
            .chain(&RESULT_FILES);
        for name in files {
            ignore_missing(fs::remove_file(self.root.join(name)), &self.root.join(name))?;
        }
        for name in [CHECKPOINTS, OVERLAYS, DETECTIONS, RENDERS, FAILURE] {
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
        let path = self.root.join(CONFIG);
        Ok(file::write_atomically(&path, text.as_bytes())?)
    }

    /// Reads `config.toml`.
    ///
    /// # Errors
    /// If it is missing or not a configuration of this version.
    pub fn config(&self) -> Result<Config, RunDirError> {
        let path = self.root.join(CONFIG);
        parse_config(&path)
    }

    /// Writes `plan.toml`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_plan(&self, plan: &Plan) -> Result<(), RunDirError> {
        let text = toml::to_string_pretty(plan.config())?;
        let path = self.root.join(PLAN);
        Ok(file::write_atomically(&path, text.as_bytes())?)
    }

    /// Reads `plan.toml`; where there is none, `config.toml`, if that leaves nothing open.
    ///
    /// # Errors
    /// If the file is missing where it is needed, or not a plan of this version.
    pub fn plan(&self) -> Result<Plan, RunDirError> {
        let mut path = self.root.join(PLAN);
        if !path.is_file() {
            path = self.root.join(CONFIG);
        }
        Plan::new(parse_config(&path)?).map_err(|error| match error {
            PlanError::Open(_) => RunDirError::Incomplete {
                path: self.root.clone(),
                missing: PLAN,
            },
            error => malformed(&path, &error),
        })
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

    /// `metrics.jsonl`: losses and the like, see [`neat_train::step_log`].
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

    /// The folder of a run that shows a numerical failure of this one again.
    pub fn failure(&self) -> PathBuf {
        self.root.join(FAILURE)
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

/// What is in a folder; nothing where there is none.
fn entries(root: &Path) -> Result<Vec<PathBuf>, RunDirError> {
    let entries = match fs::read_dir(root) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
            return Err(RunDirError::NotAFolder(root.into()));
        }
        Err(error) => return Err(read_error(root, error).into()),
    };
    let path = |entry: io::Result<fs::DirEntry>| entry.map(|entry| entry.path());
    let paths: io::Result<_> = entries.map(path).collect();
    paths.map_err(|error| read_error(root, error).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_tensor::checkpoint::Checkpoint;

    #[test]
    fn a_folder_with_something_in_it_is_refused_unless_told_otherwise() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().join("run");
        RunDir::check(&root, Existing::Refuse).unwrap();
        assert!(!root.exists(), "checking creates nothing");
        drop(RunDir::create(&root, Existing::Refuse).unwrap());

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
        let ours = [CONFIG, PLAN, MANIFEST, METRICS, JUNCTIONS, REPORT, MESH];
        for name in ours.iter().chain(&RESULT_FILES) {
            fs::write(root.join(name), "old").unwrap();
        }
        fs::create_dir(root.join(RENDERS)).unwrap();
        drop(RunDir::create(&root, Existing::Overwrite).unwrap());
        let entries = fs::read_dir(&root).unwrap();
        let mut left: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, [LOCK, "notes.txt"]);
        assert_eq!(fs::read(root.join("notes.txt")).unwrap(), b"mine");

        assert!(matches!(
            RunDir::create(&root.join("notes.txt"), Existing::Overwrite),
            Err(RunDirError::NotAFolder(_))
        ));
    }

    #[test]
    fn a_folder_is_continued_begun_or_refused() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().join("run");
        assert_eq!(RunDir::to_resume(&root).unwrap(), None);
        // What a run leaves that was killed at its very beginning.
        drop(RunDir::create(&root, Existing::Resume).unwrap());
        fs::write(root.join(CONFIG), "").unwrap();
        fs::write(root.join(".manifest.json.12.0.tmp"), "{").unwrap();
        assert_eq!(RunDir::to_resume(&root).unwrap(), None);
        let (run, lock) = RunDir::create(&root, Existing::Resume).unwrap();
        assert!(!root.join(".manifest.json.12.0.tmp").exists());
        assert!(matches!(
            RunDir::create(&root, Existing::Resume),
            Err(RunDirError::InUse(_))
        ));
        drop(lock);

        run.write_checkpoint(1, &Checkpoint::default(), 2).unwrap();
        assert!(matches!(
            RunDir::to_resume(&root),
            Err(RunDirError::Incomplete {
                missing: MANIFEST,
                ..
            })
        ));
        fs::write(root.join(MANIFEST), "{}").unwrap();
        assert_eq!(RunDir::to_resume(&root).unwrap(), Some(run));

        let other = dir.path().join("other");
        fs::create_dir(&other).unwrap();
        fs::write(other.join("letter.txt"), "").unwrap();
        assert!(matches!(
            RunDir::to_resume(&other),
            Err(RunDirError::NotARun(_))
        ));
    }
}
