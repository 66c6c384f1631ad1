//! LIMAP's length recall and precision against a surface.
//!
//! Source: LIMAP (Liu et al., CVPR 2023) §5.1, Table 1; `scripts/eval_hypersim.py`,
//! `scripts/eval_tnt.py` and `limap/evaluation/base_evaluator.cc` of cvg/limap.
//! The inlier ratio of a line is the share of 1000 points, in the middles of as
//! many equal parts, that are at most τ from the surface. R_τ is the length of all
//! lines, each by its ratio, and P_τ the percentage of lines whose ratio is not 0.
//!
//! Lengths are in metres, as of the data sets. The surface is a set of points, as
//! for Tanks and Temples; sample a mesh densely for Hypersim.

use crate::EvalError;
use crate::table::Table;
use crate::total::total;
use nalgebra::Vector3;
use neat_core::LineSegment3;
use neat_wireframe::metrics::{MetricsError, PointCloud};
use neat_wireframe::validity::WireframeFlaw;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The constants.
#[derive(Clone, Debug, PartialEq)]
pub struct LimapLength {
    /// Distances τ, in metres.
    pub thresholds: Vec<f64>,
    /// Points per line.
    pub samples_per_line: usize,
}

/// R_τ and P_τ of some lines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LengthScores {
    /// Number of lines.
    pub lines: usize,
    /// Their length.
    pub total_length: f64,
    /// One entry per threshold.
    pub thresholds: Vec<LengthRecall>,
}

/// R_τ and P_τ at one τ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LengthRecall {
    /// τ: points count that are this near or nearer.
    pub threshold: f64,
    /// R_τ: length of the inlier parts, in the unit of the lines.
    pub length_recall: f64,
    /// P_τ: percentage of lines with an inlier part; 0 without lines.
    pub precision_percent: f64,
}

impl LengthScores {
    pub(crate) fn table(&self) -> Table {
        let title = format!("{} lines, {:.3} m", self.lines, self.total_length);
        let mut table = Table::new(title, &["threshold", "length recall", "precision %"]);
        for score in &self.thresholds {
            table.rows.push(vec![
                score.threshold.to_string(),
                format!("{:.3}", score.length_recall),
                format!("{:.2}", score.precision_percent),
            ]);
        }
        table
    }
}

impl LimapLength {
    /// Hypersim: 1, 5 and 10 mm.
    pub fn hypersim() -> Self {
        Self {
            thresholds: vec![0.001, 0.005, 0.01],
            samples_per_line: 1000,
        }
    }

    /// Tanks and Temples: the script's seven thresholds from 1 mm to 1 m, among
    /// them 5, 10 and 50 mm of the paper's table.
    pub fn tanks_and_temples() -> Self {
        Self {
            thresholds: vec![0.001, 0.005, 0.01, 0.05, 0.1, 0.5, 1.0],
            ..Self::hypersim()
        }
    }

