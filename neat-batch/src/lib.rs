//! Many scenes: a queue of reconstructions that survives whatever happens to its
//! machine.
//!
//! A [`Batch`] is a list of jobs, one per scene, from a manifest or from folders.
//! [`run`] gives each of them to a child process of its own, so that a crash or a
//! lack of memory ends one scene and not the night's work:
//!
//! ```text
//! OUT/NAME/run/        what `neat reconstruct` leaves
//! OUT/NAME/log.txt     what it said, of all attempts
//! OUT/NAME/job.json    a JobRecord: state, attempts and how they ended
//! OUT/NAME/lock        held while somebody works on the job
//! OUT/summary.json     a Summary of all jobs; also summary.md and summary.csv
//! ```
//!
//! Every attempt continues what the one before it left (`--resume`). Failures are
//! tried again after a pause that doubles each time, except bad input, which stays
//! bad. A job that is finished is not run again, and a lock that ends with the
//! process keeps two batches from working on one job, on one machine or on several
//! that share a disk. A [`Shard`] is the part of a batch that one task of a cluster
//! does.
//!
//! The crate draws nothing and reads no arguments: it tells of [`JobEvent`]s.
//!
//! # Example
//!
//! ```no_run
//! use neat_batch::{Batch, BatchOptions, JobState, StopSwitch, Summary};
//! use std::path::Path;
//!
//! let batch = Batch::from_manifest(Path::new("scenes.toml"))?;
//! let out = Path::new("out");
//! let options = BatchOptions::new("/usr/local/bin/neat");
//! neat_batch::run(&batch, out, &options, &StopSwitch::default(), &mut |job, event| {
//!     println!("{}: {event:?}", job.name);
//! })?;
//! let summary = Summary::write(&batch, out)?;
//! println!("{} of {} scenes", summary.totals.count(JobState::Finished), summary.jobs.len());
//! # Ok::<(), neat_batch::BatchError>(())
//! ```

#![forbid(unsafe_code)]

mod attempt;
mod batch;
mod error;
mod job;
mod job_event;
mod job_folder;
mod job_record;
mod json_file;
mod log_file;
mod manifest_file;
mod options;
mod queue;
mod result_files;
mod run;
mod scene_folders;
mod shard;
mod stop;
mod summary;
mod summary_files;
mod worker;

pub use batch::Batch;
pub use error::BatchError;
pub use job::Job;
pub use job_event::JobEvent;
pub use job_folder::{JobFolder, JobLock, Plan};
pub use job_record::{Attempt, JobRecord, JobState, Outcome};
pub use options::{BatchOptions, Retry};
pub use result_files::{ResultFigures, read_result};
pub use run::{BatchEnd, run};
pub use shard::{Shard, ShardError, ShardSource};
pub use stop::{Stop, StopSwitch};
pub use summary::{Aggregate, JobSummary, Summary, Totals};
pub use summary_files::{to_csv, to_markdown};

/// The example of the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
