//! A whole batch: workers that take jobs from one queue.

use crate::batch::Batch;
use crate::error::BatchError;
use crate::job::Job;
use crate::job_event::JobEvent;
use crate::json_file::absolute;
use crate::options::BatchOptions;
use crate::queue::Queue;
use crate::stop::StopSwitch;
use crate::worker::Worker;
use neat_core::file;
use std::path::Path;
use std::sync::mpsc::channel;
use std::thread;

/// How many jobs came to which end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BatchEnd {
    /// Finished now.
    pub finished: usize,
    /// Finished before.
    pub skipped: usize,
    /// Given up.
    pub failed: usize,
    /// Stopped, or not begun with before the batch was stopped.
    pub unfinished: usize,
}

/// Runs all jobs of a batch that are not finished in `out`, and tells `on_event` what
/// happens to them, on the thread of the caller.
///
/// A job that fails, whatever the reason, does not keep others from running: see
/// [`BatchEnd`] and the [`JobRecord`](crate::JobRecord)s.
///
/// # Errors
/// If `out` cannot be created.
pub fn run(
    batch: &Batch,
    out: &Path,
    options: &BatchOptions,
    stop: &StopSwitch,
    on_event: &mut dyn FnMut(&Job, JobEvent),
) -> Result<BatchEnd, BatchError> {
    file::create_dir(out)?;
    let out = absolute(out)?;
    let jobs = batch.jobs();
    let queue = Queue::new(jobs.len());
    let workers = options.workers.get().min(jobs.len());
    let mut end = BatchEnd::default();
    thread::scope(|scope| {
        let (events, received) = channel();
        for number in 0..workers {
            let worker = Worker {
                number,
                threads: share(options.threads.get(), workers, number),
                jobs,
                out: &out,
                options,
                stop,
                events: events.clone(),
            };
            let queue = &queue;
            scope.spawn(move || worker.work(queue));
        }
        drop(events);
        for (position, event) in received {
            match &event {
                JobEvent::Finished { .. } => end.finished += 1,
                JobEvent::Skipped => end.skipped += 1,
                JobEvent::Failed { .. } => end.failed += 1,
                _ => {}
            }
            on_event(&jobs[position], event);
        }
    });
    end.unfinished = jobs.len() - end.finished - end.skipped - end.failed;
    Ok(end)
}

/// The threads of a worker: those of the machine, spread evenly, one at least.
fn share(threads: usize, workers: usize, number: usize) -> usize {
    let remainder = usize::from(number < threads % workers);
    (threads / workers + remainder).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workers_share_all_threads() {
        let shares = |threads, workers| -> Vec<usize> {
            (0..workers)
                .map(|number| share(threads, workers, number))
                .collect()
        };
        assert_eq!(shares(8, 3), [3, 3, 2]);
        assert_eq!(shares(2, 2), [1, 1]);
        assert_eq!(shares(1, 3), [1, 1, 1]);
    }
}
