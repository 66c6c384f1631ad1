//! NEAT on ABC: precision and recall of junctions and segments.
//!
//! Source: NEAT (CVPR 2024), supplement E, Table 6; `evaluation/eval-abc.py` of
//! cherubicXN/neat. Predictions and truth are paired one to one with the smallest
//! sum of distances, and pairs count whose distance is below the threshold, in
//! the unit of a normalised object. The paper measures a segment by the larger
//! of its two end distances, the published code by their mean: both are here.
//!
//! The published script takes junctions from before the visibility check and
//! segments from after it. A result may hold both graphs; then both are measured
//! in full.

use crate::EvalError;
use crate::counts::WireframeCounts;
use crate::table::Table;
use neat_core::Wireframe3d;
use neat_wireframe::metrics::{
    IdealBaseline, Matching, MetricsError, NearPairs, PrecisionRecall, SegmentDistance,
    junction_distances, precision_recall, segment_distances,
};
use neat_wireframe::validity::check_wireframe;
use serde::{Deserialize, Serialize};

/// What to measure, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NeatAbc {
    /// Thresholds of precision and recall, in world units of the truth.
    pub thresholds: Vec<f64>,
    /// How predictions are paired with the truth.
    pub matching: Matching,
}

impl Default for NeatAbc {
    fn default() -> Self {
        Self {
            thresholds: vec![0.01, 0.02, 0.05],
            matching: Matching::default(),
        }
    }
}

/// Agreement of a result with a true wireframe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NeatAbcScores {
    /// Size of the truth.
    pub truth: WireframeCounts,
    /// How predictions were paired with the truth.
    pub matching: Matching,
    /// The result itself.
    pub wireframe: GraphScores,
    /// The graph before the visibility check, where it was given.
    pub before_visibility: Option<GraphScores>,
    /// What of the truth the 2D wireframes of its views would allow, where these were given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ideal_baseline: Option<IdealBaseline>,
}

/// Agreement of one graph with a true one, one entry per threshold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraphScores {
    /// Size of the graph.
    pub counts: WireframeCounts,
    /// Of the junctions, isolated ones included.
    pub junctions: Vec<PrecisionRecall>,
    /// Of the segments, by the larger end distance (the paper's text).
    pub segments_max: Vec<PrecisionRecall>,
    /// Of the segments, by the mean end distance (the published code).
    pub segments_mean: Vec<PrecisionRecall>,
}

impl NeatAbcScores {
    pub(crate) fn tables(&self) -> Vec<Table> {
        let matching = match self.matching {
            Matching::MinimumSum => "one matching with the smallest sum of distances",
            Matching::PerThreshold => "the best matching per threshold",
        };
        let table = |name: &str, graph: &GraphScores| {
            let (counts, truth) = (&graph.counts, &self.truth);
            graph.table(format!("{name}: {counts}. Truth: {truth}; {matching}."))
        };
        let before = self.before_visibility.iter();
        let ideal = self.ideal_baseline.iter();
        std::iter::once(table("Wireframe", &self.wireframe))
            .chain(before.map(|before| table("Before the visibility check", before)))
            .chain(ideal.map(|ideal| self.ideal_table(ideal)))
            .collect()
    }

    /// The right half of Table 6.
    fn ideal_table(&self, ideal: &IdealBaseline) -> Table {
        let row = |name: &str, of: usize, found: usize| {
            let rate = found as f64 / of as f64;
            let rate = if of == 0 {
                "-".into()
            } else {
                format!("{rate:.3}")
            };
            vec![name.to_owned(), of.to_string(), found.to_string(), rate]
        };
        let title = "Ideal baseline: what a 2D junction, or both ends of a 2D segment, shows within 5 px in any view.";
        let mut table = Table::new(title, &["", "true", "shown", "rate"]);
        table.rows = vec![
            row("junctions", self.truth.junctions, ideal.junctions),
            row("segments", self.truth.segments, ideal.segments),
        ];
        table
    }
}

impl GraphScores {
    fn table(&self, title: String) -> Table {
        let mut table = Table::new(title, &[""]);
        for letter in ["P", "R"] {
            let thresholds = self.junctions.iter();
            table
                .header
                .extend(thresholds.map(|score| format!("{letter} {}", score.threshold)));
        }
        let row = |name: &str, scores: &[PrecisionRecall]| {
            let mut cells = vec![name.to_owned()];
            cells.extend(scores.iter().map(|s| format!("{:.3}", s.precision)));
            cells.extend(scores.iter().map(|s| format!("{:.3}", s.recall)));
            cells
        };
        table.rows = vec![
            row("junctions", &self.junctions),
            row("segments, larger end distance", &self.segments_max),
            row("segments, mean end distance", &self.segments_mean),
        ];
        table
    }
}

