//! Everything about a run that a person may choose, as one tree of plain structs.
//!
//! The tree is TOML on disk (`config.toml` of every run), starts from a preset,
//! and takes `--set key.path=value` on top. Unknown keys are errors. What it leaves to
//! the scene and the machine is settled by [`crate::plan::settle`].
//!
//! ```
//! use neat_pipeline::config::{Preset, apply_overrides};
//!
//! let config = apply_overrides(&Preset::Fast.config(), &["train.rays=512".to_owned()])?;
//! assert_eq!(config.train.rays, 512);
//! # Ok::<(), neat_pipeline::config::OverrideError>(())
//! ```

mod choice;
mod differences;
mod overrides;
mod preset;

pub use choice::Choice;
pub use overrides::{OverrideError, apply_overrides};
pub use preset::{Preset, UnknownPreset};

pub(crate) use differences::{Difference, differences};

use neat_core::SphereChoice;
use neat_core::layout::PoseConvention;
use neat_detect::DetectorConfig;
use neat_tensor::Kernels;
use neat_train::config::{ModelConfig, TrainConfig, TrainingConfig};
use neat_wireframe::assemble::AssembleConfig;
use neat_wireframe::confidence::ConfidenceConfig;
use neat_wireframe::paper::PaperBackEndConfig;
use serde::{Deserialize, Serialize};
use std::fmt;

/// All choices of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// How the scene is read.
    pub data: DataConfig,
    /// How 2D wireframes are detected in scenes that come without, and edgels in the
    /// images that the assembler looks at.
    #[serde(default)]
    pub detect: DetectorConfig,
    /// The networks.
    pub model: ModelConfig,
    /// The optimisation.
    pub train: TrainConfig,
    /// From the trained field, or the images, to the wireframe.
    pub distill: DistillConfig,
}

impl Config {
    /// What training needs of it, with the operations that it is to run.
    pub fn training(&self, kernels: Kernels) -> TrainingConfig {
        TrainingConfig {
            model: self.model.clone(),
            train: self.train.clone(),
            min_segment_score: self.data.min_segment_score,
            attraction_distance: self.data.attraction_distance,
            scene_radius: self.data.scene_radius,
            kernels,
        }
    }
}

/// How the scene is read and which part of space is modelled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataConfig {
    /// Where pixel (0, 0) has its centre: `auto` follows the camera file's
    /// convention, `integer` is what the published code does for every source.
    pub pixel_center: neat_core::layout::PixelCenter,
    /// 2D segments need a higher score than this (published: 0.05).
    pub min_segment_score: f64,
    /// Pixels nearer to a 2D segment than this belong to its attraction region
    /// (τ_d of the paper).
    pub attraction_distance: f64,
    /// What places the scene sphere: `auto`, `file`, `points`, `cameras`, `masks`,
    /// or `x,y,z,radius` in the frame of the files.
    #[serde(default)]
    pub scene_sphere: SphereChoice,
    /// What the poses really are, where they are not what their layout says.
    #[serde(default)]
    pub pose_convention: Option<PoseConvention>,
    /// Multiplies the focal lengths of the files.
    #[serde(default)]
    pub focal_scale: Option<f64>,
    /// Multiplies the intrinsics of the files, for images of another size.
    #[serde(default)]
    pub intrinsics_scale: Option<f64>,
    /// At most so many views are used, spread evenly over the order of the files.
    #[serde(default)]
    pub max_views: Option<usize>,
    /// Images with a longer side than this, in pixels, are scaled down.
    #[serde(default)]
    pub max_image_size: Option<u32>,
    /// What lies behind the object; `None` changes nothing, `auto` is told by the
    /// borders of the images.
    #[serde(default)]
    pub background: Option<Choice<Background>>,
    /// Radius of the modelled ball, in the unit of the poses. `None` takes that of
    /// the scene sphere and scales the world so that it is 1.
    pub scene_radius: Option<f64>,
}

/// What lies behind the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Background {
    /// Black: empty space has no colour, and silhouettes are known.
    Black,
    /// Anything: a photograph. The border of the scene sphere stands for all that
    /// is behind it, as in VolSDF, and there are no silhouettes.
    Photo,
}

impl fmt::Display for Background {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Black => "black",
            Self::Photo => "photo",
        })
    }
}

/// What assembles the wireframe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BackEnd {
    /// Section 4.3 of the paper.
    Paper,
    /// Lines that the 2D segments propose and the edgels of all images choose. The field has
    /// no part in it unless [`Partners::Field`] asks it.
    #[default]
    Assembler,
}

impl fmt::Display for BackEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Paper => "paper",
            Self::Assembler => "assembler",
        })
    }
}

/// Whether there is a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FieldUse {
    /// One is trained.
    Trained,
    /// None is: the images alone make the wireframe.
    None,
}

impl fmt::Display for FieldUse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Trained => "trained",
            Self::None => "none",
        })
    }
}

/// What says which 2D segments of two views may show one edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Partners {
    /// Epipolar geometry: all that the poses allow.
    #[default]
    Epipolar,
    /// The field: those whose rendered segments lie near each other in space.
    Field,
}

/// What a wireframe is drawn on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OverlayGround {
    /// The photograph.
    #[default]
    Photo,
    /// The 2D segments, for who may not pass photographs on.
    Segments,
}

/// From the trained field, or the images, to the wireframe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DistillConfig {
    /// What assembles the wireframe.
    #[serde(default)]
    pub back_end: BackEnd,
    /// Whether a field is trained; `auto`: only where something asks it. Without one
    /// there is nothing to render, and no mesh.
    #[serde(default)]
    pub field: Choice<FieldUse>,
    /// What says to the assembler which 2D segments of two views may show one edge.
    #[serde(default)]
    pub partners: Partners,
    /// What the wireframe is drawn on in `overlays/`.
    #[serde(default)]
    pub overlay: OverlayGround,
    /// What the results say about how sure they are.
    #[serde(default)]
    pub confidence: ConfidenceConfig,
    /// The paper's back end.
    pub paper: PaperBackEndConfig,
    /// The assembler.
    #[serde(default)]
    pub assembler: AssembleConfig,
}
