//! The checkpoints of a run: the last ones stay, and a damaged one gives way to the one before.

use super::error::{ignore_missing, read_error, write_error};
use super::{CHECKPOINTS, RunDir, RunDirError};
use neat_core::SceneError;
use neat_tensor::checkpoint::{Checkpoint, CheckpointError};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The last checkpoint that can be read.
#[derive(Debug)]
pub struct UsableCheckpoint {
    /// Its file.
    pub path: PathBuf,
    /// What is in it.
    pub checkpoint: Checkpoint,
    /// Later ones, which cannot be read, with what is wrong with them.
    pub damaged: Vec<(PathBuf, CheckpointError)>,
}

impl RunDir {
    /// Writes the checkpoint of a step and removes all but the last `kept`. None stays for
    /// its loss: what a run weighs changes with its steps, and losses of different steps do
    /// not compare.
    ///
    /// # Errors
    /// If the disk is full or the folder cannot be written; earlier checkpoints
    /// are then untouched.
    pub fn write_checkpoint(
        &self,
        iteration: u64,
        checkpoint: &Checkpoint,
        kept: usize,
    ) -> Result<PathBuf, RunDirError> {
        let dir = self.root.join(CHECKPOINTS);
        match fs::create_dir(&dir) {
            // Not those above it: a run folder that is lost in between is an error.
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
                return Err(write_error(&dir, error).into());
            }
            _ => {}
        }
        let path = dir.join(format!("step-{iteration:08}.safetensors"));
        checkpoint.write(&path)?;
        let mut old = self.checkpoints()?;
        old.truncate(old.len().saturating_sub(kept.max(1)));
        for (_, path) in old {
            ignore_missing(fs::remove_file(&path), &path)?;
        }
        Ok(path)
    }

    /// Reads the last checkpoint that is not damaged; `None` if there is no
    /// checkpoint.
    ///
    /// # Errors
    /// If all are damaged, or the folder cannot be read.
    pub fn usable_checkpoint(&self) -> Result<Option<UsableCheckpoint>, RunDirError> {
        let mut damaged = Vec::new();
        for (_, path) in self.checkpoints()?.into_iter().rev() {
            match Checkpoint::read(&path) {
                Ok(checkpoint) => {
                    return Ok(Some(UsableCheckpoint {
                        path,
                        checkpoint,
                        damaged,
                    }));
                }
                Err(error) => damaged.push((path, error)),
            }
        }
        match damaged.into_iter().next() {
            None => Ok(None),
            Some((_, source)) => Err(RunDirError::NoUsableCheckpoint {
                path: self.root.clone(),
                source: Box::new(source),
            }),
        }
    }

    /// Renames a checkpoint, so that it is one no more.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn set_aside(&self, checkpoint: &Path) -> Result<(), RunDirError> {
        let mut aside = checkpoint.as_os_str().to_owned();
        aside.push(".damaged");
        let renamed = fs::rename(checkpoint, &aside);
        Ok(renamed.map_err(|error| write_error(checkpoint, error))?)
    }

    /// The last checkpoint's file.
    ///
    /// # Errors
    /// If there is none, or the folder cannot be read.
    pub fn latest_checkpoint(&self) -> Result<PathBuf, RunDirError> {
        self.checkpoints()?
            .pop()
            .map(|(_, path)| path)
            .ok_or_else(|| RunDirError::NoField(self.root.clone()))
    }

    /// All checkpoints with their steps, in the order of these.
    pub(super) fn checkpoints(&self) -> Result<Vec<(u64, PathBuf)>, SceneError> {
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

/// The step in the name of a checkpoint.
fn checkpoint_iteration(path: &Path) -> Option<u64> {
    let name = path.file_name()?.to_str()?;
    let digits = name.strip_prefix("step-")?.strip_suffix(".safetensors")?;
    digits.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_dir::Existing;

    #[test]
    fn the_last_checkpoints_stay_whatever_their_losses_are() {
        let dir = tempfile::tempdir().unwrap();
        let (run, _lock) = RunDir::create(dir.path(), Existing::Refuse).unwrap();
        assert!(matches!(
            run.latest_checkpoint(),
            Err(RunDirError::NoField(_))
        ));
        assert!(run.usable_checkpoint().unwrap().is_none());
        let losses = [(5, 3.0), (50, 0.5), (500, 2.0), (100_000_000, 1.0)];
        for (iteration, loss) in losses {
            let mut checkpoint = Checkpoint::default();
            let metadata = &mut checkpoint.metadata;
            metadata.insert("average_loss".to_owned(), loss.to_string());
            let path = run.write_checkpoint(iteration, &checkpoint, 2).unwrap();
            assert_eq!(run.latest_checkpoint().unwrap(), path);
        }
        let kept: Vec<u64> = run.checkpoints().unwrap().iter().map(|c| c.0).collect();
        assert_eq!(kept, [500, 100_000_000]);
    }

    #[test]
    fn a_damaged_checkpoint_gives_way_to_the_one_before() {
        let dir = tempfile::tempdir().unwrap();
        let (run, _lock) = RunDir::create(dir.path(), Existing::Refuse).unwrap();
        let [first, second] =
            [1, 2].map(|i| run.write_checkpoint(i, &Checkpoint::default(), 2).unwrap());
        fs::write(&second, "half").unwrap();
        let usable = run.usable_checkpoint().unwrap().unwrap();
        assert_eq!(usable.path, first);
        assert_eq!(usable.damaged[0].0, second);
        run.set_aside(&second).unwrap();
        assert_eq!(run.latest_checkpoint().unwrap(), first);

        fs::write(&first, "").unwrap();
        assert!(matches!(
            run.usable_checkpoint(),
            Err(RunDirError::NoUsableCheckpoint { .. })
        ));
    }
}
