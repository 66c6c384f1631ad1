//! A worker: takes jobs and makes one attempt at a time at them.

use crate::attempt::{Attempt, POLL_INTERVAL};
use crate::error::BatchError;
use crate::job::Job;
use crate::job_event::JobEvent;
use crate::job_folder::{JobFolder, JobLock, Plan};
use crate::job_record::{self, JobRecord, JobState, Outcome};
use crate::options::BatchOptions;
use crate::queue::{Entry, Next, Queue};
use crate::stop::{Stop, StopSwitch};
use neat_core::{SceneError, with_causes};
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::Sender;
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Exit code of a program that saved its work because it was asked to end.
const INTERRUPTED: i32 = 130;
/// How often a job is looked at that another process works on.
const LOCK_INTERVAL: Duration = Duration::from_secs(1);

/// Takes jobs and makes one attempt at a time at them.
pub struct Worker<'a> {
    /// Which one it is, from 0.
    pub number: usize,
    /// CPU threads for its jobs.
    pub threads: usize,
    /// All jobs of the batch.
    pub jobs: &'a [Job],
    /// The folder of all jobs, absolute.
    pub out: &'a Path,
    /// How the batch is run.
    pub options: &'a BatchOptions,
    /// Whether it is to end.
    pub stop: &'a StopSwitch,
    /// Where to tell what happens, with the position of the job.
    pub events: Sender<(usize, JobEvent)>,
}

impl Worker<'_> {
    /// Takes jobs until there are none. One that another worker puts back later is
    /// taken again by that one.
    pub fn work(&self, queue: &Queue) {
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
                Err(error) => {
                    let reason = with_causes(&error);
                    self.tell(position, JobEvent::Failed { reason });
                }
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
        let error = (!outcome.is_done())
            .then(|| log.last_error(log_start))
            .flatten();
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
        let no_result = outcome.is_done() && !folder.wireframe().is_file();
        if outcome.is_done() && !no_result {
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
