//! A page that shows a 3D wireframe and why to believe it.
//!
//! A [`Report`] becomes one HTML file that needs no network and no other file: the
//! wireframe to turn, colour and filter; the cameras, and the view through each of
//! them; for every segment the photographs that support it; the junctions while they
//! were trained; curves, facts, warnings and the configuration.
//!
//! Whatever a report holds is shown as text and never becomes markup or script, so
//! that names of files and scenes need not be trusted.
//!
//! ```
//! use neat_core::synthetic::{Solid, SyntheticScene, generate};
//! use neat_report::{PhotographConfig, Report};
//!
//! let config = SyntheticScene { solid: Solid::Box, views: 3, image_size: 64, ..SyntheticScene::default() };
//! let data = generate(&config)?;
//! let mut report = Report::of_scene(&data.scene, (&data.truth).into(), 0.05, &PhotographConfig::default())?;
//! report.warnings.push("only 3 views".to_owned());
//! let page = report.render()?;
//! assert!(page.starts_with("<!doctype html>"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

mod check;
mod error;
mod escaping;
mod page;
mod payload;
mod photograph;
mod report;

pub use error::ReportError;
pub use photograph::{Photograph, PhotographConfig, photographs};
pub use report::{Curve, FactGroup, JunctionSnapshot, Report, ReportView};

/// The example of the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
