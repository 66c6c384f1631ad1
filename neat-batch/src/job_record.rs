//! `job.json`: what has become of a job.

use crate::job::Job;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::PathBuf;

/// What has become of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Nobody has begun with it.
    #[default]
    Pending,
    /// Somebody works on it, or was killed while working on it.
    Running,
    /// It was stopped by a person or a cluster, and goes on from there.
    Interrupted,
    /// Its last attempt failed.
    Failed,
    /// All results are on disk.
    Finished,
}

impl JobState {
    /// All states, in the order in which a job can go through them.
    pub const ALL: [Self; 5] = [
        Self::Pending,
        Self::Running,
        Self::Interrupted,
        Self::Failed,
        Self::Finished,
    ];
}

impl fmt::Display for JobState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pending => "pending",
            Self::Running => "running",
            Self::Interrupted => "interrupted",
            Self::Failed => "failed",
            Self::Finished => "finished",
        })
    }
}

/// How an attempt ended.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Nobody has seen it: it still runs, or the batch was killed.
    #[default]
    Unknown,
    /// The program ended with this exit code.
    Exited(i32),
    /// This signal killed the program.
    Killed(i32),
    /// The program could not be started, for this reason.
    NotStarted(String),
}

impl Outcome {
    /// Whether the program came to its end; with exit code 3 it found nothing.
    pub fn is_done(&self) -> bool {
        matches!(self, Self::Exited(0 | 3))
    }

    /// Whether another attempt may end better. Exit code 2 stands for input or
    /// arguments that cannot be used.
    pub fn may_pass(&self) -> bool {
        !(self.is_done() || *self == Self::Exited(2))
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown => f.write_str("its end was not seen"),
            Self::Exited(code) => write!(f, "exit code {code}"),
            Self::Killed(9) => f.write_str("killed by signal 9, maybe for want of memory"),
            Self::Killed(signal) => write!(f, "killed by signal {signal}"),
            Self::NotStarted(reason) => write!(f, "it could not be started: {reason}"),
        }
    }
}

/// One attempt at a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attempt {
    /// When it began, in seconds since 1970 UTC.
    pub started: u64,
    /// How long it took, in seconds; 0 if its end was not seen.
    pub seconds: f64,
    /// How it ended.
    pub outcome: Outcome,
}

/// The content of `job.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobRecord {
    /// The job's name.
    pub name: String,
    /// Folder of its scene.
    pub scene: PathBuf,
    /// Its further arguments of `neat reconstruct`.
    pub arguments: Vec<String>,
    /// What has become of it.
    pub state: JobState,
    /// Why it is not finished, if an attempt failed.
    pub error: Option<String>,
    /// All attempts so far, the first one first.
    pub attempts: Vec<Attempt>,
}

impl JobRecord {
    /// The record of a job that nobody has begun with.
    pub fn new(job: &Job) -> Self {
        Self {
            name: job.name.clone(),
            scene: job.scene.clone(),
            arguments: job.arguments.clone(),
            state: JobState::Pending,
            error: None,
            attempts: Vec::new(),
        }
    }

    /// How long all attempts took together, in seconds.
    pub fn seconds(&self) -> f64 {
        self.attempts.iter().map(|attempt| attempt.seconds).sum()
    }

    /// What differs between the job that is recorded and `job`; `None` if nothing
    /// that its result depends on.
    pub fn difference(&self, job: &Job) -> Option<String> {
        if self.scene != job.scene {
            let (old, new) = (self.scene.display(), job.scene.display());
            return Some(format!("the scene was {old} and is now {new}"));
        }
        (self.arguments != job.arguments).then(|| {
            let (old, new) = (in_words(&self.arguments), in_words(&job.arguments));
            format!("the arguments were {old} and are now {new}")
        })
    }
}

fn in_words(arguments: &[String]) -> String {
    match arguments {
        [] => "none".to_owned(),
        all => format!("`{}`", all.join(" ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_bad_input_and_what_is_done_are_final() {
        assert!(
            [0, 2, 3]
                .iter()
                .all(|code| !Outcome::Exited(*code).may_pass())
        );
        let worth_it = [Outcome::Exited(1), Outcome::Exited(130), Outcome::Killed(9)];
        assert!(worth_it.iter().all(Outcome::may_pass));
    }

    #[test]
    fn what_differs_is_said() {
        let job = Job {
            name: "house".into(),
            scene: "/scenes/house".into(),
            arguments: vec!["--seed".into(), "1".into()],
            truth: None,
        };
        let record = JobRecord::new(&job);
        assert_eq!(record.difference(&job), None);
        let other_truth = Job {
            truth: Some("truth.json".into()),
            ..job.clone()
        };
        // It is measured with, not reconstructed from.
        assert_eq!(record.difference(&other_truth), None);
        let no_seed = Job {
            arguments: Vec::new(),
            ..job.clone()
        };
        let text = record.difference(&no_seed).unwrap();
        assert_eq!(text, "the arguments were `--seed 1` and are now none");
        let moved = Job {
            scene: "/other".into(),
            ..job
        };
        assert!(record.difference(&moved).unwrap().contains("/other"));
    }
}
