//! From segment proposals and junctions to a 3D wireframe graph.
//!
//! No learning framework: anything that proposes 3D segments can use this crate.

#![forbid(unsafe_code)]

pub mod attraction;
pub mod attraction_hypotheses;
pub mod bundle_adjustment;
pub mod cleanup;
pub mod confidence;
pub mod curved_rims;
pub mod distance_matrix;
pub mod edge_completion;
pub mod edge_support;
pub mod exclusive_support;
pub mod export;
pub mod fast_back_end;
pub mod junction_modes;
pub mod junction_refinement;
pub mod junction_splitting;
pub mod junction_voting;
pub mod line_tracks;
pub mod metrics;
pub mod neat_lines;
pub mod normal_equations;
pub mod observation;
pub mod occlusion;
pub mod paper_back_end;
pub mod projection;
pub mod proposal;
pub mod regularities;
pub mod robust_segments;
pub mod segment_ends;
pub mod segment_matching;
pub mod signed_distance;
pub mod step_report;
pub mod supported_truth;
pub mod touching_edges;
pub mod triangulation;
pub mod validity;
pub mod visibility;

mod alignments;
mod block_cholesky;
mod disjoint_sets;
mod evidence;
mod interval_cover;
mod point_grid;
mod point_index;
mod pulls;
mod segment_grid;
mod used_junctions;

pub use neat_core::Wireframe3d;
pub use observation::ViewObservation;
pub use proposal::SegmentProposal;
pub use signed_distance::SignedDistance;

#[cfg(test)]
mod test_scenes;
#[cfg(test)]
mod test_support;
