//! What happens to the jobs of a batch while it runs.

use std::time::Duration;

/// What happens to a job.
#[derive(Clone, Debug, PartialEq)]
pub enum JobEvent {
    /// It was finished before.
    Skipped,
    /// Another process works on it; it is looked at again until that has ended.
    Waiting,
    /// An attempt begins.
    Started {
        /// Which one, from 1, over all batches so far.
        attempt: usize,
        /// The worker that runs it, from 0.
        worker: usize,
    },
    /// The program said something.
    Progress {
        /// Its last line.
        line: String,
    },
    /// An attempt failed, and there will be another.
    Retrying {
        /// How it failed.
        reason: String,
        /// When the next one comes.
        pause: Duration,
    },
    /// Its results are on disk.
    Finished {
        /// The time of all attempts.
        seconds: f64,
    },
    /// It is given up.
    Failed {
        /// Why.
        reason: String,
    },
    /// It was stopped; the next batch goes on with it.
    Interrupted,
}
