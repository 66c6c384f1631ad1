//! Synthetic scenes with exact truth: CAD-like solids, their images and what a
//! detector would see in them.
//!
//! Every solid is a [`Frustum`], a profile of lines and arcs swept upwards, so that its signed
//! distance, its faces and its wireframe are exact. [`generate`] places cameras
//! around it, ray traces the images, cuts every edge into its visible parts and
//! imitates a wireframe detector (noise, misses, false segments). The same
//! configuration gives the same scene, for any number of threads.

mod detection;
mod frustum;
mod planar_face;
mod profile;
mod random;
mod rendering;
mod round_face;
mod scene;
mod solid;
mod true_faces;
mod viewpoints;
mod visible_edges;

pub use frustum::Frustum;
pub use planar_face::PlanarFace;
pub use rendering::render;
pub use round_face::RoundFace;
pub use scene::{
    SyntheticData, SyntheticError, SyntheticScene, ViewTruth, generate, generate_on_demand,
};
pub use solid::Solid;
pub use viewpoints::viewpoints;
pub use visible_edges::{VisiblePart, visible_parts};
