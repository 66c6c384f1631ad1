//! The laboratory: what measures neat, outside the path of a run.
//!
//! - [`demo`]: a scene whose truth is known, reconstructed and measured;
//! - [`ablate`]: what each part of the method is worth, on one scene;
//! - [`benchmark`]: the parts of a training step against the machine's arithmetic;
//! - [`compare_backends`]: the same steps on every backend;
//! - [`estimate`]: what a training will take on this machine;
//! - [`line3d`]: the method of somebody else on the same 2D wireframes.
//!
//! Nothing that makes a wireframe for a person depends on this crate.
//!
//! ```
//! use neat_core::synthetic::{SyntheticScene, generate};
//! use neat_lab::estimate::estimate;
//! use neat_pipeline::config::Preset;
//!
//! let small = SyntheticScene { views: 2, image_size: 64, ..SyntheticScene::default() };
//! let scene = generate(&small)?.scene;
//! // Where a matrix product runs at 185 GFLOP/s.
//! let training = estimate(&Preset::Fast.config(), &scene, 185.0);
//! assert!(training.seconds > 1.0);
//! # Ok::<(), neat_core::synthetic::SyntheticError>(())
//! ```

#![forbid(unsafe_code)]

pub mod ablate;
pub mod benchmark;
pub mod compare_backends;
pub mod demo;
mod error;
pub mod estimate;
pub mod line3d;

pub use error::LabError;
