//! `neat convert`.

use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::output;
use crate::scene_arguments::SceneArgs;
use clap::{Args, ValueEnum};
use neat_core::convert::{SceneFormat, convert};
use neat_core::load_scene;
use neat_pipeline::resources::default_limit;
use std::path::PathBuf;

/// Write a scene in another format
///
/// Images are written as neat sees them: undistorted, and scaled down if asked for. Poses and
/// points are in the frame and unit of the scene's files; 2D wireframes come along.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat convert SCENE --to colmap --out COLMAP
  neat convert SCENE --to transforms-json --out NERFSTUDIO --max-image-size 1600")]
pub struct ConvertArgs {
    /// Folder of the scene, in any format that `neat info` lists
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Format to write
    #[arg(long, value_name = "FORMAT")]
    to: Format,
    /// Folder to write; it must be new or empty
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
    #[command(flatten)]
    cache: CacheArgs,
    #[command(flatten)]
    scene_args: SceneArgs,
}

/// A format of scenes.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// COLMAP text: images/, sparse/0/{cameras,images,points3D}.txt
    Colmap,
    /// IDR, VolSDF and NeuS: image/, cameras.npz with world_mat and scale_mat
    CamerasNpz,
    /// nerfstudio: images/, transforms.json
    TransformsJson,
    /// The published code's ABC objects: images/, cameras.npz with intrinsics and extrinsics
    Abc,
}

impl From<Format> for SceneFormat {
    fn from(format: Format) -> Self {
        match format {
            Format::Colmap => Self::Colmap,
            Format::CamerasNpz => Self::CamerasNpz,
            Format::TransformsJson => Self::TransformsJson,
            Format::Abc => Self::Abc,
        }
    }
}

impl ConvertArgs {
    pub fn run(self) -> Result<(), CliError> {
        let options = (self.scene_args).load_options(self.cache.open().as_ref(), default_limit());
        let loaded = load_scene(&self.scene, &options)?;
        for warning in &loaded.warnings {
            output::warning(&warning.to_string());
        }
        convert(&loaded.scene, self.to.into(), &self.out)?;
        let views = loaded.scene.views.len();
        output::print(&format!("{views} views: {}", self.out.display()))
    }
}
