//! EMAP, CurveGaussian, EdgeGaussians and NEF on ABC-NEF: edges as points.
//!
//! All four sample both sides, take nearest distances both ways, and report
//! accuracy (prediction to truth), completeness (the reverse), and precision,
//! recall and F-score below thresholds of objects in a unit cube, which they call
//! millimetres. They differ in how they sample, so that their numbers cannot be
//! compared with each other:
//!
//! | protocol | prediction | truth | thresholds |
//! | --- | --- | --- | --- |
//! | EMAP (CVPR 2024; `src/eval/eval_ABC.py` of cvg/EMAP) | every 0.005, averaged in cells of 2/256 | every 0.005 | 5, 10, 20 |
//! | CurveGaussian (ICCV 2025; `edge_extraction/eval_ABC.py` of zhirui-gao/Curve-Gaussian) | every 0.005, averaged in cells of 1/256 | every 0.005 | 5, 10, 20 |
//! | EdgeGaussians (WACV 2025; `eval.py` of kunalchelani/EdgeGaussians) | every 0.005 | every 0.005 | 5, 10, 20 |
//! | NEF (CVPR 2023; `parametric_curve/visualize_and_eval_NEF.py` of yunfan1202/NEF_code) | 500 per edge, averaged in cells of 1/64 | the points of the file | 20 |
//!
//! Two things that the published scripts do must be asked for. They sample the
//! truth *before* they scale the CAD model into the unit cube, so that the
//! spacing is 0.005 CAD units: see [`EdgePoints::truth_spacing_scale`]. And NEF
//! compares with all mesh vertices on the sharp edges: a truth that gives only
//! the two ends of straight edges gives other numbers.

use crate::EvalError;
use crate::edge_model::EdgeModel;
use crate::edge_points::{EdgeSampling, VoxelGrid, sample_prediction, sample_truth};
use crate::table::{Table, distance};
use nalgebra::Vector3;
use neat_core::ground_truth::GroundTruth;
use neat_wireframe::metrics::{MetricsError, PointCloud, mean_nearest_distance};
use neat_wireframe::validity::check_wireframe;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// One of the protocols: its constants.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgePoints {
    /// How the prediction becomes points.
    pub prediction: EdgeSampling,
    /// How these are thinned out.
    pub voxels: Option<VoxelGrid>,
    /// How the truth becomes points.
    pub truth: EdgeSampling,
    /// Factor on the spacing of the truth: the size of the normalised object by
    /// that of its CAD model, 1 if the truth was modelled in the unit cube.
    pub truth_spacing_scale: f64,
    /// Distances below which points agree.
    pub thresholds: Vec<f64>,
}

/// Agreement of sampled edges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgePointScores {
    /// Points of the prediction that were compared.
    pub predicted_points: usize,
    /// Points of the truth.
    pub true_points: usize,
    /// Mean distance of predicted points from the truth; `None` without any.
    pub accuracy: Option<f64>,
    /// Mean distance of true points from the prediction; `None` without any.
    pub completeness: Option<f64>,
    /// Sum of the two.
    pub chamfer: Option<f64>,
    /// One entry per threshold.
    pub thresholds: Vec<PointPrecisionRecall>,
}

/// Shares of points at one threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointPrecisionRecall {
    /// Distances count that are strictly smaller.
    pub threshold: f64,
    /// Share of predicted points near the truth; 0 without any.
    pub precision: f64,
    /// Share of true points near the prediction.
    pub recall: f64,
    /// Their harmonic mean; 0 where both are.
    pub f_score: f64,
    /// Smaller number of agreeing points by all points less the larger one.
    pub iou: f64,
}

impl EdgePointScores {
    pub(crate) fn tables(&self) -> Vec<Table> {
        let (predicted, truth) = (self.predicted_points, self.true_points);
        let values = [
            ("accuracy", distance(self.accuracy)),
            ("completeness", distance(self.completeness)),
            ("chamfer", distance(self.chamfer)),
        ];
        let title = format!("{predicted} predicted points, {truth} true points");
        let distances = Table::of_values(title, ["distance", "mean"], values);
        let header = ["threshold", "precision", "recall", "F-score", "IoU"];
        let mut shares = Table::new("Shares of points", &header);
        for score in &self.thresholds {
            let mut row = vec![score.threshold.to_string()];
            let values = [score.precision, score.recall, score.f_score, score.iou];
            row.extend(values.map(|value| format!("{value:.4}")));
            shares.rows.push(row);
        }
        vec![distances, shares]
    }
}

