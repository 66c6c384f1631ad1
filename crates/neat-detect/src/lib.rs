//! From an image to its 2D wireframe.

mod claimed_pixels;
mod clutter;
mod config;
mod detection;
mod edge_completion;
mod edge_profile;
mod junction_graph;
mod line_fitting;
mod merging;
mod noise;
mod robust_line;
mod segment_search;
mod smoothed_image;

pub use config::DetectorConfig;
pub use detection::detect;
