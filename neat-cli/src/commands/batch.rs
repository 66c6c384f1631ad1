//! `neat batch`.

use super::Cli;
use crate::batch_progress::BatchProgress;
use crate::error::CliError;
use crate::{duration, interrupt, output};
use clap::{Args, Parser};
use neat_batch::{
    Batch, BatchOptions, JobFolder, Plan, Retry, Shard, ShardSource, Stop, StopSwitch, Summary,
    to_markdown,
};
use neat_core::with_causes;
use std::env;
use std::fmt::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::Duration;

/// How often the flag of Ctrl-C is looked at.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(25);

/// Reconstruct many scenes, and go on after whatever stops it
///
/// Every scene is reconstructed by a process of its own in OUT/NAME: run/ as of `neat
/// reconstruct`, log.txt with what it said, and job.json with its attempts. A process that fails
/// or is killed is tried again, and continues; one that cannot use its input (exit code 2) is
/// not. The same command once more skips what is finished and continues the rest; several at a
/// time, on one machine or on several that share a disk, divide the work among them.
///
/// OUT/summary.md, .csv and .json say what became of every scene; where it has a true wireframe
/// (`truth` in the manifest or SCENE/gt_wireframe.json), with precision and recall as of `neat
/// eval`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat batch 'scenes/*' --out OUT                          every folder there is a scene
  neat batch scenes.toml --out OUT --workers 4             as a manifest says
  neat batch 'scenes/*' --out OUT -- --train               arguments of `neat reconstruct` for all
  neat batch scenes.toml --out OUT --dry-run               what would be done
  neat batch scenes.toml --out OUT --shard 2/8             the second eighth; in a Slurm job array
                                                           without --shard
  neat batch scenes.toml --out OUT --summary-only          sum up what all shards have done

