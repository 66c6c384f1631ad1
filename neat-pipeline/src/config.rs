//! Everything about a run that a person may choose, as one tree of plain structs.
//!
//! The tree is TOML on disk (`config.toml` of every run), starts from a preset,
//! and takes `--set key.path=value` on top. Unknown keys are errors.

use crate::background::Background;
use neat_core::SphereChoice;
use neat_core::layout::PoseConvention;
use neat_detect::DetectorConfig;
use neat_field::AttractionNetworkConfig;
use neat_gjp::{CandidateConfig, MatchingConfig, PerceiverConfig};
use neat_sdf::{DensityConfig, ImplicitNetworkConfig, RaySamplerConfig, RenderingNetworkConfig};
use neat_tensor::adam::AdamConfig;
use neat_wireframe::confidence::ConfidenceConfig;
use neat_wireframe::fast::FastBackEndConfig;
use neat_wireframe::line_tracks::LineTracksConfig;
use neat_wireframe::paper::PaperBackEndConfig;
use serde::{Deserialize, Serialize};

/// All choices of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// How the scene is read.
    pub data: DataConfig,
    /// How 2D wireframes are detected in scenes that come without.
    #[serde(default)]
    pub detect: DetectorConfig,
    /// The networks.
    pub model: ModelConfig,
    /// The optimisation.
    pub train: TrainConfig,
    /// From the trained field to the wireframe.
    pub distill: DistillConfig,
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
    /// What lies behind the object; `None` changes nothing.
    #[serde(default)]
    pub background: Option<Background>,
    /// Radius of the modelled ball, in the unit of the poses. `None` takes that of
    /// the scene sphere and scales the world so that it is 1.
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

/// Which back end turns the field into a wireframe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BackEnd {
    /// Section 4.3 of the paper.
    Paper,
    /// Junctions from modes of the segment ends, re-triangulated and adjusted: for
    /// single objects.
    Fast,
    /// Tracks of 2D segments over the views, with the field's segments as priors:
    /// for photographs with thousands of segments.
    Tracks,
    /// `Tracks` where `data.background` is a photograph, else `Fast`.
    Auto,
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

/// From the trained field to the wireframe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DistillConfig {
    /// Which of the two back ends runs.
    pub back_end: BackEnd,
    /// What the wireframe is drawn on in `overlays/`.
    #[serde(default)]
    pub overlay: OverlayGround,
    /// Rays of the fast back end along each 2D segment.
    pub rays_per_segment: usize,
    /// What the results say about how sure they are.
    #[serde(default)]
    pub confidence: ConfidenceConfig,
    /// The paper's back end.
    pub paper: PaperBackEndConfig,
    /// The fast back end.
    pub fast: FastBackEndConfig,
    /// The back end of line tracks.
    #[serde(default)]
    pub tracks: LineTracksConfig,
}
