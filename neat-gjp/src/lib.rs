//! Global junction perceiving (paper §4.2): learned latents become 3D
//! junctions, matched to what the rendered segments' ends suggest.
//!
//! This crate takes candidate end points and 2D junctions from anywhere; it
//! knows no field.
//!
//! ```
//! use neat_gjp::clustering::dbscan_means;
//!
//! // Two ends that agree, and one that is alone.
//! let ends = [[0.0, 0.0, 0.0], [0.002, 0.0, 0.0], [0.5, 0.5, 0.5]];
//! assert_eq!(dbscan_means(&ends, 0.01, 2).means.len(), 1);
//! ```

#![forbid(unsafe_code)]

pub mod candidates;
pub mod clustering;
pub mod junction_loss;
pub mod perceiver;

pub use candidates::{CandidateConfig, MatchingConfig};
pub use perceiver::{JunctionCount, JunctionPerceiver, PerceiverConfig};
