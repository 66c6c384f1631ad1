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

mod differences;
mod overrides;
mod preset;

pub use neat_detect::LineDetector;
pub use neat_images::config::{Background, Choice, DataConfig};
pub use overrides::{OverrideError, apply_overrides, contradicted};
pub use preset::{Preset, UnknownPreset};

pub(crate) use differences::{Difference, differences};

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
