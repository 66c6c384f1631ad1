//! Why something could not be measured.

use neat_core::SceneError;
use neat_wireframe::metrics::MetricsError;
use std::path::PathBuf;

/// Why an evaluation could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvalError {
    /// A wireframe or a surface is broken.
    #[error(transparent)]
    Metrics(#[from] MetricsError),
    /// A file could not be read.
    #[error(transparent)]
    File(#[from] SceneError),
    /// A truth that nothing can be compared to.
    #[error("the truth has no {missing}: the protocol {protocol} needs some; give another file")]
    EmptyTruth {
        /// Name of the protocol.
        protocol: &'static str,
        /// What it lacks.
        missing: &'static str,
    },
    /// Edges so long that their points would fill the memory.
    #[error(
        "the edges of the {what} are too long for points every {spacing}: bring result and truth into the unit cube, as the protocol has them"
    )]
    TooManySamples {
        /// The result or the truth.
        what: &'static str,
        /// Distance of the points.
        spacing: f64,
    },
    /// Edges so long, or coordinates so large, that something else must be meant.
    #[error(
        "the {what} is too large for points every {spacing}: bring it into the frame and unit of the scene, or check `scale` in its truth/stats.json"
    )]
    OutOfScale {
        /// The result, or a part of the truth.
        what: &'static str,
        /// Distance of the points.
        spacing: f64,
    },
    /// A surface whose triangles do not fit its vertices.
    #[error("triangle {triangle} of the true surface names a vertex that does not exist")]
    BrokenSurface {
        /// Index of the triangle.
        triangle: usize,
    },
    /// A file whose ending says nothing about its format.
    #[error(
        "{path}: no reader for this ending; give .json, .obj, .ply, .npz, .npy, or the .txt of Line3D++"
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
}
