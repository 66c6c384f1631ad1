//! Cameras, line segments, 2D wireframes and posed scenes.
//!
//! Everything here is plain `f64` geometry on [`nalgebra`] types: no learning
//! framework, so any program can embed it.
//!
//! ```
//! use neat_core::synthetic::{SyntheticScene, generate};
//! use neat_core::{LoadOptions, layout, load_scene};
//!
//! // A solid with exact truth, seen by four cameras …
//! let config = SyntheticScene { views: 4, image_size: 64, ..SyntheticScene::default() };
//! let data = generate(&config)?;
//! // … written as files, and read back as any scene is, in whatever layout.
//! let dir = tempfile::tempdir()?;
//! layout::abc::write_scene(&data.scene, dir.path())?;
//! let loaded = load_scene(dir.path(), &LoadOptions::default())?;
//! for view in &loaded.scene.views {
//!     let junction = view.camera.project(&data.truth.junctions[0]);
//!     println!("{}: {} segments, {}", view.name, view.wireframe.edges.len(), junction.pixel);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | where | what |
//! | --- | --- |
//! | [`Camera`], [`Intrinsics`], [`Distortion`], [`Undistortion`], [`Downscaling`] | from a point in space to a pixel of a photograph, and to one of an image without a lens |
//! | [`LineSegment`], [`Wireframe2d`], [`Wireframe3d`] | what is found in images, and what is sought |
//! | [`Scene`], [`View`], [`ViewImage`], [`SparsePoint`], [`SceneSphere`] | posed images in one world |
//! | [`load_scene`], [`LoadOptions`], [`layout`] | a folder → a scene; one file for each of eleven layouts |
//! | [`mod@convert`] | a scene → files for other programs |
//! | [`hawp_json`], [`ground_truth`], [`npz`], [`ply`], [`image_file`] | single files |
//! | [`mod@file`], [`file_cache`], [`MemoryLimit`] | whole files or none, results kept, bounded memory |
//! | [`synthetic`] | scenes with exact truth |
//! | [`assignment`] | the matching of least cost |
//! | [`SceneError`], [`with_causes`] | what can be wrong, with file, view and remedy |
//!
//! Conventions (all of neat):
//! - OpenCV camera axes: +X right, +Y down, +Z forward.
//! - *Image coordinates* are the coordinates that the intrinsics speak of. A
//!   pixel with integer index `(column, row)` has its centre at
//!   `(column, row) + pixel_center`, where [`Scene::pixel_center`] is 0 or 0.5.
//!   2D wireframes are stored in image coordinates.
//! - *Calibrated* means image coordinates after `K⁻¹`, on the plane z = 1.
//! - *World* is the frame of a scene's cameras; [`Scene::original_from_world`]
//!   leads back to the frame of the user's files.
//!
//! [`load_scene`] tells through `tracing` what it chose: `NEAT_LOG=neat_core=debug`.

#![forbid(unsafe_code)]

pub mod assignment;
#[cfg(test)]
mod awkward_array;
mod camera;
mod circular_arc;
pub mod convert;
mod distortion;
mod dome;
mod downscaling;
mod edgel;
mod error;
mod extent;
pub mod file;
pub mod file_cache;
pub mod ground_truth;
pub mod hawp_json;
pub mod image_file;
pub mod layout;
mod line_segment;
mod memory_limit;
#[cfg(test)]
mod mutation;
pub mod npz;
pub mod ply;
mod scene;
mod scene_sphere;
mod shared_sight;
mod spline;
pub mod synthetic;
mod undistortion;
mod view_image;
mod view_name;
mod visual_hull;
mod wireframe2d;
mod wireframe3d;

pub use camera::{Camera, CameraError, Intrinsics, Projection, Ray};
pub use circular_arc::CircularArc;
pub use distortion::Distortion;
pub use dome::Dome;
pub use downscaling::Downscaling;
pub use edgel::{Edgel, EdgelMap};
pub use error::{SceneError, ViewError, with_causes};
pub use extent::extent_of_most;
pub use layout::{LoadOptions, LoadedScene, load_scene};
pub use line_segment::{LineSegment, LineSegment2, LineSegment3};
pub use memory_limit::MemoryLimit;
pub use scene::{Observation, Scene, Similarity, SparsePoint, View};
pub use scene_sphere::{SceneSphere, SphereChoice, SphereSource, UnknownSphere};
pub use shared_sight::{neighbours, points_in_ball};
pub use spline::Spline;
pub use undistortion::Undistortion;
pub use view_image::{ImageStore, ViewImage};
pub use wireframe2d::{ScoredSegment2, Wireframe2d, Wireframe2dError};
pub use wireframe3d::Wireframe3d;
