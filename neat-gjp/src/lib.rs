//! Global junction perceiving (paper §4.2): learned latents become 3D
//! junctions, matched to what the rendered segments' ends suggest.
//!
//! This crate takes candidate end points and 2D junctions from anywhere; it
//! knows no field.

#![forbid(unsafe_code)]

pub mod candidates;
pub mod clustering;
pub mod junction_loss;
pub mod perceiver;

pub use candidates::{CandidateConfig, MatchingConfig};
pub use perceiver::{JunctionCount, JunctionPerceiver, PerceiverConfig};