const SPACING: f64 = 0.005;

impl EdgePoints {
    /// EMAP (Li et al., CVPR 2024): 256 cells over [-1, 1].
    pub fn emap() -> Self {
        Self {
            voxels: Some(VoxelGrid {
                cell: 2.0 / 256.0,
                origin: Some(Vector3::repeat(-1.0)),
            }),
            ..Self::edge_gaussians()
        }
    }

    /// CurveGaussian (Gao et al., ICCV 2025): 256 cells over [0, 1].
    pub fn curve_gaussian() -> Self {
        Self {
            voxels: Some(VoxelGrid {
                cell: 1.0 / 256.0,
                origin: Some(Vector3::zeros()),
            }),
            ..Self::edge_gaussians()
        }
    }

    /// EdgeGaussians (Chelani et al., WACV 2025): no thinning.
    pub fn edge_gaussians() -> Self {
        Self {
            prediction: EdgeSampling::Spacing(SPACING),
            voxels: None,
            truth: EdgeSampling::Spacing(SPACING),
            truth_spacing_scale: 1.0,
            thresholds: vec![0.005, 0.01, 0.02],
        }
    }

    /// NEF (Ye et al., CVPR 2023): 64 cells over the points, truth as it is.
    pub fn nef() -> Self {
        Self {
            prediction: EdgeSampling::Count(500),
            voxels: Some(VoxelGrid {
                cell: 1.0 / 64.0,
                origin: None,
            }),
            truth: EdgeSampling::GivenPoints,
            truth_spacing_scale: 1.0,
            thresholds: vec![0.02],
        }
    }

    /// Measures `predicted` against `truth`, both in the unit cube.
    ///
    /// # Errors
    /// If an edge model is not valid or far larger than the unit cube, or the truth
    /// has no edge that is long enough for a point.
    pub fn evaluate(
        &self,
        predicted: &EdgeModel,
        truth: &GroundTruth,
    ) -> Result<EdgePointScores, EvalError> {
        let wireframe = &predicted.wireframe;
        check_wireframe(&wireframe.junctions, &wireframe.edges).map_err(MetricsError::Predicted)?;
        let wireframe = &truth.wireframe;
        check_wireframe(&wireframe.junctions, &wireframe.edges).map_err(MetricsError::Truth)?;
        let true_sampling = match self.truth {
            EdgeSampling::Spacing(spacing) => {
                EdgeSampling::Spacing(spacing * self.truth_spacing_scale)
            }
            other => other,
        };
        let true_points = sample_truth(truth, true_sampling)?;
        if true_points.is_empty() {
            return Err(EvalError::EmptyTruth {
                protocol: "abc-nef",
                missing: "edge that is long enough to be sampled",
            });
        }
        let mut points = sample_prediction(predicted, self.prediction)?;
        if let Some(voxels) = self.voxels {
            points = voxels.averages(&points);
        }
        self.compare(&points, &true_points)
    }

    /// Compares points as they are, without sampling.
    ///
    /// # Errors
    /// If a point is not finite.
    pub fn compare(
        &self,
        predicted: &[Vector3<f64>],
        truth: &[Vector3<f64>],
    ) -> Result<EdgePointScores, EvalError> {
        let (prediction_cloud, true_cloud) = (PointCloud::new(predicted)?, PointCloud::new(truth)?);
        let accuracy = mean_nearest_distance(predicted, &true_cloud, f64::INFINITY);
        let completeness = mean_nearest_distance(truth, &prediction_cloud, f64::INFINITY);
        let near = |points: &[Vector3<f64>], cloud: &PointCloud, threshold: f64| {
            let is_near = |point: &&Vector3<f64>| {
                let distance = cloud.distance(point);
                distance.is_some_and(|distance| distance < threshold)
            };
            points.par_iter().filter(is_near).count()
        };
        let scores = |&threshold: &f64| {
            let correct = near(predicted, &true_cloud, threshold);
            let found = near(truth, &prediction_cloud, threshold);
            let all = predicted.len() + truth.len();
            let precision = share(correct, predicted.len());
            let recall = share(found, truth.len());
            PointPrecisionRecall {
                threshold,
                precision,
                recall,
                f_score: harmonic_mean(precision, recall),
                iou: share(correct.min(found), all - correct.max(found)),
            }
        };
        Ok(EdgePointScores {
            predicted_points: predicted.len(),
            true_points: truth.len(),
            accuracy,
            completeness,
            chamfer: accuracy.zip(completeness).map(|(a, c)| a + c),
            thresholds: self.thresholds.iter().map(scores).collect(),
        })
    }
}

fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 {
        0.0
    } else {
        part as f64 / whole as f64
    }
}

/// 0 where both are 0.
pub(crate) fn harmonic_mean(a: f64, b: f64) -> f64 {
    if a + b > 0.0 {
        2.0 * a * b / (a + b)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::Wireframe3d;

    fn on_x(xs: &[f64]) -> Vec<Vector3<f64>> {
        xs.iter().map(|x| Vector3::new(*x, 0.0, 0.0)).collect()
    }

    #[test]
    fn points_by_hand() {
        // Distances of predictions 0, 0.008, 0.1; of truths 0, 0.008, 0.096, 0.1.
        let predicted = on_x(&[0.0, 0.508, 0.9]);
        let truth = on_x(&[0.0, 0.5, 0.604, 1.0]);
        let scores = EdgePoints::emap().compare(&predicted, &truth).unwrap();
        let close = |a: Option<f64>, b: f64| assert!((a.unwrap() - b).abs() < 1e-12);
        close(scores.accuracy, 0.108 / 3.0);
        close(scores.completeness, 0.204 / 4.0);
        close(scores.chamfer, 0.036 + 0.051);
        let [at_5, at_10, _] = scores.thresholds[..] else {
            panic!("three thresholds");
        };
        assert_eq!((at_5.precision, at_5.recall), (1.0 / 3.0, 0.25));
        assert!((at_5.f_score - 2.0 / 7.0).abs() < 1e-15);
        assert_eq!(at_5.iou, 1.0 / 6.0);
        assert_eq!((at_10.precision, at_10.recall), (2.0 / 3.0, 0.5));
        assert_eq!(at_10.iou, 2.0 / 5.0);
    }

    /// A unit segment 0.007 beside the truth: EMAP's cells of 0.0078 halve the
    /// number of points, CurveGaussian's of 0.0039 leave it.
    #[test]
    fn protocols_differ_in_their_points() {
        let at = |y: f64| Wireframe3d {
            junctions: vec![Vector3::new(0.0, y, 0.1), Vector3::new(1.0, y, 0.1)],
            edges: vec![[0, 1]],
        };
        let truth = GroundTruth {
            wireframe: at(0.1),
            curves: Vec::new(),
        };
        let predicted = EdgeModel::from(at(0.107));
        let evaluate = |protocol: EdgePoints| protocol.evaluate(&predicted, &truth).unwrap();
        let emap = evaluate(EdgePoints::emap());
        assert_eq!((emap.predicted_points, emap.true_points), (129, 199));
        assert_eq!(evaluate(EdgePoints::curve_gaussian()).predicted_points, 199);
        let edges = evaluate(EdgePoints::edge_gaussians());
        assert_eq!(edges.predicted_points, 199);
        assert!((edges.accuracy.unwrap() - 0.007).abs() < 1e-12);
        let precision: Vec<f64> = edges.thresholds.iter().map(|t| t.precision).collect();
        assert_eq!(precision, [0.0, 1.0, 1.0]);
        let nef = evaluate(EdgePoints::nef());
        assert_eq!((nef.predicted_points, nef.true_points), (65, 2));

        // A CAD model of size 2 is sampled twice as densely.
        let halved = EdgePoints {
            truth_spacing_scale: 0.5,
            ..EdgePoints::emap()
        };
        assert_eq!(evaluate(halved).true_points, 399);
    }

    #[test]
    fn nothing_predicted_scores_nothing_and_no_truth_is_an_error() {
        let truth = GroundTruth {
            wireframe: Wireframe3d {
                junctions: on_x(&[0.0, 1.0]),
                edges: vec![[0, 1]],
            },
            curves: Vec::new(),
        };
        let scores = EdgePoints::emap()
            .evaluate(&EdgeModel::default(), &truth)
            .unwrap();
        assert_eq!((scores.accuracy, scores.completeness), (None, None));
        assert!(scores.thresholds.iter().all(|t| t.f_score == 0.0));
        let none = GroundTruth::default();
        assert!(
            EdgePoints::emap()
                .evaluate(&EdgeModel::default(), &none)
                .is_err()
        );
    }
}
