//! From segment proposals and junctions to a 3D wireframe graph.
//!
//! No learning framework: anything that proposes 3D segments can use this crate.

pub mod attraction;
pub mod distance_matrix;
pub mod export;
pub mod junction_refinement;
pub mod junction_voting;
pub mod metrics;
pub mod neat_lines;
pub mod observation;
pub mod paper_back_end;
pub mod proposal;
pub mod signed_distance;
pub mod validity;
pub mod visibility;

pub use neat_core::Wireframe3d;
pub use observation::ViewObservation;
pub use proposal::SegmentProposal;
pub use signed_distance::SignedDistance;

#[cfg(test)]
mod test_support;
