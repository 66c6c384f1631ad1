//! What a person may choose about networks and their optimisation, as plain structs.
//!
//! Unknown keys are errors.

use neat_field::AttractionNetworkConfig;
use neat_gjp::{CandidateConfig, MatchingConfig, PerceiverConfig};
use neat_sdf::{DensityConfig, ImplicitNetworkConfig, RaySamplerConfig, RenderingNetworkConfig};
use neat_tensor::adam::AdamConfig;
use serde::{Deserialize, Serialize};

/// Everything that a trainer is made by, but for scene, seed and device.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingConfig {
    /// The networks.
    pub model: ModelConfig,
    /// The optimisation.
    pub train: TrainConfig,
    /// 2D segments need a higher score than this.
    pub min_segment_score: f64,
    /// Pixels nearer to a 2D segment than this belong to its attraction region.
    pub attraction_distance: f64,
    /// Radius of the modelled ball; `None` takes that of the scene sphere.
    pub scene_radius: Option<f64>,
}

/// The networks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelConfig {
    /// Signed distance and features.
    pub implicit: ImplicitNetworkConfig,
    /// Radiance.
    pub rendering: RenderingNetworkConfig,
    /// 3D segments.
    pub attraction: AttractionNetworkConfig,
    /// From signed distance to density.
    pub density: DensityConfig,
    /// Global junctions.
    pub perceiver: PerceiverConfig,
}

/// Which views one batch of rays comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BatchViews {
    /// One view per iteration, every view once per epoch, as published.
    One,
    /// Pixels drawn uniformly from all views.
    All,
}

/// The optimisation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// Number of iterations. The learning rate and β schedules span them.
    pub steps: u64,
    /// Rays per iteration.
    pub rays: usize,
    /// Rays per pass. A batch of more is taken in several passes, with the same
    /// gradients in less memory and a third more time; `None` takes all at once.
    #[serde(default)]
    pub ray_chunk: Option<usize>,
    /// Share of the rays that go through any pixel, not only attraction regions.
    pub background_share: f64,
    /// Which views the rays of one iteration come from.
    pub views: BatchViews,
    /// Whether a pixel may be drawn twice in a batch from one view (published:
    /// yes for ABC, no for DTU and BlendedMVS).
    pub with_replacement: bool,
    /// Where samples lie along a ray.
    pub sampler: RaySamplerConfig,
    /// Radiance, attraction and gradients are evaluated only at samples whose
    /// rendering weight exceeds this; `None` evaluates all, as published.
    pub min_sample_weight: Option<f64>,
    /// The eikonal points.
    pub eikonal: EikonalConfig,
    /// Sparse points of the scene per iteration at which the distance should be 0;
    /// a scene without sparse points has no such term.
    #[serde(default)]
    pub surface_points: usize,
    /// Weights of the loss terms.
    pub loss: LossConfig,
    /// How rendered end points become targets of the global junctions.
    pub candidates: CandidateConfig,
    /// Only rays that count in the segment term suggest junctions.
    pub only_counted_ends: bool,
    /// How targets and global junctions are paired.
    pub matching: MatchingConfig,
    /// The junction losses are taken in every so many iterations.
    pub junction_interval: u64,
    /// Decay rates of Adam.
    pub adam: AdamConfig,
    /// Learning rate of the networks at the start.
    pub learning_rate: f64,
    /// Learning rate of the junction latents and their decoder at the start.
    pub junction_learning_rate: f64,
    /// Factor by which the learning rates fall, exponentially, over all steps.
    pub learning_rate_decay: f64,
    /// The learning rate grows linearly over so many first steps.
    pub warm_up_steps: u64,
    /// A checkpoint is written every so many steps (and at the end).
    pub checkpoint_interval: u64,
    /// A checkpoint is also written after so many seconds without one.
    #[serde(default = "default_checkpoint_seconds")]
    pub checkpoint_seconds: f64,
    /// So many of the last checkpoints stay on disk, besides the one with the smallest
    /// loss: one to continue from, and others in case that it turns out to be damaged.
    #[serde(default = "default_kept_checkpoints")]
    pub kept_checkpoints: usize,
}

fn default_checkpoint_seconds() -> f64 {
    120.0
}

fn default_kept_checkpoints() -> usize {
    2
}

/// Where the eikonal term samples the gradient.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EikonalConfig {
    /// Points drawn uniformly in the cube around the scene ball; `None` draws as
    /// many as there are rays, as published.
    pub uniform_points: Option<usize>,
    /// One random sample of every ray is added, as published.
    pub one_sample_per_ray: bool,
    /// All samples that are rendered are added.
    pub rendered_samples: bool,
}

/// Weights of the loss terms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossConfig {
    /// Colour, L1.
    pub rgb: f64,
    /// Eikonal term.
    pub eikonal: f64,
    /// Cross entropy of the accumulated weight against the silhouette of images
    /// on a black background.
    pub mask: f64,
    /// 3D segments, calibrated L1.
    pub segment: f64,
    /// 3D distance of matched junctions.
    pub junction_3d: f64,
    /// Distance of their projections (calibrated).
    pub junction_2d: f64,
    /// Distance of the surface from sparse points of the scene, in the world.
    #[serde(default)]
    pub points: f64,
    /// Rays whose segment misses its 2D segment by this many pixels or more do
    /// not count.
    pub segment_cutoff_in_pixels: f64,
    /// Rays whose accumulated weight is not above this do not count in the
    /// segment term; `None` counts all, as published.
    pub segment_min_opacity: Option<f64>,
    /// Divides the segment term by all rays, as published, instead of by those
    /// that count.
    pub segment_mean_over_all_rays: bool,
}
