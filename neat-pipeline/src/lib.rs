//! From a scene to its wireframe: training, distillation, run folders.
//!
//! Everything here reports through events and results; nothing draws.

#![forbid(unsafe_code)]

pub mod ablate;
mod awake;
pub mod background;
pub mod benchmark;
pub mod changes;
mod chunked_step;
pub mod compare_backends;
pub mod config;
pub mod demo;
pub mod detection;
#[cfg(feature = "wgpu")]
mod device_sampling;
pub mod distill;
pub mod error;
pub mod estimate;
pub mod event;
pub mod field;
pub mod flops;
pub mod image_io;
mod latents;
pub mod losses;
pub mod machine_memory;
pub mod manifest;
pub mod model;
pub mod overlay;
pub mod overrides;
pub mod preset;
pub mod reconstruct;
pub mod render;
pub mod resources;
pub mod run_dir;
mod sample_placement;
pub mod scene;
pub mod step_log;
mod surface_points;
pub mod trainer;
pub mod training_data;
mod validation;