A manifest:
  [defaults]                       # for every job; all keys are optional
  preset = \"fast\"                  # or config = \"FILE\"
  seed = 0
  set = [\"data.max_image_size=1600\"]
  args = [\"--train\", \"--time-budget\", \"10m\"]

  [[job]]
  scene = \"scenes/house\"           # relative to the folder of the manifest

  [[job]]
  scene = \"scenes/house\"
  name = \"house-seed-1\"            # the name of the scene's folder without it
  seed = 1                         # preset, config and seed replace the defaults;
  set = [\"train.steps=2000\"]       # set and args come after them
  truth = \"truth/house.json\"

Exit codes: 0 all finished, 1 some failed, 2 bad arguments or a bad manifest, 130 interrupted:
the first Ctrl-C or SIGTERM lets running scenes end their step and save, the second kills them.")]
pub struct BatchArgs {
    /// A manifest (.toml), or folders of scenes: paths, or patterns such as 'scenes/*'
    #[arg(value_name = "MANIFEST|GLOB", required = true)]
    inputs: Vec<String>,
    /// Folder for all jobs and the summary; new, or with what this batch has left before
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
    /// Reconstruct so many scenes at a time; they share the CPU threads
    #[arg(long, value_name = "N", default_value = "1")]
    workers: NonZeroUsize,
    /// Do only part I of N of the batch; by default what SLURM_ARRAY_TASK_ID or
    /// JOB_COMPLETION_INDEX says
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Number of shards, where the environment has only the index (Kubernetes); by default what
    /// NEAT_SHARDS says
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    shards: Option<u32>,
    /// Try a scene that failed so many times more, if that is worth it
    #[arg(long, value_name = "N", default_value_t = Retry::default().count)]
    retries: u32,
    /// Pause before the first retry; it doubles for every further one, up to 5 minutes
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = duration::parse)]
    retry_pause: Duration,
    /// Begin jobs anew whose arguments have changed, and remove their runs; otherwise they fail
    #[arg(long)]
    restart_changed: bool,
    /// Say what would be done, and do nothing
    #[arg(long, conflicts_with = "summary_only")]
    dry_run: bool,
    /// Write the summary of what has been done, in all shards, and do nothing else
    #[arg(long, conflicts_with_all = ["shard", "shards"])]
    summary_only: bool,
    /// Arguments of `neat reconstruct` for every scene
    #[arg(value_name = "ARGS", last = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

impl BatchArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        let batch = self.batch()?;
        check_arguments(&batch)?;
        if self.summary_only {
            let summary = self.sum_up(&batch)?;
            return match summary.is_finished() {
                true => Ok(()),
                false => Err(CliError::JobsUnfinished {
                    unfinished: summary.jobs.len() - summary.totals.finished,
                    all: summary.jobs.len(),
                }),
            };
        }
        let variable = |name: &str| env::var(name).ok();
        let (shard, source) = Shard::choose(self.shard, self.shards, variable)
            .map_err(neat_batch::BatchError::from)?;
        let part = batch.shard(shard);
        if self.dry_run {
            return output::print(&plan(&part, &self.out)?);
        }
        if source != ShardSource::Nobody && !quiet {
            let (ours, all) = (part.jobs().len(), batch.jobs().len());
            output::note(&format!("shard {shard}, by {source}: {ours} of {all} jobs"));
        }
        let (end, stopped) = self.run_part(&part, quiet)?;
        self.sum_up(&batch)?;
        if stopped != Stop::No && end.unfinished > 0 {
            return Err(CliError::BatchInterrupted {
                unfinished: end.unfinished,
            });
        }
        match end.failed {
            0 => Ok(()),
            unfinished => Err(CliError::JobsUnfinished {
                unfinished,
                all: part.jobs().len(),
            }),
        }
    }

    fn batch(&self) -> Result<Batch, CliError> {
        let is_manifest = |input: &String| {
            let path = Path::new(input);
            path.extension().is_some_and(|ending| ending == "toml") && !path.is_dir()
        };
        let batch = match self.inputs.as_slice() {
            [manifest] if is_manifest(manifest) => Batch::from_manifest(Path::new(manifest))?,
            inputs => match inputs.iter().find(|input| is_manifest(input)) {
                Some(manifest) => {
                    return Err(CliError::Usage(format!(
                        "the manifest {manifest} must be the only input: name the other scenes in it"
                    )));
                }
                None => Batch::from_folders(inputs)?,
            },
        };
        Ok(batch.with_arguments(&self.arguments)?)
    }

    /// Runs the jobs; returns how they ended, and whether somebody asked to stop.
    fn run_part(
        &self,
        part: &Batch,
        quiet: bool,
    ) -> Result<(neat_batch::BatchEnd, Stop), CliError> {
        let threads = rayon::current_num_threads();
        let options = BatchOptions {
            workers: self.workers,
            threads: NonZeroUsize::new(threads).unwrap_or(NonZeroUsize::MIN),
            retry: Retry {
                count: self.retries,
                first_pause: self.retry_pause,
                ..Retry::default()
            },
            restart_changed: self.restart_changed,
            ..BatchOptions::new(env::current_exe()?)
        };
        let signalled = interrupt::repeated_flag()?;
        let stop = StopSwitch::default();
        let done = AtomicBool::new(false);
        let workers = self.workers.get().min(part.jobs().len());
        let progress = BatchProgress::new(quiet, part.jobs().len(), workers, &self.out);
        let end = thread::scope(|scope| {
            scope.spawn(|| {
                while !done.load(Ordering::SeqCst) {
                    if signalled.swap(false, Ordering::SeqCst) {
                        if stop.asked_for() == Stop::Now {
                            // Its scenes are killed; what else takes so long?
                            process::exit(crate::error::INTERRUPTED.into());
                        }
                        progress.stop(stop.request());
                    }
                    sleep(SIGNAL_INTERVAL);
                }
            });
            let end = neat_batch::run(part, &self.out, &options, &stop, &mut |job, event| {
                progress.show(job, &event);
            });
            done.store(true, Ordering::SeqCst);
            end
        });
        progress.finish();
        Ok((end?, stop.asked_for()))
    }

    /// Writes the summary of all jobs, and prints it.
    fn sum_up(&self, batch: &Batch) -> Result<Summary, CliError> {
        let summary = Summary::write(batch, &self.out)?;
        let file = self.out.join("summary.md");
        output::print(&format!("{}\n{}", to_markdown(&summary), file.display()))?;
        Ok(summary)
    }
}

/// Finds mistakes in the arguments and configurations of jobs now, and not in the middle of
/// the night.
fn check_arguments(batch: &Batch) -> Result<(), CliError> {
    for job in batch.jobs() {
        let usage = |what: String| CliError::Usage(format!("job `{}`: {what}", job.name));
        let arguments = job.command_line(Path::new("RUN"));
        let program = ["neat".to_owned()].into_iter();
        match Cli::try_parse_from(program.chain(arguments)) {
            Ok(cli) => (cli.check_configuration()).map_err(|error| usage(with_causes(&error)))?,
            Err(error) => {
                let text = error.to_string();
                let line = text.lines().next().unwrap_or_default();
                let line = line.trim_start_matches("error: ");
                return Err(usage(format!("{line}; see `neat reconstruct --help`")));
            }
        }
    }
    Ok(())
}

/// What would be done, one line per job.
fn plan(batch: &Batch, out: &Path) -> Result<String, CliError> {
    let mut text = String::new();
    for job in batch.jobs() {
        let folder = JobFolder::new(out, job);
        let record = folder.read_record()?;
        let command = job.command_line(&folder.run()).join(" ");
        let what = match folder.plan(job, record.as_ref()) {
            Plan::Begin => format!("neat {command}"),
            Plan::Continue => format!("continue: neat {command}"),
            Plan::Finished => "finished before".to_owned(),
            Plan::Changed(difference) => format!("another job than before: {difference}"),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}: {what}", job.name);
    }
    Ok(text)
}
