//! From posed views with 2D segments to a 3D wireframe graph that says how sure it is. No
//! learning framework: what a field renders comes in as numbers, where one is used.
//!
//! | to | see |
//! | --- | --- |
//! | build a graph from 2D segments and edgels | [`mod@assemble`] |
//! | build one as the paper does, from what a field renders | [`paper`] |
//! | move the junctions of a graph until its edges lie on detections | [`bundle_adjustment`] |
//! | learn how sure each junction and edge is, and which 2D segments say so | [`confidence`] |
//! | tell creases from paint and shadows, pieces of curves, and corners from ends | [`kinds`] |
//! | read lengths, distances and angles off one, with intervals | [`dimensions`] |
//! | find planes, cylinders and the solids that they bound | [`faces`] |
//! | measure a wireframe, with and without ground truth | [`metrics`] |
//! | write and read one | [`export`], [`validity`] |
//!
//! # Example
//! ```
//! use neat_core::synthetic::{SyntheticScene, generate};
//! use neat_wireframe::ViewObservation;
//! use neat_wireframe::confidence::{ConfidenceConfig, assess};
//! use neat_wireframe::assemble::{AssembleConfig, assemble};
//!
//! let scene = SyntheticScene { views: 12, image_size: 256, ..Default::default() };
//! let views = ViewObservation::from_scene(&generate(&scene)?.scene, 0.05);
//! let built = assemble(&views, &[], 1.0, &AssembleConfig::default());
//! let confidence = assess(&built.wireframe, &views, None, 1.0, &ConfidenceConfig::default())?;
//! assert!(confidence.edges.iter().any(|edge| edge.probability > 0.7));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod assemble;
pub mod bundle_adjustment;
pub mod confidence;
pub mod dimensions;
pub mod export;
pub mod faces;
pub mod kinds;
pub mod metrics;
pub mod paper;
pub mod projection;
pub mod validity;

mod interval_cover;
mod observation;
mod point_index;
mod segment_grid;
mod signed_distance;
mod solve;
mod statistics;
mod used_junctions;

pub use neat_core::Wireframe3d;
pub use observation::ViewObservation;
pub use signed_distance::SignedDistance;

#[cfg(test)]
mod test_scenes;
#[cfg(test)]
mod test_support;
