//! All metrics of one wireframe, gathered for reports.

use super::{
    Matching, MetricsError, PointCloud, PrecisionRecall, SegmentDistance, junction_distances,
    mean_nearest_distance, precision_recall, sample_segments, segment_distances,
};
use crate::Wireframe3d;
use crate::validity::check_wireframe;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// What to measure, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EvaluationConfig {
    /// Thresholds of precision and recall, in world units of the truth.
    pub thresholds: Vec<f64>,
    /// How predictions are paired with the truth.
    pub matching: Matching,
    /// Samples per segment for accuracy and completeness, both ends included.
    pub samples_per_segment: usize,
    /// Distances from or to the surface that are this long or longer are
    /// ignored: world units of the surface (millimetres for DTU).
    pub max_surface_distance: f64,
}

impl Default for EvaluationConfig {
    fn default() -> Self {
        Self {
            thresholds: vec![0.01, 0.02, 0.05],
            matching: Matching::default(),
            samples_per_segment: 32,
            max_surface_distance: 20.0,
        }
    }
}

/// How large a wireframe is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WireframeCounts {
    /// Number of junctions, isolated ones included.
    pub junctions: usize,
    /// Number of segments.
    pub segments: usize,
    /// Mean length of the segments; `None` without segments.
    pub mean_length: Option<f64>,
}

/// Agreement with a true wireframe, one entry per threshold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WireframeScores {
    /// Size of the truth.
    pub truth: WireframeCounts,
    /// How predictions were paired with the truth.
    pub matching: Matching,
    /// Of the junctions, isolated ones included.
    pub junctions: Vec<PrecisionRecall>,
    /// Of the segments, by the larger end distance (the paper's text).
    pub segments_max: Vec<PrecisionRecall>,
    /// Of the segments, by the mean end distance (the published code).
    pub segments_mean: Vec<PrecisionRecall>,
}

/// Agreement with a scanned surface; lower is better. `None` where no distance
/// counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfaceScores {
    /// ACC-J: mean distance of the junctions that carry an edge.
    pub junction_accuracy: Option<f64>,
    /// ACC-L: mean distance of the samples of all segments.
    pub segment_accuracy: Option<f64>,
    /// Mean distance of the surface points to those samples.
    pub completeness: Option<f64>,
}

/// All that was measured of one wireframe. [`Evaluation::to_markdown`] prints it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Size of the wireframe.
    pub counts: WireframeCounts,
    /// Against a true wireframe, where there is one.
    pub wireframe: Option<WireframeScores>,
    /// Against a scanned surface, where there is one.
    pub surface: Option<SurfaceScores>,
}

impl EvaluationConfig {
    /// Measures `predicted` against whatever truth there is, all in one frame.
    ///
    /// # Errors
    /// If a wireframe or the surface is not valid, see [`MetricsError`].
    ///
    /// # Example
    /// ```
    /// use nalgebra::Vector3;
    /// use neat_wireframe::{Wireframe3d, metrics::EvaluationConfig};
    ///
    /// let truth = Wireframe3d {
    ///     junctions: vec![Vector3::zeros(), Vector3::x()],
    ///     edges: vec![[0, 1]],
    /// };
    /// let predicted = truth.map(|p| p + Vector3::new(0.0, 0.015, 0.0));
    /// let evaluation = EvaluationConfig::default().evaluate(&predicted, Some(&truth), None)?;
    /// let recall = |i: usize| evaluation.wireframe.as_ref().map(|w| w.segments_max[i].recall);
    /// assert_eq!((recall(0), recall(1)), (Some(0.0), Some(1.0)));
    /// # Ok::<(), neat_wireframe::metrics::MetricsError>(())
    /// ```
    pub fn evaluate(
        &self,
        predicted: &Wireframe3d,
        truth: Option<&Wireframe3d>,
        surface: Option<&[Vector3<f64>]>,
    ) -> Result<Evaluation, MetricsError> {
        check_wireframe(&predicted.junctions, &predicted.edges).map_err(MetricsError::Predicted)?;
        Ok(Evaluation {
            counts: WireframeCounts::of(predicted),
            wireframe: truth
                .map(|truth| self.compare_wireframes(predicted, truth))
                .transpose()?,
            surface: surface
                .map(|surface| self.compare_to_surface(predicted, surface))
                .transpose()?,
        })
    }

    fn compare_wireframes(
        &self,
        predicted: &Wireframe3d,
        truth: &Wireframe3d,
    ) -> Result<WireframeScores, MetricsError> {
        check_wireframe(&truth.junctions, &truth.edges).map_err(MetricsError::Truth)?;
        let score = |distances| precision_recall(&distances, &self.thresholds, self.matching);
        let segments = |distance| {
            let (ours, true_ones) = (predicted.segments(), truth.segments());
            score(segment_distances(&ours, &true_ones, distance))
        };
        Ok(WireframeScores {
            truth: WireframeCounts::of(truth),
            matching: self.matching,
            junctions: score(junction_distances(&predicted.junctions, &truth.junctions))?,
            segments_max: segments(SegmentDistance::Max)?,
            segments_mean: segments(SegmentDistance::Mean)?,
        })
    }

