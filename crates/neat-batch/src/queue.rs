//! The queue: jobs, and workers that run one child process each.

use crate::attempt::{Attempt, POLL_INTERVAL};
use crate::batch::Batch;
use crate::error::BatchError;
use crate::job::Job;
use crate::job_folder::{JobFolder, JobLock, Plan};
use crate::job_record::{self, JobRecord, JobState, Outcome};
use crate::retry::Retry;
use crate::stop::{Stop, StopSwitch};
use neat_core::{SceneError, file};
use std::collections::VecDeque;
use std::error::Error;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, sleep};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Exit code of a program that saved its work because it was asked to end.
const INTERRUPTED: i32 = 130;
/// How often a job is looked at that another process works on.
const LOCK_INTERVAL: Duration = Duration::from_secs(1);

/// How a batch is run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BatchOptions {
    /// The program, `neat`. It is given the arguments of [`Job::command_line`] and
    /// `--threads N`. Exit codes: 0 done, 2 bad input, 130 interrupted, others failed.
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
/// [`BatchEnd`] and the [`JobRecord`]s.
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
    let out = std::path::absolute(out).map_err(|source| SceneError::Read {
        path: out.into(),
        source,
    })?;
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

/// A job that somebody has to look at.
struct Entry {
    position: usize,
    /// Not before this moment.
    ready: Instant,
    /// Kept between the attempts at a job.
    lock: Option<JobLock>,
    failures: u32,
    waits: bool,
}

/// The jobs that no worker looks at.
struct Queue {
    entries: Mutex<VecDeque<Entry>>,
}

/// What a queue has for a worker.
enum Next {
    Entry(Entry),
    Later,
    Nothing,
}

impl Queue {
    fn new(jobs: usize) -> Self {
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

    fn next(&self) -> Next {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        match entries.iter().position(|entry| entry.ready <= now) {
            Some(first) => entries.remove(first).map_or(Next::Nothing, Next::Entry),
            None if entries.is_empty() => Next::Nothing,
            None => Next::Later,
        }
    }

    fn put_back(&self, entry: Entry) {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        entries.push_back(entry);
    }
}

struct Worker<'a> {
    number: usize,
    threads: usize,
    jobs: &'a [Job],
    out: &'a Path,
    options: &'a BatchOptions,
    stop: &'a StopSwitch,
    events: Sender<(usize, JobEvent)>,
}

