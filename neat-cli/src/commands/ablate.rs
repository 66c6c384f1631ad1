//! `neat ablate`.

use crate::arguments::{ComputeArgs, MethodArgs, positive};
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::progress::Progress;
use crate::scene_arguments::SceneArgs;
use crate::{interrupt, output};
use clap::Args;
use neat_core::ground_truth::read_wireframe;
use neat_core::ply::read_points;
use neat_eval::SceneTruth;
use neat_lab::ablate::table::to_markdown;
use neat_lab::ablate::{Truth, ablate};
use neat_pipeline::event::Event;
use neat_pipeline::reconstruct::RunOptions;
use neat_pipeline::run_dir::Existing;
use std::path::PathBuf;

/// Measure what each part of the method is worth on one scene
///
/// Reconstructs the scene as configured and then once for every variant of tables 2, 3 and 4
/// of the paper, without either kind of supervision, and with each step of the back end
/// switched off. OUT then holds a folder for every variant, and ablation.md and ablation.csv
/// with times, counts, precision and recall (with --gt or --truth), distances from a surface
/// (with --points or --truth), PSNR and the share of pixels that were not used.
///
/// After Ctrl-C the same command continues: finished variants are not trained again. A variant
/// that changes nothing in the configuration takes over the numbers of the first row, and one that
/// fails is a row with the reason (exit code 1).
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat ablate SCENE --out ABLATION --gt SCENE/gt_wireframe.json
  neat ablate SCENE --out ABLATION --truth SCENE --threshold 0.05
  neat ablate SCENE --out ABLATION --points scan.ply --preset paper-dtu --time-budget 2h")]
pub struct AblateArgs {
    /// Folder of the scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Folder for all variants and the tables: new, empty, or with what this ablation has left
    /// before
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
    /// True wireframe, for precision and recall
    #[arg(long, value_name = "FILE")]
    gt: Option<PathBuf>,
    /// Points on the true surface as PLY, for ACC-J and ACC-L
    #[arg(long, value_name = "FILE")]
    points: Option<PathBuf>,
    /// Rendered scene with its folder `truth`, for precision and recall by the length of
    /// creases, and for ACC-J and ACC-L
    #[arg(long, value_name = "SCENE", conflicts_with_all = ["gt", "points"])]
    truth: Option<PathBuf>,
    /// Distance within which junctions and segments count as found; of --truth times its scale
    #[arg(long, value_name = "D", value_parser = positive, default_value_t = 0.01)]
    threshold: f64,
    #[command(flatten)]
    method: MethodArgs,
    /// Seed of all randomness
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    compute: ComputeArgs,
    #[command(flatten)]
    cache: CacheArgs,
    #[command(flatten)]
    scene_args: SceneArgs,
}

impl AblateArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        let truth = Truth {
            wireframe: self.gt.as_deref().map(read_wireframe).transpose()?,
            surface: self.points.as_deref().map(read_points).transpose()?,
            rendered: self.truth.as_deref().map(SceneTruth::read).transpose()?,
            threshold: self.threshold,
        };
        let config = self.method.config()?;
        let config = self.scene_args.configure(config, &self.method)?;
        let options = RunOptions {
            scene: self.scene,
            out: self.out,
            existing: Existing::default(),
            config,
            preset: self.method.name(),
            backend: self.compute.backend.backend,
            seed: self.seed,
            time_budget: self.compute.time_budget,
            examine: false,
            cache: self.cache.open(),
            memory_limit: self.compute.memory.limit(),
            command_line: super::train::command_line(),
        };
        let interrupted = interrupt::flag()?;
        let mut progress = Progress::new(quiet);
        let rows = ablate(&options, &truth, &interrupted, &mut |event| {
            // One wireframe is not what was asked for.
            if !matches!(event, Event::FileWritten(_)) {
                progress.show(event);
            }
        })?;
        drop(progress);
        output::print(&to_markdown(&rows))?;
        match rows.iter().filter(|row| row.failed()).count() {
            0 => Ok(()),
            failed => Err(CliError::VariantsFailed {
                failed,
                all: rows.len(),
            }),
        }
    }
}
