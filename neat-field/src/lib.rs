//! Neural attraction fields (paper §3.1, §3.2 and §4.1): every point of a
//! volume carries the 3D segment it belongs to, and rendering a ray renders a
//! segment.

#![forbid(unsafe_code)]

pub mod attraction_network;
pub mod attraction_region;
pub mod host_segment_loss;
pub mod region_pixels;
pub mod segment_loss;
pub mod segment_rendering;

pub use attraction_network::{AttractionNetwork, AttractionNetworkConfig};
