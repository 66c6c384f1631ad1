//! Neural attraction fields (paper §3.1, §3.2 and §4.1): every point of a
//! volume carries the 3D segment it belongs to, and rendering a ray renders a
//! segment.
//!
//! ```
//! use nalgebra::Vector2;
//! use neat_core::LineSegment2;
//! use neat_field::attraction_region::AttractionRegions;
//!
//! let segment = LineSegment2::new(Vector2::new(8.0, 8.0), Vector2::new(24.0, 16.0));
//! // Pixels of a 32 × 32 image within 3 pixels of it, whose centres are at integers.
//! let regions = AttractionRegions::compute(&[segment], 32, 32, 0.0, 3.0);
//! assert!(regions.len() > 0);
//! ```

#![forbid(unsafe_code)]

pub mod attraction_network;
pub mod attraction_region;
pub mod host_segment_loss;
pub mod region_pixels;
pub mod segment_comparison;
pub mod segment_loss;

pub use attraction_network::{AttractionNetwork, AttractionNetworkConfig};
