//! Wireframes in the formats of CAD programs, geographic information systems and
//! viewers; signed distance functions as triangle meshes.
//!
//! [`export`] writes a [`WireframeDocument`](neat_wireframe::export::WireframeDocument)
//! in any [`Format`], in the frame and the unit of the document. A junction that
//! edges share stays one vertex wherever the format knows vertices; text formats
//! write every number so that it reads back as the same one, and a file that is
//! there already is replaced only by a complete one.
//!
//! ```
//! use nalgebra::Vector3;
//! use neat_export::{ExportOptions, Format, export};
//! use neat_wireframe::Wireframe3d;
//! use neat_wireframe::export::WireframeDocument;
//!
//! let wireframe = Wireframe3d {
//!     junctions: vec![Vector3::zeros(), Vector3::x()],
//!     edges: vec![[0, 1]],
//! };
//! let dir = tempfile::tempdir()?;
//! let path = dir.path().join("wireframe.dxf");
//! let format = Format::from_path(&path)?;
//! let document = WireframeDocument::from(&wireframe);
//! let written = export(&document, &path, format, &ExportOptions::default())?;
//! assert_eq!((written.junctions, written.edges), (2, 1));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`marching_cubes`](marching_cubes::marching_cubes) turns a
//! [`SignedDistance`](neat_wireframe::SignedDistance) into a [`TriangleMesh`].

#![forbid(unsafe_code)]

pub mod marching_cubes;

mod cityjson;
mod colmap;
mod confidence;
mod cube_case;
mod drawn;
mod dxf;
mod edge_filter;
mod error;
mod export;
mod format;
mod geojson;
mod gltf;
mod isolated;
mod limap;
mod npz;
mod options;
mod orthographic;
mod picture;
mod projected_arc;
mod step;
mod svg;
mod target;
mod triangle_mesh;

pub use confidence::Confidence;
pub use edge_filter::EdgeFilter;
pub use error::ExportError;
pub use export::export;
pub use format::Format;
pub use options::{ExportOptions, LengthUnit, UpAxis};
pub use orthographic::ViewDirection;
pub use target::Written;
pub use triangle_mesh::TriangleMesh;

/// The example of the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
