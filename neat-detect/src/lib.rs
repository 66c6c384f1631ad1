//! From an image to its 2D wireframe.
//!
//! [`detect`] finds line segments (LSD), fits each to the gradient maxima along it
//! to a few hundredths of a pixel, merges what belongs to one edge, and joins ends
//! to shared junctions. [`wireframe_from_segments`] does the same with the segments
//! of another detector, which [`segment_file`] and [`edge_map`] read;
//! [`detect_with_hints`] looks where another one points to, and elsewhere.
//!
//! The stages, in order, each in a file of its name: `noise`, `smoothed_image`,
//! `segment_search`, `line_fitting` (with `edge_profile` and `robust_line`),
//! `merging`, `junction_graph`, `edge_completion`, `clutter`.
//!
//! ```
//! use image::{Rgb, RgbImage};
//! use neat_detect::{DetectorConfig, detect};
//!
//! let image = RgbImage::from_fn(64, 64, |x, _| Rgb([if x < 30 { 20 } else { 200 }; 3]));
//! let wireframe = detect(&image, &DetectorConfig::default());
//! assert!(!wireframe.edges.is_empty());
//! ```
//!
//! Coordinates are those of HAWP's files: pixel centres are integers.

#![forbid(unsafe_code)]

mod claimed_pixels;
mod clutter;
mod config;
mod detection;
mod edge_completion;
pub mod edge_map;
mod edge_profile;
mod edgels;
mod junction_graph;
mod line_fitting;
mod merging;
#[cfg(feature = "onnx")]
pub mod mlsd;
mod noise;
#[cfg(feature = "onnx")]
pub mod onnx;
mod robust_line;
pub mod segment_file;
mod segment_search;
mod smoothed_image;
mod views;

pub use config::{DetectorConfig, DetectorConfigError, LineDetector};
pub use detection::{detect, detect_with_hints, wireframe_from_segments};
pub use edgels::edgel_map;
pub use views::{detect_views, edgel_maps};

/// The example of the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