    /// Measures lines against points on the surface.
    ///
    /// # Errors
    /// If an end or a surface point is not finite, or there is no surface point.
    pub fn evaluate(
        &self,
        lines: &[LineSegment3],
        surface: &[Vector3<f64>],
    ) -> Result<LengthScores, EvalError> {
        if surface.is_empty() {
            return Err(EvalError::EmptyTruth {
                protocol: "limap",
                missing: "surface points",
            });
        }
        let is_finite = |line: &LineSegment3| line.length().is_finite();
        if let Some(line) = lines.iter().position(|line| !is_finite(line)) {
            // The junctions of a line are two in a row.
            let flaw = WireframeFlaw::NonFiniteJunction { junction: 2 * line };
            return Err(MetricsError::Predicted(flaw).into());
        }
        let cloud = PointCloud::new(surface)?;
        let parts = self.samples_per_line.max(1);
        // Number of inliers `[lines, thresholds]`.
        let inliers: Vec<Vec<usize>> = lines
            .par_iter()
            .map(|line| {
                let distances: Vec<f64> = (0..parts)
                    .filter_map(|i| cloud.distance(&line.point_at((i as f64 + 0.5) / parts as f64)))
                    .collect();
                let within = |t: &f64| distances.iter().filter(|d| *d <= t).count();
                self.thresholds.iter().map(within).collect()
            })
            .collect();
        let at_threshold = |(index, &threshold): (usize, &f64)| {
            let counts = inliers.iter().map(|counts| counts[index]);
            let length = |(line, count): (&LineSegment3, usize)| {
                line.length() * (count as f64 / parts as f64)
            };
            let hit = counts.clone().filter(|count| *count > 0).count();
            LengthRecall {
                threshold,
                length_recall: total(lines.iter().zip(counts).map(length)),
                precision_percent: 100.0 * hit as f64 / lines.len().max(1) as f64,
            }
        };
        Ok(LengthScores {
            lines: lines.len(),
            total_length: total(lines.iter().map(LineSegment3::length)),
            thresholds: self
                .thresholds
                .iter()
                .enumerate()
                .map(at_threshold)
                .collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(start: [f64; 3], end: [f64; 3]) -> LineSegment3 {
        LineSegment3::new(start.into(), end.into())
    }

    /// A floor of points 0.5 mm apart, of 0.1 m by 0.001 m.
    fn floor() -> Vec<Vector3<f64>> {
        (0..=200)
            .flat_map(|x| (0..=2).map(move |y| (x, y)))
            .map(|(x, y)| Vector3::new(f64::from(x) * 5e-4, f64::from(y) * 5e-4, 0.0))
            .collect()
    }

    #[test]
    fn half_a_line_on_the_floor_counts_half_its_length() {
        let lines = [
            // Leaves the floor in its middle, at x = 0.1.
            line([0.0, 0.0005, 0.0], [0.2, 0.0005, 0.0]),
            // 4 mm above it.
            line([0.0, 0.0005, 0.004], [0.1, 0.0005, 0.004]),
            line([0.0, 0.0, 9.0], [0.0, 5.0, 9.0]),
        ];
        let scores = LimapLength::hypersim().evaluate(&lines, &floor()).unwrap();
        assert_eq!(scores.lines, 3);
        assert!((scores.total_length - 5.3).abs() < 1e-12);
        let [at_1, at_5, at_10] = scores.thresholds[..] else {
            panic!("three thresholds");
        };
        // Samples are 0.2 mm apart: 0.1 m on the floor and 1 mm beyond it.
        assert!((at_1.length_recall - 0.101).abs() < 2.1e-4, "{at_1:?}");
        assert!((at_1.precision_percent - 100.0 / 3.0).abs() < 1e-12);
        assert!(
            (at_5.length_recall - (0.105 + 0.1)).abs() < 2.1e-4,
            "{at_5:?}"
        );
        assert!((at_10.length_recall - (0.11 + 0.1)).abs() < 2.1e-4);
        assert!((at_10.precision_percent - 200.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn four_samples_by_hand() {
        let protocol = LimapLength {
            thresholds: vec![0.5, 1.0],
            samples_per_line: 4,
        };
        // Samples at 0.5, 1.5, 2.5 and 3.5 of a length of 4; the point is at 0.
        let scores = protocol
            .evaluate(&[line([0.0; 3], [4.0, 0.0, 0.0])], &[Vector3::zeros()])
            .unwrap();
        // At 0.5 the first sample counts: at most, not below.
        assert_eq!(scores.thresholds[0].length_recall, 1.0);
        assert_eq!(scores.thresholds[1].length_recall, 1.0);
        assert_eq!(scores.thresholds[1].precision_percent, 100.0);
    }

    #[test]
    fn bad_input_is_refused_and_no_lines_score_nothing() {
        let protocol = LimapLength::tanks_and_temples();
        let fine = line([0.0; 3], [1.0; 3]);
        assert!(protocol.evaluate(&[fine], &[]).is_err());
        let broken = line([0.0; 3], [f64::NAN; 3]);
        assert!(protocol.evaluate(&[fine, broken], &floor()).is_err());
        let scores = protocol.evaluate(&[], &floor()).unwrap();
        assert_eq!(scores.thresholds.len(), 7);
        assert!(scores.thresholds.iter().all(|t| t.precision_percent == 0.0));
    }
}
