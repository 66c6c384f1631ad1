//! Logs of the training with one line of JSON per step: `metrics.jsonl` and
//! `junctions.jsonl`.

use neat_core::{SceneError, file};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// Where the global junctions were after a step: a line of `junctions.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JunctionsLine {
    /// The step, counted from 1.
    pub iteration: u64,
    /// Positions in the frame of the user's files.
    pub junctions: Vec<[f32; 3]>,
}

/// A log of records with a key `iteration`, open at its end.
#[derive(Debug)]
pub struct StepLog<T> {
    path: PathBuf,
    file: File,
    records: PhantomData<fn(&T)>,
}

impl<T: Serialize> StepLog<T> {
    /// Opens a log for the steps after `iteration`; lines of later steps, which a
    /// run that continues from a checkpoint takes again, go.
    ///
    /// # Errors
    /// If the file cannot be read or written.
    pub fn open(path: &Path, iteration: u64) -> Result<Self, SceneError> {
        let kept: String = read_text(path)?
            .split_inclusive('\n')
            .filter(|line| iteration_of(line).is_some_and(|i| i <= iteration))
            .collect();
        file::write_atomically(path, kept.as_bytes())?;
        let file = OpenOptions::new()
            .append(true)
            .open(path)
            .map_err(|error| write_error(path, error))?;
        Ok(Self {
            path: path.into(),
            file,
            records: PhantomData,
        })
    }

    /// Appends one line.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn append(&mut self, record: &T) -> Result<(), SceneError> {
        let line = serde_json::to_vec(record);
        let mut line = line.map_err(|error| write_error(&self.path, error.into()))?;
        line.push(b'\n');
        self.file
            .write_all(&line)
            .map_err(|error| write_error(&self.path, error))
    }

    /// Brings the lines to the disk.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn sync(&self) -> Result<(), SceneError> {
        let synced = self.file.sync_data();
        synced.map_err(|error| write_error(&self.path, error))
    }
}

/// The records of a log; lines that an interrupt cut off are passed over, and a
/// missing file has none.
///
/// # Errors
/// If the file cannot be read.
pub fn read_log<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, SceneError> {
    let text = read_text(path)?;
    Ok(text
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .collect())
}

fn read_text(path: &Path) -> Result<String, SceneError> {
    match fs::read(path) {
        // A damaged line is passed over; it must not cost the others.
        Ok(bytes) => Ok(String::from_utf8_lossy(&bytes).into_owned()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(String::new()),
        Err(source) => Err(SceneError::Read {
            path: path.into(),
            source,
        }),
    }
}

fn write_error(path: &Path, source: io::Error) -> SceneError {
    SceneError::Write {
        path: path.into(),
        source,
    }
}

/// The step that a line is about; `None` for a line that an interrupt cut off.
fn iteration_of(line: &str) -> Option<u64> {
    #[derive(Deserialize)]
    struct Line {
        iteration: u64,
    }
    serde_json::from_str::<Line>(line)
        .ok()
        .filter(|_| line.ends_with('\n'))
        .map(|line| line.iteration)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_continues_after_the_checkpoint() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("junctions.jsonl");
        assert_eq!(read_log::<JunctionsLine>(&path).unwrap(), []);
        let line = |iteration| JunctionsLine {
            iteration,
            junctions: vec![[0.5, -1.0, 2.0]],
        };
        let mut log = StepLog::open(&path, 0).unwrap();
        for iteration in 1..=3 {
            log.append(&line(iteration)).unwrap();
        }
        let mut text = fs::read_to_string(&path).unwrap();
        text.push_str("{\"itera");
        fs::write(&path, text).unwrap();
        let read: Vec<JunctionsLine> = read_log(&path).unwrap();
        assert_eq!(read, [line(1), line(2), line(3)]);
        StepLog::<JunctionsLine>::open(&path, 2).unwrap();
        let read: Vec<JunctionsLine> = read_log(&path).unwrap();
        assert_eq!(read, [line(1), line(2)]);
    }
}
