//! From an image to its 2D wireframe.

mod config;
mod detection;
mod edge_profile;
mod junction_graph;
mod line_fitting;
mod merging;
mod segment_search;
mod smoothed_image;

pub use config::DetectorConfig;
pub use detection::detect;
