//! Why a report cannot be made.

use neat_core::{CameraError, SceneError};
use neat_wireframe::validity::WireframeFlaw;

/// Why a report cannot be rendered or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The graph has a point that is no point or an edge that leads nowhere.
    #[error("report: the wireframe is not valid")]
    Wireframe(#[from] WireframeFlaw),
    /// A field that does not hold one finite number for each element.
    #[error(
        "report: the field `{field}` must hold {expected} entries of finite numbers, one per {of}"
    )]
    Field {
        /// Name of the field.
        field: String,
        /// How many entries it must have.
        expected: usize,
        /// What it describes: "junction" or "edge".
        of: &'static str,
    },
    /// Support by a view that the report does not have.
    #[error("report: an edge is supported by view `{0}`, which the report lacks: give all views")]
    UnknownView(String),
    /// A camera that cannot be drawn.
    #[error("report: view `{view}`: {problem}")]
    Camera {
        /// Name of the view.
        view: String,
        /// What is wrong with it.
        problem: CameraError,
    },
    /// A 2D segment of a view with an end that is no point.
    #[error("report: segment {segment} of view `{view}` is not finite: detect its segments again")]
    Segment {
        /// Name of the view.
        view: String,
        /// Index of the segment.
        segment: usize,
    },
    /// A photograph that cannot be encoded.
    #[error("report: the photograph of view `{view}` cannot be encoded as JPEG")]
    Photograph {
        /// Name of the view.
        view: String,
        /// What the codec said.
        source: image::ImageError,
    },
    /// The data has no JSON form.
    #[error("report: its data cannot be written as JSON")]
    Json(#[from] serde_json::Error),
    /// The file could not be written.
    #[error(transparent)]
    File(#[from] SceneError),
}
