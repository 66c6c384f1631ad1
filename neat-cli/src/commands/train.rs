//! `neat train`, and the arguments that it shares with `neat reconstruct`.

use crate::arguments::{ComputeArgs, MethodArgs};
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::progress::{Progress, ProgressFormat};
use crate::scene_arguments::SceneArgs;
use crate::{interrupt, output};
use clap::Args;
use neat_pipeline::config::Config;
use neat_pipeline::reconstruct::{RunOptions, train};
use neat_pipeline::run_dir::{Existing, RunDir};
use std::path::PathBuf;

/// Train on a scene, without taking the wireframe out
///
/// RUN then holds config.toml, manifest.json, metrics.jsonl and checkpoints/. `neat distill
/// RUN` does the rest.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat train SCENE --out RUN
  neat train SCENE --out RUN --preset paper-abc --time-budget 8h
  neat train SCENE --out RUN --resume         after Ctrl-C (exit code 130)")]
pub struct TrainArgs {
    #[command(flatten)]
    run: RunArgs,
}

/// A scene, a run folder, and how to get from one to the other.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Folder of the scene: images, poses and, unless they are to be detected, 2D wireframes (see
    /// `neat info`)
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Folder for everything that the run leaves; it must be new or empty
    #[arg(long, value_name = "RUN")]
    out: PathBuf,
    /// Replace an earlier run in that folder
    #[arg(long)]
    overwrite: bool,
    /// Continue the run in that folder where it ended, however it ended, to the same result; begin
    /// it if there is none. Other inputs or options than those it began with are refused
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,
    #[command(flatten)]
    pub method: MethodArgs,
    /// Seed of all randomness [default: 0]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    compute: ComputeArgs,
    /// Begin without a look at whether poses and images agree (see `neat doctor`)
    #[arg(long)]
    no_doctor: bool,
    /// How progress is shown on the standard error
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t)]
    progress: ProgressFormat,
    #[command(flatten)]
    cache: CacheArgs,
    #[command(flatten)]
    scene_args: SceneArgs,
}

impl RunArgs {
    /// The configuration of a run that continues no other.
    pub fn configuration(&self) -> Result<Config, CliError> {
        let config = self.method.config()?;
        self.scene_args.configure(config, &self.method)
    }

    /// Shows how far the run is.
    pub fn progress(&self, quiet: bool) -> Progress {
        Progress::with_format(quiet, self.progress)
    }

    /// The options of the run.
    pub fn options(&self) -> Result<RunOptions, CliError> {
        let (earlier, existing) = if self.resume {
            (RunDir::to_resume(&self.out)?, Existing::Resume)
        } else {
            (None, existing(self.overwrite))
        };
        let (config, preset, seed) = match earlier {
            Some(run) => {
                let manifest = run.manifest()?;
                // What is not said again stays; what is said has to be the same.
                let config = if self.method.has_base() {
                    self.method.config()?
                } else {
                    self.method.apply(&run.config()?)?
                };
                (config, manifest.preset, manifest.seed)
            }
            None => (self.method.config()?, self.method.name(), 0),
        };
        let config = self.scene_args.configure(config, &self.method)?;
        let seed = self.seed.unwrap_or(seed);
        Ok(RunOptions {
            scene: self.scene.clone(),
            out: self.out.clone(),
            existing,
            config,
            preset,
            backend: self.compute.backend.backend,
            seed,
            time_budget: self.compute.time_budget,
            examine: !self.no_doctor,
            cache: self.cache.open(),
            memory_limit: self.compute.memory.limit(),
            command_line: command_line(),
        })
    }
}

/// What `--overwrite` means for a folder.
pub fn existing(overwrite: bool) -> Existing {
    if overwrite {
        Existing::Overwrite
    } else {
        Existing::Refuse
    }
}

/// The arguments of this program, for the manifest.
pub fn command_line() -> Vec<String> {
    std::env::args_os()
        .map(|argument| argument.to_string_lossy().into_owned())
        .collect()
}

impl TrainArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        let options = self.run.options()?;
        let interrupted = interrupt::flag()?;
        let mut progress = self.run.progress(quiet);
        let run = train(&options, &interrupted, &mut |event| progress.show(event))
            .map_err(CliError::of_resumable)?;
        drop(progress);
        output::print(&format!("trained: {}", run.latest_checkpoint()?.display()))
    }
}
