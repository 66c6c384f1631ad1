//! From segment proposals and junctions to a 3D wireframe graph.
//!
//! No learning framework: anything that proposes 3D segments can use this crate.

pub mod observation;
pub mod proposal;
pub mod signed_distance;

pub use neat_core::Wireframe3d;
pub use observation::ViewObservation;
pub use proposal::SegmentProposal;
pub use signed_distance::SignedDistance;
