//! How good a 3D wireframe is, by the published protocols and one of ours, each under its name.
//!
//! Numbers of different papers look alike and are not: "precision at 20 mm" is
//! one thing with one-to-one matching of segments, another with points sampled
//! every 5 mm, and a third with points averaged in cells. So every protocol here
//! is a type with the constants of its published code, a file that says where they
//! are from, and a name in [`Protocol`]:
//!
//! | name | type | compared with |
//! | --- | --- | --- |
//! | `neat-abc` | [`NeatAbc`] | a true wireframe |
//! | `neat-dtu`, `neat-blended-mvs` | [`NeatSurface`] | a scanned surface |
//! | `emap`, `curve-gaussian`, `edge-gaussians`, `nef` | [`EdgePoints`] | true edges with curves |
//! | `limap-hypersim`, `limap-tnt` | [`LimapLength`] | a scanned surface |
//! | `hss` | [`StructureScore`] | a true wireframe |
//! | `wed` | [`EditDistance`] | a true wireframe |
//! | `surface-and-creases` | [`SurfaceAndCreases`] | the exact truth of a rendered scene |
//! | `cad-faces` | [`CadFaces`] | the faces of a CAD model |
//! | `scene-faces` | [`SceneFaces`] | the exact surface of a rendered scene |
//!
//! All take plain points and segments, so that anything can be measured; results
//! of other programs come in through [`foreign::read`]. An [`EvaluationReport`]
//! prints scores as a table, as Markdown and as JSON; [`Protocol::evaluate`] measures by
//! a protocol that is named at run time. [`image_quality`] measures
//! rendered views, [`image_colouring`] turns them into pictures.
//!
//! # Example
//!
//! ```
//! use nalgebra::Vector3;
//! use neat_core::Wireframe3d;
//! use neat_eval::{EvaluationInput, EvaluationReport, NeatAbc, Protocol};
//!
//! let truth = Wireframe3d {
//!     junctions: vec![Vector3::zeros(), Vector3::x(), Vector3::y()],
//!     edges: vec![[0, 1], [0, 2]],
//! };
//! // One edge is missing, and the rest is a hundredth and a half too high.
//! let mut predicted = truth.map(|p| p + Vector3::new(0.0, 0.0, 0.015));
//! predicted.edges.pop();
//!
//! let scores = NeatAbc::default().evaluate(&predicted, None, &truth)?;
//! let at_2_percent = scores.wireframe.segments_max[1];
//! assert_eq!((at_2_percent.precision, at_2_percent.recall), (1.0, 0.5));
//!
//! // Or any protocol by its name, with a report to print.
//! let protocol: Protocol = "neat-abc".parse()?;
//! let mut input = EvaluationInput::default();
//! input.predicted = predicted.into();
//! input.truth.wireframe = truth;
//! let report = EvaluationReport::new(protocol.evaluate(&input, &Default::default())?);
//! assert!(report.to_text().contains("segments, larger end distance"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod foreign;
pub mod image_colouring;
pub mod image_quality;
pub mod mat_file;

mod abc_nef;
mod box_tree;
mod counts;
mod edge_model;
mod edge_points;
mod edit_distance;
mod error;
mod faces;
mod limap_length;
mod neat_abc;
mod neat_dtu;
mod observation_mask;
mod protocol;
mod reliability;
mod report;
mod structure_score;
mod surface_and_creases;
mod table;
mod thinning;
mod total;
mod triangle;
mod triangle_mesh;

pub use abc_nef::{EdgePointScores, EdgePoints, PointPrecisionRecall};
pub use counts::WireframeCounts;
pub use edge_model::{CubicBezier, EdgeModel, wireframe_of_segments};
pub use edge_points::{EdgeSampling, VoxelGrid};
pub use edit_distance::{EditDistance, EditScores};
pub use error::EvalError;
pub use faces::{
    CadFaceScores, CadFaces, FaceCounts, FaceShare, FaceShares, FoundFace, PlaneOffset,
    SceneFaceScores, SceneFaces, TrueFace,
};
pub use limap_length::{LengthRecall, LengthScores, LimapLength};
pub use neat_abc::{GraphScores, NeatAbc, NeatAbcScores};
pub use neat_dtu::{NeatSurface, ScannedSurface, SurfaceScores};
pub use observation_mask::{GroundPlane, ObservationMask};
pub use protocol::{
    EvaluationInput, EvaluationOptions, Protocol, Scores, TruthKind, UnknownProtocol,
};
pub use reliability::{Binning, Judged, ReliabilityBin, expected_calibration_error, reliability};
pub use report::EvaluationReport;
pub use structure_score::{StructureScore, StructureScores};
pub use surface_and_creases::{
    CreaseCounts, CreaseScores, CreaseShares, MeanAndMedian, RecallBin, SceneTruth,
    SurfaceAndCreases, existing_edges,
};
pub use triangle_mesh::TriangleMesh;

/// The example of the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
