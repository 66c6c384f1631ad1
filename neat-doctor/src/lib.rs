//! Examines a posed scene before hours are spent on it: do poses, intrinsics and
//! images agree, and if not, why, and which flag repairs it?
//!
//! [`examine`] looks at a scene, [`examine_folder`] also at folders that do not
//! even hold one that can be read, and [`explain`] says what a [`SceneError`]
//! means. All give findings with a level, a cause, a sentence and a remedy.
//!
//! The check of the poses does not trust them. It first gathers evidence from
//! the images alone: points of textured things, matched by their looks through
//! three views, or corners of things without texture. Then it asks how much of
//! this evidence the given cameras explain, and how much others would: in every
//! convention of poses and axes, with other focal lengths, of scaled images, in
//! another order. The explanation that is clearly best is the diagnosis.
//!
//! ```
//! use neat_core::LoadOptions;
//! use neat_doctor::{Check, ExamineOptions, Verdict, examine_folder};
//!
//! let nowhere = examine_folder("no/such/folder", &LoadOptions::default(), &ExamineOptions::default());
//! assert_eq!(nowhere.verdict, Verdict::NotReady);
//! assert_eq!(nowhere.findings[0].check, Check::Files);
//! ```
//!
//! [`SceneError`]: neat_core::SceneError

#![forbid(unsafe_code)]

mod agreement;
mod capture_checks;
mod corner_consensus;
mod corners;
mod descriptor;
mod evidence;
mod examination;
mod examine;
mod explanations;
mod gray_image;
mod hypothesis;
mod image_checks;
mod lens;
mod likeness;
mod load_failure;
mod point_looks;
mod point_transfer;
mod pose_diagnosis;
mod pose_findings;
mod quaternion_order;
mod segment_checks;
mod silhouettes;
mod tracks;
mod view_faults;
mod view_groups;
mod working_copies;

pub use examination::{Cause, Check, Examination, Finding, Level, Repair, Verdict};
pub use examine::{Depth, ExamineOptions, examine, examine_folder, examine_loaded};
pub use load_failure::explain;

/// The example of the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