    fn compare_to_surface(
        &self,
        predicted: &Wireframe3d,
        surface: &[Vector3<f64>],
    ) -> Result<SurfaceScores, MetricsError> {
        let cloud = PointCloud::new(surface)?;
        let used: BTreeSet<usize> = predicted.edges.iter().flatten().copied().collect();
        let ends: Vec<_> = used.iter().map(|&i| predicted.junctions[i]).collect();
        let samples = sample_segments(&predicted.segments(), self.samples_per_segment);
        let mean = |from: &[_], to: &_| mean_nearest_distance(from, to, self.max_surface_distance);
        Ok(SurfaceScores {
            junction_accuracy: mean(&ends, &cloud),
            segment_accuracy: mean(&samples, &cloud),
            completeness: mean(surface, &PointCloud::new(&samples)?),
        })
    }
}

impl WireframeCounts {
    fn of(wireframe: &Wireframe3d) -> Self {
        let segments = wireframe.segments();
        let total_length: f64 = segments.iter().map(|segment| segment.length()).sum();
        Self {
            junctions: wireframe.junctions.len(),
            segments: segments.len(),
            mean_length: (!segments.is_empty()).then(|| total_length / segments.len() as f64),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validity::WireframeFlaw;

    fn l_shape(lift: f64) -> Wireframe3d {
        Wireframe3d {
            junctions: vec![
                Vector3::new(0.0, 0.0, lift),
                Vector3::new(1.0, 0.0, lift),
                Vector3::new(1.0, 2.0, lift),
                Vector3::new(7.0, 7.0, 7.0),
            ],
            edges: vec![[0, 1], [1, 2]],
        }
    }

    #[test]
    fn a_wireframe_is_perfect_against_itself() {
        let wireframe = l_shape(0.0);
        let evaluation = EvaluationConfig::default()
            .evaluate(&wireframe, Some(&wireframe), None)
            .unwrap();
        assert_eq!(evaluation.counts.mean_length, Some(1.5));
        let scores = evaluation.wireframe.unwrap();
        for list in [
            &scores.junctions,
            &scores.segments_max,
            &scores.segments_mean,
        ] {
            assert_eq!(list.len(), 3);
            assert!(list.iter().all(|s| s.precision == 1.0 && s.recall == 1.0));
        }
        assert_eq!(evaluation.surface, None);
    }

    #[test]
    fn isolated_junctions_do_not_count_for_accuracy() {
        let surface: Vec<_> = sample_segments(&l_shape(0.0).segments(), 100);
        let scores = EvaluationConfig::default()
            .evaluate(&l_shape(0.25), None, Some(&surface))
            .unwrap()
            .surface
            .unwrap();
        assert_eq!(scores.junction_accuracy, Some(0.25));
        assert!(scores.segment_accuracy.unwrap() >= 0.25);
        assert!(scores.completeness.unwrap() >= 0.25);
    }

    #[test]
    fn nothing_scores_nothing() {
        let evaluation = EvaluationConfig::default()
            .evaluate(&Wireframe3d::default(), Some(&l_shape(0.0)), Some(&[]))
            .unwrap();
        assert_eq!(evaluation.counts.mean_length, None);
        assert_eq!(evaluation.wireframe.unwrap().segments_max[2].recall, 0.0);
        assert_eq!(evaluation.surface.unwrap().completeness, None);
    }

    #[test]
    fn broken_wireframes_are_refused() {
        let mut nan = l_shape(0.0);
        nan.junctions[2].y = f64::NAN;
        let config = EvaluationConfig::default();
        let flaw = WireframeFlaw::NonFiniteJunction { junction: 2 };
        assert_eq!(
            config.evaluate(&nan, None, None),
            Err(MetricsError::Predicted(flaw))
        );
        assert_eq!(
            config.evaluate(&l_shape(0.0), Some(&nan), None),
            Err(MetricsError::Truth(flaw))
        );
        let mut dangling = l_shape(0.0);
        dangling.edges.push([0, 4]);
        assert!(config.evaluate(&dangling, None, None).is_err());
    }

    #[test]
    fn serialises_and_reads_back() {
        let wireframe = l_shape(0.0);
        let evaluation = EvaluationConfig::default()
            .evaluate(
                &l_shape(0.013),
                Some(&wireframe),
                Some(&wireframe.junctions),
            )
            .unwrap();
        let text = serde_json::to_string(&evaluation).unwrap();
        assert_eq!(
            serde_json::from_str::<Evaluation>(&text).unwrap(),
            evaluation
        );
        assert!(serde_json::from_str::<EvaluationConfig>(r#"{"treshold": 1}"#).is_err());
    }
}
