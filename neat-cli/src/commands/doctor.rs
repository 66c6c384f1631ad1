//! `neat doctor`.

use crate::arguments::BackendArg;
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::memory::MemoryArgs;
use crate::scene_arguments::SceneArgs;
use crate::{duration, output};
use clap::Args;
use neat_core::{Scene, load_scene};
use neat_doctor::{Depth, Examination, ExamineOptions, Verdict, examine_folder, examine_loaded};
use neat_lab::estimate::{Estimate, estimate, speed};
use neat_pipeline::config::Preset;
use neat_tensor::Backend;
use serde::Serialize;
use std::path::PathBuf;

/// Examine a scene before hours are spent on it, and say what is wrong with it
///
/// Looks at poses and intrinsics against the images (inverted or mirrored poses, wrong camera
/// axes, focal lengths, image sizes or order, single bad poses), at the images themselves
/// (exposure, blur, duplicates), at the capture (coverage, baselines, the scene sphere), and at
/// what the presets will take on this machine. Where a flag repairs what is wrong, it is named.
///
/// Exit code 2 if a run would be lost time.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat doctor SCENE
  neat doctor SCENE --camera-axes right-up-back      try what was suggested
  neat doctor SCENE --json > examination.json")]
pub struct DoctorArgs {
    /// Folder of the scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Take a second or two: look at some of the views only
    #[arg(long)]
    quick: bool,
    /// Print JSON, for programs
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    backend: BackendArg,
    #[command(flatten)]
    memory: MemoryArgs,
    #[command(flatten)]
    cache: CacheArgs,
    #[command(flatten)]
    scene_args: SceneArgs,
}

/// What a preset takes.
#[derive(Debug, Serialize)]
struct Cost {
    preset: Preset,
    #[serde(flatten)]
    estimate: Estimate,
}

#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    examination: &'a Examination,
    costs: &'a [Cost],
}

impl DoctorArgs {
    pub fn run(self) -> Result<(), CliError> {
        let memory_limit = self.memory.limit();
        let cache = self.cache.open();
        let options = (self.scene_args).load_options(cache.as_ref(), memory_limit);
        let depth = match self.quick {
            true => Depth::Quick,
            false => Depth::Full,
        };
        let how = ExamineOptions {
            depth,
            memory_limit,
            ..ExamineOptions::default()
        };
        // Before the work: a backend that cannot be used is an error at once. No GPU is
        // looked for, and what training reaches of its speed is not known.
        let speed = match self.backend.backend.resolve_on_host() {
            Backend::Wgpu => None,
            cpu => Some(speed(&cpu.device()?)),
        };
        let (examination, costs) = match load_scene(&self.scene, &options) {
            Ok(loaded) => (
                examine_loaded(&loaded, &options, &how),
                speed.map_or_else(Vec::new, |speed| costs(&loaded.scene, speed)),
            ),
            // It explains what cannot be read.
            Err(_) => (examine_folder(&self.scene, &options, &how), Vec::new()),
        };
        let text = match self.json {
            true => json(&examination, &costs)?,
            false => self.text(&examination, &costs),
        };
        output::print(&text)?;
        match examination.verdict {
            Verdict::Ready | Verdict::ReadyWithWarnings => Ok(()),
            Verdict::NotReady => Err(CliError::NotReady),
        }
    }

    fn text(&self, examination: &Examination, costs: &[Cost]) -> String {
        let mut text = examination.to_string();
        if !text.ends_with('\n') {
            text.push('\n');
        }
        if !costs.is_empty() {
            text.push_str("\ntraining, where it is asked for, on the CPU of this machine if it is idle, within a factor of two:\n");
        }
        for Cost { preset, estimate } in costs {
            let time = duration::display(estimate.seconds);
            let gib = estimate.bytes / 1024f64.powi(3);
            text.push_str(&format!("  --preset {preset:<18} {time}, {gib:.1} GiB\n"));
        }
        if examination.verdict != Verdict::NotReady {
            let scene = self.scene.display().to_string();
            let flags = self.scene_args.to_string();
            let quote = if scene.contains(' ') { "'" } else { "" };
            text.push_str(&format!(
                "\nneat reconstruct {quote}{scene}{quote} --out RUN{flags}\n"
            ));
        }
        text
    }
}

/// What every preset takes where a matrix product runs at `speed` GFLOP/s.
fn costs(scene: &Scene, speed: f64) -> Vec<Cost> {
    let cost = |preset: Preset| Cost {
        preset,
        estimate: estimate(&preset.config(), scene, speed),
    };
    Preset::ALL.map(cost).into()
}

fn json(examination: &Examination, costs: &[Cost]) -> Result<String, CliError> {
    let report = Report { examination, costs };
    serde_json::to_string_pretty(&report).map_err(|error| CliError::Output(error.into()))
}
