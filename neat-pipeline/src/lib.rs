//! From a scene to its wireframe: what a run is, in a folder of its own.
//!
//! A run reads a scene ([`scene`]), detects 2D wireframes where there are none
//! ([`detection`]), settles what its configuration leaves open ([`config`], [`plan`]),
//! trains (the crate `neat-train`), takes the wireframe out of the field ([`distill`]) and
//! writes all results ([`reconstruct`], [`run_dir`]). It reports through events ([`event`])
//! and results; nothing here draws on a terminal.
//!
//! ```no_run
//! use neat_core::MemoryLimit;
//! use neat_pipeline::config::Preset;
//! use neat_pipeline::reconstruct::{RunOptions, reconstruct};
//! use neat_pipeline::run_dir::Existing;
//! use neat_tensor::Backend;
//! use std::sync::atomic::AtomicBool;
//!
//! let options = RunOptions {
//!     scene: "SCENE".into(),
//!     out: "RUN".into(),
//!     existing: Existing::Refuse,
//!     config: Preset::Fast.config(),
//!     preset: "fast".to_owned(),
//!     backend: Backend::Auto,
//!     seed: 0,
//!     time_budget: None,
//!     examine: true,
//!     cache: None,
//!     memory_limit: MemoryLimit::NONE,
//!     command_line: Vec::new(),
//! };
//! let cancelled = AtomicBool::new(false);
//! let result = reconstruct(&options, &cancelled, &mut |event| println!("{event:?}"))?;
//! println!("{} edges", result.wireframe.edges.len());
//! # Ok::<(), neat_pipeline::error::PipelineError>(())
//! ```

#![forbid(unsafe_code)]

pub use neat_images::detection;

mod changes;
pub mod config;
pub mod distill;
pub mod error;
pub mod event;
pub mod manifest;
pub mod plan;
pub mod reconstruct;
pub mod render;
pub mod resources;
pub mod run_dir;
pub mod scene;
