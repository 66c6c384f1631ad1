//! The optimisation of one scene: all networks together, the terms of the loss, the
//! steps, and the trained field that they lead to.
//!
//! What a run is (folders, budgets, checkpoints on disk) is neat-pipeline's.
//!
//! ```
//! use neat_train::LOSS_TERMS;
//! use neat_train::config::TrainingConfig;
//!
//! // As published; the terms of the loss and their weights are one table.
//! let config = TrainingConfig::default();
//! config.validate()?;
//! let weights = LOSS_TERMS.map(|term| (term.name, (term.weight)(&config.train.loss)));
//! assert!(weights.contains(&("segment", 0.01)));
//! # Ok::<(), neat_train::TrainError>(())
//! ```
//!
//! `examples/train_step.rs` takes a step on what is made in memory.

#![forbid(unsafe_code)]

mod awake;
pub mod batch;
mod checkpoint_metadata;
pub mod config;
mod device_sampling;
mod error;
mod field;
pub mod flops;
pub mod losses;
pub mod model;
mod selection;
mod step;
pub mod step_log;
mod surface_points;
pub mod trainer;
mod training_data;
mod validation;

pub use error::TrainError;
pub use field::{SurfaceGrid, TrainedField};
pub use losses::{LOSS_TERMS, StepInput};
pub use step::{StepLoss, StepTimings, step_loss};
pub use surface_points::{KnownDistance, OrientedPoint};
pub use trainer::Trainer;
