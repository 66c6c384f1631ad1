//! How a batch is run, and how often a failed job is tried again.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::thread;
use std::time::Duration;

/// How a batch is run. Begin with [`BatchOptions::new`] and change what you mean to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BatchOptions {
    /// The program, `neat`. It is given the arguments of [`Job::command_line`](crate::Job::command_line) and
    /// `--threads N`. Exit codes: 0 done, 2 bad input, 3 done without an edge,
    /// 130 interrupted, others failed.
    pub program: PathBuf,
    /// So many jobs run at a time.
    pub workers: NonZeroUsize,
    /// CPU threads, which the workers share. A job with a `--threads` of its own is
    /// left alone.
    pub threads: NonZeroUsize,
    /// How often failures are tried again.
    pub retry: Retry,
    /// Remove the run of a job that has other arguments now, and begin it anew;
    /// otherwise such a job fails, and its run is untouched.
    pub restart_changed: bool,
}

impl BatchOptions {
    /// One job at a time on all CPU threads: what is fastest for large scenes, and
    /// for any on one GPU.
    pub fn new(program: impl Into<PathBuf>) -> Self {
        Self {
            program: program.into(),
            workers: NonZeroUsize::MIN,
            threads: thread::available_parallelism().unwrap_or(NonZeroUsize::MIN),
            retry: Retry::default(),
            restart_changed: false,
        }
    }
}

/// How often, and after how long, a failed job is tried again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Retry {
    /// Attempts after the first one, per call of [`run`](crate::run).
    pub count: u32,
    /// The pause before the first of them; every further one is twice as long …
    pub first_pause: Duration,
    /// … up to this.
    pub longest_pause: Duration,
}

impl Default for Retry {
    /// Twice, after 5 and 10 seconds: enough for a device that was lost or memory
    /// that somebody else took.
    fn default() -> Self {
        Self {
            count: 2,
            first_pause: Duration::from_secs(5),
            longest_pause: Duration::from_secs(300),
        }
    }
}

impl Retry {
    /// The pause after so many failures; `None` if there is no further attempt.
    pub fn pause(&self, failures: u32) -> Option<Duration> {
        let doublings = failures.checked_sub(1)?;
        let pause = self
            .first_pause
            .saturating_mul(2_u32.saturating_pow(doublings));
        (failures <= self.count).then(|| pause.min(self.longest_pause))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest() {
        let retry = Retry {
            count: 40,
            first_pause: Duration::from_secs(1),
            longest_pause: Duration::from_secs(6),
        };
        let seconds = |failures| retry.pause(failures).map(|pause| pause.as_secs());
        assert_eq!([1, 2, 3, 4, 40].map(seconds), [1, 2, 4, 6, 6].map(Some));
        assert_eq!(seconds(41), None);
        let never = Retry { count: 0, ..retry };
        assert_eq!(never.pause(1), None);
    }
}
