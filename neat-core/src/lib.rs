//! Cameras, line segments, 2D wireframes and posed scenes.
//!
//! Everything here is plain `f64` geometry on [`nalgebra`] types: no learning
//! framework, so any program can embed it.
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

#![forbid(unsafe_code)]

pub mod assignment;
#[cfg(test)]
mod awkward_array;
mod camera;
pub mod convert;
mod distortion;
mod downscaling;
mod error;
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
pub mod synthetic;
mod undistortion;
mod view_image;
mod view_name;
mod wireframe2d;
mod wireframe3d;

pub use camera::{Camera, CameraError, Intrinsics, Projection, Ray};
pub use distortion::Distortion;
pub use downscaling::Downscaling;
pub use error::{SceneError, ViewError, with_causes};
pub use layout::{LoadOptions, LoadedScene, load_scene};
pub use line_segment::{LineSegment, LineSegment2, LineSegment3};
pub use memory_limit::MemoryLimit;
pub use scene::{Observation, Scene, Similarity, SparsePoint, View};
pub use scene_sphere::{SceneSphere, SphereChoice, SphereSource, UnknownSphere};
pub use undistortion::Undistortion;
pub use view_image::{ImageStore, ViewImage};
pub use wireframe2d::{ScoredSegment2, Wireframe2d, Wireframe2dError};
pub use wireframe3d::Wireframe3d;