impl NeatAbc {
    /// Measures `predicted`, and the graph that it was before the visibility
    /// check if there is one, against `truth`, all in one frame.
    ///
    /// # Errors
    /// If a wireframe is not valid, see [`MetricsError`].
    ///
    /// # Example
    /// ```
    /// use nalgebra::Vector3;
    /// use neat_core::Wireframe3d;
    /// use neat_eval::NeatAbc;
    ///
    /// let truth = Wireframe3d {
    ///     junctions: vec![Vector3::zeros(), Vector3::x()],
    ///     edges: vec![[0, 1]],
    /// };
    /// let predicted = truth.map(|p| p + Vector3::new(0.0, 0.015, 0.0));
    /// let scores = NeatAbc::default().evaluate(&predicted, None, &truth)?;
    /// let recall: Vec<f64> = scores.wireframe.segments_max.iter().map(|s| s.recall).collect();
    /// assert_eq!(recall, [0.0, 1.0, 1.0]); // at 0.01, 0.02 and 0.05
    /// # Ok::<(), neat_eval::EvalError>(())
    /// ```
    pub fn evaluate(
        &self,
        predicted: &Wireframe3d,
        before_visibility: Option<&Wireframe3d>,
        truth: &Wireframe3d,
    ) -> Result<NeatAbcScores, EvalError> {
        check_wireframe(&truth.junctions, &truth.edges).map_err(MetricsError::Truth)?;
        Ok(NeatAbcScores {
            truth: WireframeCounts::of(truth),
            matching: self.matching,
            wireframe: self.compare(predicted, truth)?,
            before_visibility: before_visibility
                .map(|before| self.compare(before, truth))
                .transpose()?,
            ideal_baseline: None,
        })
    }

    fn compare(
        &self,
        predicted: &Wireframe3d,
        truth: &Wireframe3d,
    ) -> Result<GraphScores, MetricsError> {
        check_wireframe(&predicted.junctions, &predicted.edges).map_err(MetricsError::Predicted)?;
        let at = &self.thresholds;
        let (ours, true_ones) = (predicted.segments(), truth.segments());
        let segments = |kind| match self.matching {
            Matching::MinimumSum => {
                precision_recall(&segment_distances(&ours, &true_ones, kind)?, at)
            }
            Matching::PerThreshold => {
                Ok(NearPairs::of_segments(&ours, &true_ones, kind, at)?.precision_recall())
            }
        };
        let (ours, true_ones) = (&predicted.junctions, &truth.junctions);
        let junctions = match self.matching {
            Matching::MinimumSum => precision_recall(&junction_distances(ours, true_ones)?, at)?,
            Matching::PerThreshold => {
                NearPairs::of_junctions(ours, true_ones, at)?.precision_recall()
            }
        };
        Ok(GraphScores {
            counts: WireframeCounts::of(predicted),
            junctions,
            segments_max: segments(SegmentDistance::Max)?,
            segments_mean: segments(SegmentDistance::Mean)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use neat_wireframe::validity::WireframeFlaw;

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
        let scores = NeatAbc::default()
            .evaluate(&wireframe, None, &wireframe)
            .unwrap();
        assert_eq!(scores.wireframe.counts.mean_length, Some(1.5));
        let graph = scores.wireframe;
        for list in [&graph.junctions, &graph.segments_max, &graph.segments_mean] {
            assert_eq!(list.len(), 3);
            assert!(list.iter().all(|s| s.precision == 1.0 && s.recall == 1.0));
        }
        assert_eq!(scores.before_visibility, None);
    }

    /// By hand: the check removed one of two edges, and with it a junction.
    #[test]
    fn both_graphs_are_measured() {
        let truth = l_shape(0.0);
        let mut after = l_shape(0.0);
        after.edges.pop();
        after.junctions.truncate(2);
        let scores = NeatAbc::default()
            .evaluate(&after, Some(&l_shape(0.03)), &truth)
            .unwrap();
        let first = |list: &[PrecisionRecall]| (list[0].precision, list[0].recall);
        assert_eq!(first(&scores.wireframe.junctions), (1.0, 0.5));
        assert_eq!(first(&scores.wireframe.segments_max), (1.0, 0.5));
        let before = scores.before_visibility.unwrap();
        // Lifted by 0.03: only the isolated junction, which is not, and at 0.05 all.
        assert_eq!(first(&before.junctions), (0.25, 0.25));
        assert_eq!(first(&before.segments_mean), (0.0, 0.0));
        assert_eq!(before.segments_mean[2].recall, 1.0);
    }

    #[test]
    fn nothing_scores_nothing() {
        let scores = NeatAbc::default()
            .evaluate(&Wireframe3d::default(), None, &l_shape(0.0))
            .unwrap();
        assert_eq!(scores.wireframe.counts.mean_length, None);
        assert_eq!(scores.wireframe.segments_max[2].recall, 0.0);
    }

    #[test]
    fn broken_wireframes_are_refused() {
        let mut nan = l_shape(0.0);
        nan.junctions[2].y = f64::NAN;
        let evaluate = |predicted: &Wireframe3d, truth: &Wireframe3d| match NeatAbc::default()
            .evaluate(predicted, None, truth)
        {
            Err(EvalError::Metrics(error)) => error,
            other => panic!("{other:?}"),
        };
        let flaw = WireframeFlaw::NonFiniteJunction { junction: 2 };
        assert_eq!(evaluate(&nan, &l_shape(0.0)), MetricsError::Predicted(flaw));
        assert_eq!(evaluate(&l_shape(0.0), &nan), MetricsError::Truth(flaw));
        let mut dangling = l_shape(0.0);
        dangling.edges.push([0, 4]);
        evaluate(&dangling, &l_shape(0.0));
    }
}
