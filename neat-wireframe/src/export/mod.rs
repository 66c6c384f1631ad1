//! Wireframes as files: JSON, OBJ, PLY and LIMAP's line tracks.
//!
//! All formats keep shared vertices shared, write every float so that it reads
//! back as the same number, and replace an existing file only when the new one is
//! complete.

mod fields;
mod json;
mod limap;
mod obj;
mod ply;

pub use fields::{EdgeFields, JunctionFields};
pub use json::{SupportingSegment, WireframeDocument, parse_json, read_json, write_json};
pub use limap::{
    LineTrack, TrackSegment, parse_all_tracks, parse_image_list, parse_track, read_all_tracks,
    read_image_list, read_track_folder, write_all_tracks, write_image_list, write_track_folder,
};
pub use obj::write_obj;
pub use ply::write_ply;

use crate::Wireframe3d;
use crate::validity::{WireframeFlaw, check_wireframe};
use nalgebra::Vector3;
use neat_core::SceneError;
use std::path::{Path, PathBuf};

/// Why a wireframe could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The graph has a point that is no point or an edge that leads nowhere.
    #[error("{path}: the wireframe is not valid")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: WireframeFlaw,
    },
    /// An extra field does not hold one entry of finite numbers per junction or
    /// edge, or names a view that does not exist.
    #[error(
        "{path}: the field `{field}` must hold {expected} entries of finite numbers, one per {of}"
    )]
    BadField {
        /// The file.
        path: PathBuf,
        /// Name of the field.
        field: String,
        /// How many numbers it must hold.
        expected: usize,
        /// What it describes: "junction" or "edge".
        of: &'static str,
    },
    /// An arc is none.
    #[error(
        "{path}: arc {arc} is none: it needs a radius above 0, axes of length 1 perpendicular to \
         each other, and ascending angles at most 2π apart"
    )]
    BadArc {
        /// The file.
        path: PathBuf,
        /// Its index.
        arc: usize,
    },
    /// A spline is none.
    #[error(
        "{path}: spline {spline} is none: it needs four control points, three if it is closed, \
         that are not one point"
    )]
    BadSpline {
        /// The file.
        path: PathBuf,
        /// Its index.
        spline: usize,
    },
    /// A dome is none.
    #[error(
        "{path}: dome {dome} is none: it needs a centre, an axis of length 1, a radius above 0 and a reach \
         between 0 and π"
    )]
    BadDome {
        /// The file.
        path: PathBuf,
        /// Its index.
        dome: usize,
    },
    /// A shell has a face that is none.
    #[error(
        "{path}: shell {shell} has a face that is none: it needs a surface, and loops of edges, arcs, \
         splines and rims of domes that exist and join end to end"
    )]
    BadShell {
        /// The file.
        path: PathBuf,
        /// Its index.
        shell: usize,
    },
    /// The text is not the JSON of a wireframe.
    #[error("{path} is not a wireframe in JSON; it may be truncated: export it again")]
    Json {
        /// The file.
        path: PathBuf,
        /// What the parser says, with line and column.
        source: serde_json::Error,
    },
    /// The file could not be read or written.
    #[error(transparent)]
    File(#[from] SceneError),
}

/// [`check_wireframe`], with the file's name in the error.
fn check(path: &Path, junctions: &[Vector3<f64>], edges: &[[usize; 2]]) -> Result<(), ExportError> {
    check_wireframe(junctions, edges).map_err(|source| ExportError::Invalid {
        path: path.into(),
        source,
    })
}

/// # Panics
/// If a triangle names no junction: it is ours, and was made of them.
fn check_triangles(triangles: &[[usize; 3]], wireframe: &Wireframe3d) {
    let count = wireframe.junctions.len();
    assert!(
        triangles.iter().flatten().all(|corner| *corner < count),
        "a triangle of other points than {count} junctions"
    );
}
