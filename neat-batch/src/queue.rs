//! The jobs that no worker looks at.

use crate::job_folder::JobLock;
use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// A job that somebody has to look at.
pub struct Entry {
    /// Which job of the batch it is.
    pub position: usize,
    /// Not before this moment.
    pub ready: Instant,
    /// Kept between the attempts at a job.
    pub lock: Option<JobLock>,
    /// How many attempts have failed.
    pub failures: u32,
    /// Whether another process was seen to work on it.
    pub waits: bool,
}

/// The jobs that no worker looks at.
pub struct Queue {
    entries: Mutex<VecDeque<Entry>>,
}

/// What a queue has for a worker.
pub enum Next {
    /// A job to look at now.
    Entry(Entry),
    /// There are jobs, but none for now.
    Later,
    /// Others may be put back by the workers that look at them.
    Nothing,
}

impl Queue {
    /// All jobs of a batch of so many.
    pub fn new(jobs: usize) -> Self {
        let now = Instant::now();
        let entries = (0..jobs).map(|position| Entry {
            position,
            ready: now,
            lock: None,
            failures: 0,
            waits: false,
        });
        Self {
            entries: Mutex::new(entries.collect()),
        }
    }

    /// Takes the first job whose time has come.
    pub fn next(&self) -> Next {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        match entries.iter().position(|entry| entry.ready <= now) {
            Some(first) => entries.remove(first).map_or(Next::Nothing, Next::Entry),
            None if entries.is_empty() => Next::Nothing,
            None => Next::Later,
        }
    }

    /// Puts a job back, behind the others.
    pub fn put_back(&self, entry: Entry) {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        entries.push_back(entry);
    }
}
