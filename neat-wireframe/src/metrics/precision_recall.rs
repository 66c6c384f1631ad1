//! Precision and recall of junctions and segments under distance thresholds
//! (supplement E, Table 6; `evaluation/eval-abc.py`).

use super::distance_matrix::DistanceMatrix;
use super::{MAX_PAIRS, MetricsError};
use nalgebra::Vector3;
use neat_core::LineSegment3;
use serde::{Deserialize, Serialize};

/// The distance of two segments, from the two distances of their ends in the
/// better order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SegmentDistance {
    /// The mean of the two: the published code.
    Mean,
    /// The larger of the two: the paper's text, and stricter.
    Max,
}

/// How predictions are paired with the truth, one to one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Matching {
    /// One assignment with the smallest sum of distances serves all thresholds,
    /// as in the published code. A spurious prediction can take the partner of a
    /// good one when that shortens the sum, so recall may be too low.
    #[default]
    MinimumSum,
    /// For each threshold the largest possible number of pairs below it.
    /// Predictions beyond the threshold have no influence.
    PerThreshold,
}

/// Precision and recall at one threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PrecisionRecall {
    /// Pairs count when their distance is strictly smaller than this.
    pub threshold: f64,
    /// How many pairs count.
    pub matched: usize,
    /// `matched` by the number of predictions; 0 without predictions.
    pub precision: f64,
    /// `matched` by the number of true elements; 0 without any.
    pub recall: f64,
}

/// Distances of all predicted from all true junctions, `[predicted, truth]`.
///
/// # Errors
/// If there are too many pairs.
pub fn junction_distances(
    predicted: &[Vector3<f64>],
    truth: &[Vector3<f64>],
) -> Result<DistanceMatrix, MetricsError> {
    check_pairs(predicted.len(), truth.len())?;
    Ok(DistanceMatrix::between(predicted, truth, |a, b| {
        (a - b).norm()
    }))
}

fn check_pairs(predicted: usize, truth: usize) -> Result<(), MetricsError> {
    match predicted.saturating_mul(truth) {
        ..=MAX_PAIRS => Ok(()),
        _ => Err(MetricsError::TooManyPairs { predicted, truth }),
    }
}

/// Distances of all predicted from all true segments, `[predicted, truth]`; ends
/// must be finite.
///
/// # Errors
/// If there are too many pairs.
pub fn segment_distances(
    predicted: &[LineSegment3],
    truth: &[LineSegment3],
    distance: SegmentDistance,
) -> Result<DistanceMatrix, MetricsError> {
    check_pairs(predicted.len(), truth.len())?;
    Ok(DistanceMatrix::between(predicted, truth, |a, b| {
        segment_distance(a, b, distance)
    }))
}

/// The distance of two segments.
pub(super) fn segment_distance(a: &LineSegment3, b: &LineSegment3, kind: SegmentDistance) -> f64 {
    let in_order = |b: &LineSegment3| {
        let [start, end] = a.end_distances(b);
        match kind {
            SegmentDistance::Mean => (start + end) / 2.0,
            SegmentDistance::Max => start.max(end),
        }
    };
    in_order(b).min(in_order(&b.reversed()))
}

/// Precision and recall at each threshold, from the distances `[predicted, truth]`: one
/// assignment with the smallest sum serves all. [`NearPairs`](super::NearPairs) is the other
/// [`Matching`].
///
/// # Errors
/// If a distance is not finite.
pub fn precision_recall(
    distances: &DistanceMatrix,
    thresholds: &[f64],
) -> Result<Vec<PrecisionRecall>, MetricsError> {
    let pairs = distances.assign()?;
    let score = |threshold: &f64| {
        let matched = pairs.iter().filter(|p| p.distance < *threshold).count();
        PrecisionRecall::new(*threshold, matched, [distances.rows(), distances.columns()])
    };
    Ok(thresholds.iter().map(score).collect())
}

impl PrecisionRecall {
    /// Of so many pairs at a threshold, of so many predictions and true ones.
    pub(super) fn new(threshold: f64, matched: usize, [predicted, truth]: [usize; 2]) -> Self {
        Self {
            threshold,
            matched,
            precision: share(matched, predicted),
            recall: share(matched, truth),
        }
    }
}

fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 {
        0.0
    } else {
        part as f64 / whole as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::NearPairs;

    fn on_x(positions: &[f64]) -> Vec<Vector3<f64>> {
        positions
            .iter()
            .map(|x| Vector3::new(*x, 0.0, 0.0))
            .collect()
    }

    #[test]
    fn segment_distance_takes_the_better_order() {
        let truth = LineSegment3::new(Vector3::zeros(), Vector3::new(1.0, 0.0, 0.0));
        let other = LineSegment3::new(Vector3::new(1.0, 0.3, 0.0), Vector3::new(0.0, 0.1, 0.0));
        let distance = |kind| {
            let distances = segment_distances(&[other], &[truth], kind).unwrap();
            distances.assign().unwrap()[0].distance
        };
        assert!((distance(SegmentDistance::Mean) - 0.2).abs() < 1e-15);
        assert!((distance(SegmentDistance::Max) - 0.3).abs() < 1e-15);
    }

    #[test]
    fn threshold_is_strict_and_shares_have_their_own_denominators() {
        let distances = junction_distances(&on_x(&[0.0, 5.5, 9.0]), &on_x(&[0.0, 5.0])).unwrap();
        let scores = precision_recall(&distances, &[0.0, 0.5, 0.6]).unwrap();
        assert_eq!(
            scores.iter().map(|s| s.matched).collect::<Vec<_>>(),
            [0, 1, 2]
        );
        assert_eq!((scores[1].precision, scores[1].recall), (1.0 / 3.0, 0.5));
    }

    #[test]
    fn nothing_predicted_or_nothing_true_scores_zero() {
        for (predicted, truth) in [(&[][..], &[1.0][..]), (&[1.0], &[]), (&[], &[])] {
            let (predicted, truth) = (on_x(predicted), on_x(truth));
            let distances = junction_distances(&predicted, &truth).unwrap();
            let near = NearPairs::of_junctions(&predicted, &truth, &[0.01]).unwrap();
            for scores in [
                precision_recall(&distances, &[0.01]).unwrap(),
                near.precision_recall(),
            ] {
                assert_eq!((scores[0].precision, scores[0].recall), (0.0, 0.0));
            }
        }
    }

    #[test]
    fn nan_is_an_error() {
        let distances = junction_distances(&on_x(&[f64::NAN]), &on_x(&[0.0])).unwrap();
        assert!(precision_recall(&distances, &[0.01]).is_err());
    }

    #[test]
    fn what_cannot_be_matched_is_refused_before_memory_is_taken() {
        let many = vec![Vector3::zeros(); 5001];
        let error = junction_distances(&many, &many[1..]).unwrap_err();
        assert!(
            error.to_string().starts_with("5001 predicted and 5000"),
            "{error}"
        );
        assert!(junction_distances(&many, &many[..1]).is_ok());
    }
}
