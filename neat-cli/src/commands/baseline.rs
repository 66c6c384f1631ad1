//! `neat baseline`.

use super::reconstruct::in_words;
use crate::arguments::MethodArgs;
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use crate::scene_arguments::SceneArgs;
use clap::{Args, Subcommand};
use neat_lab::line3d::reconstruct_line3d;
use neat_pipeline::resources::{Resources, default_limit};
use neat_wireframe::assemble::Line3dConfig;
use std::path::PathBuf;

/// Reconstruct with the method of somebody else, on the same 2D wireframes
#[derive(Debug, Args)]
pub struct BaselineArgs {
    #[command(subcommand)]
    method: Method,
}

#[derive(Debug, Subcommand)]
enum Method {
    Line3d(Line3dArgs),
}

impl BaselineArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        match self.method {
            Method::Line3d(args) => args.run(quiet),
        }
    }
}

/// 3D segments by matching 2D segments over neighbouring views (Line3D++), without training
///
/// Segments share no junctions. OUT then holds them as wireframe.json, .obj and .ply, in the
/// frame of the scene's files, to be measured with `neat eval` like any result.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat baseline line3d SCENE --out OUT
  neat baseline line3d SCENE --out OUT --clustering-scale 1")]
struct Line3dArgs {
    /// Folder of the scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Folder for the results; files of these names in it are replaced
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
    /// Views that must show a segment
    #[arg(long, value_name = "N", default_value_t = Line3dConfig::default().min_views as u64, value_parser = clap::value_parser!(u64).range(2..))]
    min_views: u64,
    /// Scale of the affinity graph's edge weights: how easily clusters merge; the published
    /// program has 3
    #[arg(long, value_name = "C", default_value_t = Line3dConfig::default().clustering_scale, value_parser = crate::arguments::positive)]
    clustering_scale: f64,
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    cache: CacheArgs,
    #[command(flatten)]
    scene_args: SceneArgs,
}

impl Line3dArgs {
    fn run(self, quiet: bool) -> Result<(), CliError> {
        let config = self.method.config()?;
        let config = self.scene_args.configure(config, &self.method)?;
        let line3d_config = Line3dConfig {
            min_views: usize::try_from(self.min_views).unwrap_or(usize::MAX),
            clustering_scale: self.clustering_scale,
            ..Line3dConfig::default()
        };
        let mut progress = Progress::new(quiet);
        let result = reconstruct_line3d(
            &self.scene,
            &self.out,
            &config,
            &line3d_config,
            Resources {
                cache: self.cache.open().as_ref(),
                memory_limit: default_limit(),
                ..Resources::default()
            },
            &mut |event| progress.show(event),
        )?;
        drop(progress);
        let agreement = result.agreement.as_ref().map_or_else(String::new, in_words);
        output::print(&format!(
            "line3d: {} segments in {:.1} s{agreement}: {}",
            result.segments,
            result.seconds,
            result.file.display()
        ))
    }
}
