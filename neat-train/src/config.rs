//! What a person may choose about networks and their optimisation, as plain structs.
//!
//! Unknown keys are errors.

use crate::flops::StepRows;
pub use crate::losses::{EikonalConfig, LossConfig};
pub use crate::model::ModelConfig;
use neat_gjp::{CandidateConfig, MatchingConfig};
use neat_sdf::RaySamplerConfig;
use neat_sdf::ray_sampler::ErrorBoundConfig;
use neat_tensor::Kernels;
use neat_tensor::adam::AdamConfig;
use serde::{Deserialize, Serialize};

/// Everything that a trainer is made by, but for scene, seed and device.
#[derive(Clone, Debug)]
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
    /// Which operations networks and optimiser run, in how much memory.
    pub kernels: Kernels,
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
    /// Before the training, points on surfaces are found by matching the photographs (crate
    /// `neat-stereo`) and join the sparse points.
    #[serde(default)]
    pub dense_points: bool,
    /// Points with a normal also speak for what lies off the surface: they are moved along it
    /// by up to so much (world), to either side, where the distance should be as much.
    #[serde(default)]
    pub surface_point_reach: f64,
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
    /// Learning rate of the tables of learned grids, as a multiple of that of the networks:
    /// of an entry only the points in a few cells speak.
    #[serde(default = "default_grid_learning_rate")]
    pub grid_learning_rate: f64,
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
    /// So many of the last checkpoints stay on disk: one to continue from, and others in case
    /// that it turns out to be damaged.
    #[serde(default = "default_kept_checkpoints")]
    pub kept_checkpoints: usize,
}

fn default_grid_learning_rate() -> f64 {
    1.0
}

fn default_checkpoint_seconds() -> f64 {
    120.0
}

fn default_kept_checkpoints() -> usize {
    2
}

impl Default for TrainConfig {
    /// As published for ABC.
    fn default() -> Self {
        Self {
            steps: 200_000,
            rays: 1024,
            ray_chunk: None,
            background_share: 0.0,
            views: BatchViews::One,
            with_replacement: true,
            sampler: RaySamplerConfig::ErrorBound(ErrorBoundConfig::default()),
            min_sample_weight: None,
            eikonal: EikonalConfig::default(),
            surface_points: 0,
            dense_points: false,
            surface_point_reach: 0.0,
            loss: LossConfig::default(),
            candidates: CandidateConfig::published(),
            only_counted_ends: false,
            matching: MatchingConfig::published(),
            junction_interval: 1,
            adam: AdamConfig::default(),
            learning_rate: 5e-4,
            grid_learning_rate: default_grid_learning_rate(),
            junction_learning_rate: 5e-4,
            learning_rate_decay: 0.1,
            warm_up_steps: 0,
            checkpoint_interval: 5000,
            checkpoint_seconds: default_checkpoint_seconds(),
            kept_checkpoints: default_kept_checkpoints(),
        }
    }
}

impl Default for TrainingConfig {
    /// As published for ABC.
    fn default() -> Self {
        Self {
            model: ModelConfig::default(),
            train: TrainConfig::default(),
            min_segment_score: 0.05,
            attraction_distance: 10.0,
            scene_radius: Some(3.0),
            kernels: Kernels::default(),
        }
    }
}

impl TrainConfig {
    /// Gradients that the eikonal term is the mean over.
    pub(crate) fn eikonal_rows(&self, rows: &StepRows) -> usize {
        if self.eikonal.rendered_samples {
            rows.eikonal + rows.full
        } else {
            rows.eikonal
        }
    }

    /// Factor on the learning rates in iteration `iteration` (counted from 0), when
    /// the share `schedule` of the run is done: warm-up times exponential decay.
    pub fn learning_rate_factor(&self, iteration: u64, schedule: f64) -> f64 {
        let warm_up = match self.warm_up_steps {
            0 => 1.0,
            steps => ((iteration + 1) as f64 / steps as f64).min(1.0),
        };
        warm_up * self.learning_rate_decay.powf(schedule)
    }
}
