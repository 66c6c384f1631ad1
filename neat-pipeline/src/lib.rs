//! From a scene to its wireframe: training, distillation, run folders.
//!
//! Everything here reports through events and results; nothing draws.

#![forbid(unsafe_code)]

pub mod ablate;
pub mod background;
pub mod benchmark;
pub mod changes;
pub mod compare_backends;
pub mod config;
pub mod demo;
pub mod detection;
pub mod distill;
pub mod error;
pub mod estimate;
pub mod event;
pub mod image_io;
mod latents;
pub mod machine_memory;
pub mod manifest;
pub mod overlay;
pub mod overrides;
pub mod preset;
pub mod reconstruct;
pub mod render;
pub mod resources;
pub mod run_dir;
pub mod scene;
