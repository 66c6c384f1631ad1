//! The optimisation of one scene: all networks together, the terms of the loss, the
//! steps, and the trained field that they lead to.
//!
//! What a run is (folders, budgets, checkpoints on disk) is neat-pipeline's.

#![forbid(unsafe_code)]

mod awake;
mod checkpoint_metadata;
mod chunked_step;
pub mod config;
#[cfg(feature = "wgpu")]
mod device_sampling;
mod error;
mod field;
pub mod flops;
pub mod losses;
pub mod model;
mod sample_placement;
pub mod step_log;
mod surface_points;
pub mod trainer;
pub mod training_data;
mod validation;

pub use checkpoint_metadata::AVERAGE_LOSS;
pub use error::TrainError;
pub use field::{SurfaceGrid, TrainedField};
pub use trainer::Trainer;
