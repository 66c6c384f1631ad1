//! `neat demo`.

use super::reconstruct::{not_empty, summary};
use super::synth::SceneArgs;
use super::train::{command_line, existing};
use crate::arguments::{ComputeArgs, MethodArgs};
use crate::error::CliError;
use crate::progress::Progress;
use crate::{interrupt, output};
use clap::Args;
use neat_lab::demo::demo;
use neat_pipeline::reconstruct::RunOptions;
use std::path::PathBuf;

/// Make a synthetic scene, reconstruct it, and measure the result, in one go
///
/// OUT then holds scene/, run/ (see `neat reconstruct`) and evaluation.json: the edges by
/// NEAT's protocol, or the faces of a solid with arcs.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat demo
  neat demo --overwrite --solid stair-prism --views 40
  neat demo --out OTHER --train --time-budget 20s")]
pub struct DemoArgs {
    /// Folder for the scene and the run; it must be new or empty
    #[arg(long, value_name = "OUT", default_value = "neat-demo")]
    out: PathBuf,
    /// Replace an earlier demonstration in that folder
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    scene: SceneArgs,
    /// Train a field too, as `neat reconstruct --train`
    #[arg(long)]
    train: bool,
    #[command(flatten)]
    method: MethodArgs,
    /// Seed of the scene and of the reconstruction
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    compute: ComputeArgs,
}

impl DemoArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        let mut config = self.method.config()?;
        if self.train {
            config = self.method.with_field(config)?;
        }
        let options = RunOptions {
            scene: self.out.clone(),
            out: self.out,
            existing: existing(self.overwrite),
            config,
            preset: self.method.name(),
            backend: self.compute.backend.backend,
            seed: self.seed,
            time_budget: self.compute.time_budget,
            examine: false,
            cache: None,
            memory_limit: self.compute.memory.limit(),
            command_line: command_line(),
        };
        let interrupted = interrupt::flag()?;
        let mut progress = Progress::new(quiet);
        let synthetic = self.scene.config(self.seed);
        let demo = demo(&synthetic, &options, &interrupted, &mut |event| {
            progress.show(event);
        })?;
        drop(progress);
        output::print(&format!(
            "{}\n\n{}\nall numbers: {}",
            summary(&demo.reconstruction),
            demo.evaluation.to_text(),
            demo.evaluation_file.display(),
        ))?;
        not_empty(&demo.reconstruction)
    }
}
