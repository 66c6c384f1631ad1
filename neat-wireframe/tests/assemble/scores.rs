//! Precision and recall against a true wireframe.

use neat_core::Wireframe3d;
use neat_wireframe::metrics::DistanceMatrix;
use neat_wireframe::metrics::{
    PrecisionRecall, SegmentDistance, junction_distances, precision_recall, segment_distances,
};

/// Of junctions, and of segments at both ends, within `threshold`.
pub fn scores_within(
    threshold: f64,
    found: &Wireframe3d,
    truth: &Wireframe3d,
) -> (PrecisionRecall, PrecisionRecall) {
    let score = |distances: DistanceMatrix| precision_recall(&distances, &[threshold]).unwrap()[0];
    let (segments, true_ones) = (found.segments(), truth.segments());
    (
        score(junction_distances(&found.junctions, &truth.junctions).unwrap()),
        score(segment_distances(&segments, &true_ones, SegmentDistance::Max).unwrap()),
    )
}
