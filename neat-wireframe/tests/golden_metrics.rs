//! Metrics against the published evaluation scripts (golden case 12).

mod golden;

use golden::{Geometry, Golden};
use neat_core::LineSegment3;
use neat_wireframe::Wireframe3d;
use neat_wireframe::metrics::DistanceMatrix;
use neat_wireframe::metrics::{
    NearPairs, PointCloud, SegmentDistance, junction_distances, mean_nearest_distance,
    precision_recall, sample_segments, segment_distances,
};

/// Float64 on both sides: only the order of additions differs.
const TOLERANCE: f64 = 1e-9;

fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        assert!(
            (found - expected).abs() < TOLERANCE,
            "{what}: {found} is not {expected}"
        );
    }
}

struct Case {
    golden: Golden,
    truth: Wireframe3d,
}

impl Case {
    fn read() -> Self {
        let golden = Golden::open("12_metrics");
        let truth = Wireframe3d {
            junctions: golden.points("gt_junctions"),
            edges: golden.index_rows("gt_lines"),
        };
        Self { golden, truth }
    }

    fn assert_scores(&self, distances: &DistanceMatrix, prefix: &str) {
        let thresholds = self.golden.numbers("thresholds");
        let scores = precision_recall(distances, &thresholds).unwrap();
        let precision: Vec<f64> = scores.iter().map(|s| s.precision).collect();
        let recall: Vec<f64> = scores.iter().map(|s| s.recall).collect();
        let expected = |name| self.golden.numbers(&format!("{prefix}{name}"));
        assert_close(&precision, &expected("precision"), prefix);
        assert_close(&recall, &expected("recall"), prefix);
    }

    fn assert_matching(&self, distances: &DistanceMatrix, prefix: &str) {
        let pairs = distances.assign().unwrap();
        let rows: Vec<usize> = pairs.iter().map(|p| p.row).collect();
        let columns: Vec<usize> = pairs.iter().map(|p| p.column).collect();
        let costs: Vec<f64> = pairs.iter().map(|p| p.distance).collect();
        assert_eq!(rows, self.golden.indices(&format!("{prefix}match_pred")));
        assert_eq!(columns, self.golden.indices(&format!("{prefix}match_gt")));
        assert_close(
            &costs,
            &self.golden.numbers(&format!("{prefix}match_cost")),
            prefix,
        );
    }
}

#[test]
fn junction_precision_and_recall() {
    let case = Case::read();
    for set in ["A", "B"] {
        let predicted = case.golden.points(&format!("{set}/junctions"));
        let distances = junction_distances(&predicted, &case.truth.junctions).unwrap();
        case.assert_matching(&distances, &format!("{set}/junction_"));
        case.assert_scores(&distances, &format!("{set}/junctions_"));
    }
}

#[test]
fn segment_precision_and_recall_by_mean_and_by_maximum() {
    let case = Case::read();
    for set in ["A", "B"] {
        let predicted = case.golden.segments(&format!("{set}/lines"));
        for (kind, name) in [
            (SegmentDistance::Mean, "lines_mean"),
            (SegmentDistance::Max, "lines_max"),
        ] {
            let distances = segment_distances(&predicted, &case.truth.segments(), kind).unwrap();
            case.assert_matching(&distances, &format!("{set}/{name}/"));
            case.assert_scores(&distances, &format!("{set}/{name}/"));
        }
        // What the script itself printed is the mean.
        let distances =
            segment_distances(&predicted, &case.truth.segments(), SegmentDistance::Mean).unwrap();
        case.assert_scores(&distances, &format!("{set}/lines_"));
    }
}

#[test]
fn best_matching_per_threshold_finds_no_fewer_pairs() {
    let case = Case::read();
    let thresholds = case.golden.numbers("thresholds");
    for set in ["A", "B"] {
        let predicted = case.golden.segments(&format!("{set}/lines"));
        let truth = case.truth.segments();
        let kind = SegmentDistance::Max;
        let distances = segment_distances(&predicted, &truth, kind).unwrap();
        let by_sum = precision_recall(&distances, &thresholds).unwrap();
        let near = NearPairs::of_segments(&predicted, &truth, kind, &thresholds).unwrap();
        let best = near.precision_recall();
        for (by_sum, best) in by_sum.iter().zip(&best) {
            assert!(best.matched >= by_sum.matched);
        }
    }
}

#[test]
fn accuracy_and_completeness() {
    let case = Case::read();
    let surface = case.golden.points("surface_points");
    let cloud = PointCloud::new(&surface).unwrap();
    for set in ["A", "B"] {
        let lines = case.golden.segments(&format!("{set}/lines"));
        let accuracy = |lines: &[LineSegment3]| {
            mean_nearest_distance(&sample_segments(lines, 32), &cloud, 20.0).unwrap()
        };
        let expected = |name: &str| case.golden.numbers(&format!("{set}/{name}"));
        assert_close(&[accuracy(&lines)], &expected("acc_lines"), set);
        let per_line: Vec<f64> = lines.iter().map(|line| accuracy(&[*line])).collect();
        assert_close(&per_line, &expected("acc_lines_per_line"), set);

        let samples = PointCloud::new(&sample_segments(&lines, 32)).unwrap();
        let completeness = mean_nearest_distance(&surface, &samples, 20.0).unwrap();
        assert_close(&[completeness], &expected("comp_lines"), set);
    }
}
