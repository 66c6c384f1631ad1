//! `neat baseline`.

use super::reconstruct::in_words;
use crate::arguments::MethodArgs;
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use crate::scene_arguments::SceneArgs;
use clap::{Args, Subcommand};
use neat_core::file;
use neat_pipeline::distill::agreement;
use neat_pipeline::machine_memory::default_limit;
use neat_pipeline::resources::Resources;
use neat_pipeline::scene::prepare_scene;
use neat_wireframe::ViewObservation;
use neat_wireframe::export::{ExportError, WireframeDocument, write_json, write_obj, write_ply};
use neat_wireframe::line_tracks::{Line3dConfig, line3d, wireframe_of_segments};
use std::path::PathBuf;
use std::time::Instant;

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
        let mut config = self.method.config()?;
        config.data = self.scene_args.apply(config.data);
        let mut progress = Progress::new(quiet);
        let cache = self.cache.open();
        let prepared = prepare_scene(
            &self.scene,
            &mut config,
            None,
            Resources {
                cache: cache.as_ref(),
                memory_limit: default_limit(),
                ..Resources::default()
            },
            &mut |event| {
                progress.show(event);
            },
        )?;
        drop(progress);
        let scene = &prepared.scene;
        let observations = ViewObservation::from_scene(scene, config.data.min_segment_score);
        let line3d_config = Line3dConfig {
            min_views: usize::try_from(self.min_views).unwrap_or(usize::MAX),
            clustering_scale: self.clustering_scale,
            ..Line3dConfig::default()
        };
        let start = Instant::now();
        let segments = line3d(&observations, scene.sphere_radius, &line3d_config);
        let seconds = start.elapsed().as_secs_f64();

        let in_world = wireframe_of_segments(&segments);
        let wireframe = in_world.map(|point| scene.original_from_world.apply(point));
        let mut document = WireframeDocument::from(&wireframe);
        document.metadata.insert("method".into(), "line3d".into());
        document
            .metadata
            .insert("scene".into(), scene.name.clone().into());
        document.views = scene.views.iter().map(|view| view.name.clone()).collect();
        let views = segments.iter().map(|segment| segment.views as f64);
        document
            .edge_fields
            .insert("supporting_views".into(), views.collect());
        file::create_dir(&self.out)?;
        let path = |extension: &str| self.out.join("wireframe").with_extension(extension);
        write_json(&path("json"), &document).map_err(failed)?;
        write_obj(&path("obj"), &wireframe).map_err(failed)?;
        write_ply(&path("ply"), &wireframe).map_err(failed)?;
        let mut text = format!("line3d: {} segments in {seconds:.1} s", segments.len());
        if let Some(agreement) = agreement(scene, &config, &in_world) {
            text += &in_words(&agreement);
        }
        output::print(&format!("{text}: {}", path("json").display()))
    }
}

fn failed(error: ExportError) -> CliError {
    CliError::Export(error.into())
}