impl Worker<'_> {
    /// Takes jobs until there are none. One that another worker puts back later is
    /// taken again by that one.
    fn work(&self, queue: &Queue) {
        while self.stop.asked_for() == Stop::No {
            let entry = match queue.next() {
                Next::Entry(entry) => entry,
                Next::Later => {
                    sleep(POLL_INTERVAL);
                    continue;
                }
                Next::Nothing => return,
            };
            let position = entry.position;
            match self.process(entry) {
                Ok(Some(entry)) => queue.put_back(entry),
                Ok(None) => {}
                Err(error) => self.tell(
                    position,
                    JobEvent::Failed {
                        reason: with_causes(&error),
                    },
                ),
            }
        }
    }

    fn tell(&self, position: usize, event: JobEvent) {
        // Whoever listens outlives all workers.
        let _ = self.events.send((position, event));
    }

    /// Makes one attempt at a job. Returns it if it is to be looked at again.
    fn process(&self, mut entry: Entry) -> Result<Option<Entry>, BatchError> {
        let position = entry.position;
        let job = &self.jobs[position];
        let folder = JobFolder::new(self.out, job);
        let lock = match entry.lock.take() {
            Some(lock) => Some(lock),
            None => folder.lock()?,
        };
        let Some(lock) = lock else {
            if !entry.waits {
                self.tell(position, JobEvent::Waiting);
            }
            entry.waits = true;
            entry.ready = Instant::now() + LOCK_INTERVAL;
            return Ok(Some(entry));
        };
        let earlier = folder.read_record()?;
        match folder.plan(job, earlier.as_ref()) {
            Plan::Finished => {
                self.tell(position, JobEvent::Skipped);
                return Ok(None);
            }
            Plan::Changed(_) if self.options.restart_changed => folder.remove_run()?,
            Plan::Changed(difference) => {
                let run = folder.run();
                let reason = format!(
                    "{difference}: give those of {} again, move that folder away, or pass --restart-changed to begin the job anew",
                    run.display()
                );
                self.tell(position, JobEvent::Failed { reason });
                return Ok(None);
            }
            Plan::Begin | Plan::Continue => {}
        }
        let attempts = earlier.map_or_else(Vec::new, |record| record.attempts);
        let mut record = JobRecord {
            attempts,
            ..JobRecord::new(job)
        };
        self.attempt(position, &folder, &lock, &mut record)?;
        let event = self.judge(&folder, &mut record, &mut entry);
        folder.write_record(&record)?;
        let again = match &event {
            JobEvent::Retrying { pause, .. } => {
                entry.ready = Instant::now() + *pause;
                entry.lock = Some(lock);
                Some(entry)
            }
            _ => None,
        };
        self.tell(position, event);
        Ok(again)
    }

    /// Runs the program and records how it ended.
    fn attempt(
        &self,
        position: usize,
        folder: &JobFolder,
        lock: &JobLock,
        record: &mut JobRecord,
    ) -> Result<(), BatchError> {
        let job = &self.jobs[position];
        let number = record.attempts.len() + 1;
        let mut arguments = job.command_line(&folder.run());
        if !job.chooses_threads() {
            arguments.extend(["--threads".to_owned(), self.threads.to_string()]);
        }
        let log = folder.log();
        let header = format!("=== attempt {number}: {}", arguments.join(" "));
        let (output, log_start) = log.begin(&header)?;
        let input = lock.standard_input().map_err(|source| SceneError::Read {
            path: folder.run(),
            source,
        })?;
        record.state = JobState::Running;
        record.attempts.push(job_record::Attempt {
            started: seconds_since_1970(),
            seconds: 0.0,
            outcome: Outcome::Unknown,
        });
        folder.write_record(record)?;
        let worker = self.number;
        self.tell(
            position,
            JobEvent::Started {
                attempt: number,
                worker,
            },
        );
        let began = Instant::now();
        let mut command = Command::new(&self.options.program);
        command.args(&arguments);
        let attempt = Attempt {
            command,
            input,
            output,
            log: &log,
            log_start,
        };
        let outcome = attempt.run(self.stop, &mut |line| {
            self.tell(position, JobEvent::Progress { line });
        });
        let error = match outcome {
            Outcome::Exited(0) => None,
            _ => log.last_error(log_start),
        };
        record.error = error;
        if let Some(attempt) = record.attempts.last_mut() {
            attempt.seconds = began.elapsed().as_secs_f64();
            attempt.outcome = outcome;
        }
        Ok(())
    }

    /// What the end of the last attempt means for the job.
    fn judge(&self, folder: &JobFolder, record: &mut JobRecord, entry: &mut Entry) -> JobEvent {
        let last = record.attempts.last();
        let outcome = last.map_or(Outcome::Unknown, |attempt| attempt.outcome.clone());
        let said = record.error.take();
        let no_result = outcome == Outcome::Exited(0) && !folder.wireframe().is_file();
        if outcome == Outcome::Exited(0) && !no_result {
            record.state = JobState::Finished;
            let seconds = record.seconds();
            return JobEvent::Finished { seconds };
        }
        let stopped = matches!(outcome, Outcome::Exited(INTERRUPTED) | Outcome::Killed(_));
        if stopped && self.stop.asked_for() != Stop::No {
            record.state = JobState::Interrupted;
            return JobEvent::Interrupted;
        }
        let reason = match said {
            _ if no_result => "it ended without a wireframe.json".to_owned(),
            Some(said) => format!("{outcome}: {said}"),
            None => outcome.to_string(),
        };
        record.state = JobState::Failed;
        record.error = Some(reason.clone());
        entry.failures += 1;
        let pause = self.options.retry.pause(entry.failures);
        match pause.filter(|_| outcome.may_pass() || no_result) {
            Some(pause) => JobEvent::Retrying { reason, pause },
            None => JobEvent::Failed { reason },
        }
    }
}

fn seconds_since_1970() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |elapsed| elapsed.as_secs())
}

/// An error with its causes, in one line.
fn with_causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let message = error.to_string();
        if !text.contains(&message) {
            text += &format!(" ({message})");
        }
        cause = error.source();
    }
    text
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
