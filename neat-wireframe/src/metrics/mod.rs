//! How good a wireframe is: precision and recall against a true wireframe,
//! distances from and to a scanned surface, agreement with the images where there
//! is no truth. The published protocols that these make up are in `neat-eval`.

mod distance_matrix;
mod ideal_baseline;
mod image_evidence;
mod near_pairs;
mod precision_recall;
mod supported_truth;
mod surface_distance;

pub use distance_matrix::{DistanceMatrix, MatchedPair};
pub use ideal_baseline::{IdealBaseline, ideal_baseline};
pub(crate) use image_evidence::visible_projection;
pub use image_evidence::{ImageEvidence, ImageEvidenceConfig, image_evidence};
pub use near_pairs::NearPairs;
pub use precision_recall::{
    Matching, PrecisionRecall, SegmentDistance, junction_distances, precision_recall,
    segment_distances,
};
pub use supported_truth::{
    SupportedTruthConfig, WithoutCurves, required_views, supported_truth, without_curves,
};
pub use surface_distance::{PointCloud, mean_nearest_distance, sample_segments};

use crate::validity::WireframeFlaw;
use neat_core::assignment::AssignmentError;

/// More pairs of predicted and true ones are not matched: minutes, and 200 MB of distances.
pub(crate) const MAX_PAIRS: usize = 25_000_000;

/// Why a wireframe could not be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MetricsError {
    /// The wireframe to measure is broken.
    #[error("the wireframe to evaluate is not valid")]
    Predicted(#[source] WireframeFlaw),
    /// The true wireframe is broken.
    #[error("the ground-truth wireframe is not valid")]
    Truth(#[source] WireframeFlaw),
    /// A point of the surface is NaN or infinite.
    #[error("point {point} of the surface is not finite")]
    NonFiniteSurface {
        /// Index of the point.
        point: usize,
    },
    /// The surface has more points than can be indexed.
    #[error("the surface has {points} points, which is too many: thin it out")]
    TooManyPoints {
        /// How many there are.
        points: usize,
    },
    /// So many things on both sides that no matching of all of them ends.
    #[error(
        "{predicted} predicted and {truth} true ones make more than {MAX_PAIRS} pairs, too many to match: measure parts, take `--matching per-threshold` with thresholds that are small beside the scene, or choose a protocol of points, such as emap"
    )]
    TooManyPairs {
        /// Predicted junctions or segments.
        predicted: usize,
        /// True ones.
        truth: usize,
    },
    /// Distances that cannot be matched.
    #[error("the distances cannot be matched")]
    Assignment(#[from] AssignmentError),
}
