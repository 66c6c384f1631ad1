//! The folder of a job, and the lock on it.

use crate::error::BatchError;
use crate::job::Job;
use crate::job_record::{JobRecord, JobState};
use crate::json_file;
use crate::log_file::LogFile;
use neat_core::{SceneError, file};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::process::Stdio;

/// What `job.json` is, for messages.
const FORMAT: &str = "record of a job";

/// `OUT/NAME`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobFolder {
    root: PathBuf,
}

/// What there is to do for a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Plan {
    /// Everything.
    Begin,
    /// What is left of it.
    Continue,
    /// Nothing.
    Finished,
    /// It is another job than the one whose run lies there; this is different.
    Changed(String),
}

/// The right to work on a job. It ends when this value and the standard inputs made
/// from it are gone, whatever ends the processes that hold them.
#[derive(Debug)]
pub struct JobLock {
    file: File,
}

impl JobFolder {
    /// The folder of `job` in `out`. Nothing is created.
    pub fn new(out: &Path, job: &Job) -> Self {
        Self {
            root: out.join(&job.name),
        }
    }

    /// The folder of the run.
    pub fn run(&self) -> PathBuf {
        self.root.join("run")
    }

    /// The result, which is there if the job is finished.
    pub fn wireframe(&self) -> PathBuf {
        self.run().join("wireframe.json")
    }

    /// What the program said.
    pub fn log(&self) -> LogFile {
        LogFile::new(self.root.join("log.txt"))
    }

    fn record(&self) -> PathBuf {
        self.root.join("job.json")
    }

    /// Creates the folder and takes its lock; `None` if another process has it.
    ///
    /// # Errors
    /// If the folder cannot be written or its file system has no locks.
    pub fn lock(&self) -> Result<Option<JobLock>, BatchError> {
        file::create_dir(&self.root)?;
        let path = self.root.join("lock");
        let mut open = OpenOptions::new();
        open.read(true).write(true).create(true).truncate(false);
        let file = open.open(&path).map_err(|source| SceneError::Write {
            path: path.clone(),
            source,
        })?;
        match file.try_lock() {
            Ok(()) => Ok(Some(JobLock { file })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(source)) => Err(BatchError::NoLock { path, source }),
        }
    }

    /// Reads `job.json`; `None` if there is none.
    ///
    /// # Errors
    /// If it cannot be read or is no such record.
    pub fn read_record(&self) -> Result<Option<JobRecord>, BatchError> {
        let path = self.record();
        let bytes = match file::read(&path, "") {
            Err(SceneError::Missing { .. }) => return Ok(None),
            bytes => bytes?,
        };
        Ok(Some(json_file::parse(&bytes, &path, FORMAT)?))
    }

    /// Writes `job.json`, completely or not at all.
    ///
    /// # Errors
    /// If the folder cannot be written or the disk is full.
    pub fn write_record(&self, record: &JobRecord) -> Result<(), BatchError> {
        Ok(json_file::write(&self.record(), FORMAT, record)?)
    }

    /// What there is to do, by `record` and what lies in the folder.
    pub fn plan(&self, job: &Job, record: Option<&JobRecord>) -> Plan {
        let Some(record) = record else {
            return Plan::Begin;
        };
        if !self.has_run() {
            return Plan::Begin;
        }
        if let Some(difference) = record.difference(job) {
            return Plan::Changed(difference);
        }
        if record.state == JobState::Finished && self.wireframe().is_file() {
            Plan::Finished
        } else {
            Plan::Continue
        }
    }

    /// Whether a run has begun: its manifest is the first file that it writes.
    fn has_run(&self) -> bool {
        self.run().join("manifest.json").is_file()
    }

    /// Removes the run.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn remove_run(&self) -> Result<(), BatchError> {
        match fs::remove_dir_all(self.run()) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => Err(SceneError::Write {
                path: self.run(),
                source,
            }
            .into()),
            _ => Ok(()),
        }
    }
}

impl JobLock {
    /// A standard input that is empty and keeps the lock: should the batch be
    /// killed, the job stays locked until its program has ended too.
    ///
    /// # Errors
    /// If the process has no file handles left.
    pub fn standard_input(&self) -> io::Result<Stdio> {
        Ok(self.file.try_clone()?.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job() -> Job {
        Job {
            name: "house".into(),
            scene: "/scenes/house".into(),
            arguments: Vec::new(),
            truth: None,
        }
    }

    #[test]
    fn one_lock_per_job_and_none_after_it() {
        let out = tempfile::tempdir().unwrap();
        let folder = JobFolder::new(out.path(), &job());
        let lock = folder.lock().unwrap().unwrap();
        assert!(folder.lock().unwrap().is_none());
        drop(lock);
        assert!(folder.lock().unwrap().is_some());
    }

    #[test]
    fn a_job_is_finished_with_its_result_and_the_same_arguments() {
        let out = tempfile::tempdir().unwrap();
        let job = job();
        let folder = JobFolder::new(out.path(), &job);
        assert_eq!(folder.plan(&job, None), Plan::Begin);
        file::create_dir(&folder.run()).unwrap();
        let mut record = JobRecord::new(&job);
        record.state = JobState::Finished;
        // Something was lost since.
        assert_eq!(folder.plan(&job, Some(&record)), Plan::Begin);
        fs::write(folder.run().join("manifest.json"), "{}").unwrap();
        assert_eq!(folder.plan(&job, Some(&record)), Plan::Continue);
        fs::write(folder.wireframe(), "{}").unwrap();
        assert_eq!(folder.plan(&job, Some(&record)), Plan::Finished);
        let other = Job {
            arguments: vec!["--seed=1".into()],
            ..job.clone()
        };
        assert!(matches!(
            folder.plan(&other, Some(&record)),
            Plan::Changed(_)
        ));
        folder.remove_run().unwrap();
        folder.remove_run().unwrap();
        assert_eq!(folder.plan(&other, Some(&record)), Plan::Begin);
    }

    #[test]
    fn records_read_back_and_damaged_ones_are_named() {
        let out = tempfile::tempdir().unwrap();
        let folder = JobFolder::new(out.path(), &job());
        assert_eq!(folder.read_record().unwrap(), None);
        drop(folder.lock().unwrap());
        let record = JobRecord::new(&job());
        folder.write_record(&record).unwrap();
        assert_eq!(folder.read_record().unwrap(), Some(record));
        fs::write(folder.record(), "{").unwrap();
        let message = folder.read_record().unwrap_err().to_string();
        assert!(message.contains("job.json"), "{message}");
    }
}
