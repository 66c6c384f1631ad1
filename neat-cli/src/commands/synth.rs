//! `neat synth`, and the arguments that it shares with `neat demo`.

use crate::error::CliError;
use crate::output;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use neat_core::ground_truth::GroundTruth;
use neat_core::synthetic::{Solid, SyntheticScene};
use neat_lab::demo::{GROUND_TRUTH, synthesise};
use std::path::PathBuf;

/// Write a synthetic scene with its true wireframe
///
/// SCENE then holds images/, hawp/ (what a detector would see), cameras.npz and
/// gt_wireframe.json, in the layout of the published ABC objects. Solids with arcs have
/// them among the true curves; the imitated detector sees straight edges only.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat synth --out SCENE
  neat synth --out SCENE --solid stair-prism --views 30 --image-size 256
  neat synth --out SCENE --solid drilled-plate                               lines, arcs and holes
  neat synth --out SCENE --noise 0 --detection-rate 1 --false-segments 0    a perfect detector")]
pub struct SynthArgs {
    /// Folder for the scene; it must be new or empty
    #[arg(long, value_name = "SCENE")]
    out: PathBuf,
    #[command(flatten)]
    scene: SceneArgs,
    /// Seed of all randomness
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
}

/// A synthetic scene.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// The object
    #[arg(long, value_name = "NAME", default_value = Solid::default().name(), value_parser = solid_parser())]
    solid: Solid,
    /// Number of images
    #[arg(long, value_name = "N", default_value_t = SyntheticScene::default().views)]
    views: usize,
    /// Width of the images, in pixels, and their height unless --image-height is given
    #[arg(long, value_name = "N", default_value_t = SyntheticScene::default().image_size)]
    image_size: u32,
    /// Height of the images, in pixels, where they are not square
    #[arg(long, value_name = "N")]
    image_height: Option<u32>,
    /// Distance of the cameras; the object has about unit size
    #[arg(long, value_name = "D", default_value_t = SyntheticScene::default().camera_distance)]
    distance: f64,
    /// Standard deviation of the ends of detected segments, in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = SyntheticScene::default().noise_in_pixels)]
    noise: f64,
    /// Share of the visible edges that are detected
    #[arg(long, value_name = "SHARE", default_value_t = SyntheticScene::default().detection_rate)]
    detection_rate: f64,
    /// Detected segments per image that are no edge
    #[arg(long, value_name = "N", default_value_t = SyntheticScene::default().false_segments)]
    false_segments: usize,
}

impl SceneArgs {
    /// The configuration of the scene.
    pub fn config(&self, seed: u64) -> SyntheticScene {
        SyntheticScene {
            solid: self.solid,
            views: self.views,
            image_size: self.image_size,
            image_height: self.image_height,
            camera_distance: self.distance,
            seed,
            noise_in_pixels: self.noise,
            detection_rate: self.detection_rate,
            false_segments: self.false_segments,
            ..SyntheticScene::default()
        }
    }
}

fn solid_parser() -> impl TypedValueParser<Value = Solid> {
    PossibleValuesParser::new(Solid::ALL.map(Solid::name)).try_map(|name| {
        let solid = Solid::ALL.into_iter().find(|solid| solid.name() == name);
        solid.ok_or("no such solid")
    })
}

impl SynthArgs {
    pub fn run(self) -> Result<(), CliError> {
        let config = self.scene.config(self.seed);
        let GroundTruth { wireframe, curves } = synthesise(&config, &self.out)?;
        let curves = match curves.len() {
            0 => String::new(),
            count => format!(", {count} curves"),
        };
        output::print(&format!(
            "{} with {} junctions and {} edges{curves} in {} views: {}\ntrue wireframe: {}",
            config.solid.name(),
            wireframe.junctions.len(),
            wireframe.edges.len(),
            config.views,
            self.out.display(),
            self.out.join(GROUND_TRUTH).display(),
        ))
    }
}
