//! Pairs of predictions and true ones that are near each other, and how many of them can be
//! matched one to one: for thresholds, what is farther plays no role.

use super::precision_recall::{PrecisionRecall, SegmentDistance, segment_distance};
use super::{MAX_PAIRS, MetricsError};
use nalgebra::Vector3;
use neat_core::LineSegment3;
use std::collections::{HashMap, VecDeque};

/// The pairs that are nearer than the largest of some thresholds.
pub struct NearPairs {
    thresholds: Vec<f64>,
    /// For each prediction the true ones near it, with their distances.
    near: Vec<Vec<(usize, f64)>>,
    truth: usize,
}

impl NearPairs {
    /// Of junctions.
    ///
    /// # Errors
    /// If more pairs are near than can be matched.
    pub fn of_junctions(
        predicted: &[Vector3<f64>],
        truth: &[Vector3<f64>],
        thresholds: &[f64],
    ) -> Result<Self, MetricsError> {
        let places = truth.iter().copied().zip(0..);
        Self::new([predicted.len(), truth.len()], thresholds, places, |row| {
            ([predicted[row]].into(), move |column: usize| {
                (predicted[row] - truth[column]).norm()
            })
        })
    }

    /// Of segments; ends must be finite.
    ///
    /// # Errors
    /// If more pairs are near than can be matched.
    pub fn of_segments(
        predicted: &[LineSegment3],
        truth: &[LineSegment3],
        kind: SegmentDistance,
        thresholds: &[f64],
    ) -> Result<Self, MetricsError> {
        let ends = |segment: &LineSegment3| [segment.start, segment.end];
        let places = (truth.iter().zip(0..))
            .flat_map(|(segment, column)| ends(segment).map(|end| (end, column)));
        // Whether by the mean or by the larger distance, one end is near in any case.
        Self::new([predicted.len(), truth.len()], thresholds, places, |row| {
            (ends(&predicted[row]).into(), move |column: usize| {
                segment_distance(&predicted[row], &truth[column], kind)
            })
        })
    }

    /// Of so many predictions and true ones, which are found by `places`. A prediction is asked
    /// for its own places and for its distance from a true one.
    fn new<Distance: Fn(usize) -> f64>(
        [predicted, truth]: [usize; 2],
        thresholds: &[f64],
        places: impl Iterator<Item = (Vector3<f64>, usize)>,
        prediction: impl Fn(usize) -> (Vec<Vector3<f64>>, Distance),
    ) -> Result<Self, MetricsError> {
        let reach = thresholds.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let cell_of = |place: &Vector3<f64>| place.map(|x| (x / reach).floor() as i64);
        let mut cells: HashMap<Vector3<i64>, Vec<usize>> = HashMap::new();
        for (place, column) in places {
            cells.entry(cell_of(&place)).or_default().push(column);
        }
        let mut pairs = 0;
        let near = (0..predicted).map(|row| {
            let (own, distance) = prediction(row);
            let around = own.iter().flat_map(|place| around(cell_of(place)));
            let mut columns: Vec<usize> = around
                .filter_map(|cell| cells.get(&cell))
                .flatten()
                .copied()
                .collect();
            columns.sort_unstable();
            columns.dedup();
            let pair = |column| (column, distance(column));
            let found: Vec<(usize, f64)> = (columns.into_iter().map(pair))
                .filter(|(_, distance)| *distance < reach)
                .collect();
            pairs += found.len();
            match pairs {
                ..=MAX_PAIRS => Ok(found),
                _ => Err(MetricsError::TooManyPairs { predicted, truth }),
            }
        });
        Ok(Self {
            near: near.collect::<Result<_, _>>()?,
            thresholds: thresholds.to_vec(),
            truth,
        })
    }

    /// Precision and recall at each threshold, by the largest possible number of pairs below it.
    pub fn precision_recall(&self) -> Vec<PrecisionRecall> {
        (self.thresholds.iter())
            .map(|threshold| {
                let matched = self.largest_matching(*threshold);
                PrecisionRecall::new(*threshold, matched, [self.near.len(), self.truth])
            })
            .collect()
    }

    /// How many pairs below a threshold can be made at once: each prediction in turn takes a
    /// true one, for which others may have to take another (Berge 1957).
    fn largest_matching(&self, threshold: f64) -> usize {
        let mut row_of: Vec<Option<usize>> = vec![None; self.truth];
        // Which prediction asked for a true one, and in whose turn.
        let mut asked_by: Vec<(usize, usize)> = vec![(usize::MAX, 0); self.truth];
        let mut column_of: Vec<Option<usize>> = vec![None; self.near.len()];
        for turn in 0..self.near.len() {
            let mut queue = VecDeque::from([turn]);
            let mut free = None;
            'search: while let Some(row) = queue.pop_front() {
                let below = |pair: &&(usize, f64)| pair.1 < threshold;
                for &(column, _) in self.near[row].iter().filter(below) {
                    if asked_by[column].0 == turn {
                        continue;
                    }
                    asked_by[column] = (turn, row);
                    match row_of[column] {
                        Some(other) => queue.push_back(other),
                        None => {
                            free = Some(column);
                            break 'search;
                        }
                    }
                }
            }
            // Back along the chain, each takes what it asked for.
            while let Some(column) = free {
                let row = asked_by[column].1;
                row_of[column] = Some(row);
                free = column_of[row].replace(column);
            }
        }
        column_of.iter().flatten().count()
    }
}

/// A cell and those that touch it.
fn around(cell: Vector3<i64>) -> impl Iterator<Item = Vector3<i64>> {
    (0..27).map(move |i| {
        let step = Vector3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
        cell.zip_map(&step, i64::saturating_add)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{junction_distances, segment_distances};
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-1.0..1.0).prop_map(Vector3::from)
    }

    /// The largest number of pairs below a threshold, by an assignment of 0 and 1.
    fn by_assignment(distances: &crate::metrics::DistanceMatrix, threshold: f64) -> usize {
        let costs = distances.map(|d| if d < threshold { 0.0 } else { 1.0 });
        let pairs = costs.assign().unwrap();
        pairs.iter().filter(|pair| pair.distance == 0.0).count()
    }

    proptest! {
        #[test]
        fn as_many_are_matched_as_by_an_assignment(
            a in prop::collection::vec((point(), point()), 0..40),
            b in prop::collection::vec((point(), point()), 0..40),
            thresholds in prop::collection::vec(0.0..2.5, 1..4),
        ) {
            let segment = |(start, end): &(Vector3<f64>, Vector3<f64>)| LineSegment3::new(*start, *end);
            let (a, b): (Vec<_>, Vec<_>) = (a.iter().map(segment).collect(), b.iter().map(segment).collect());
            for kind in [SegmentDistance::Mean, SegmentDistance::Max] {
                let dense = segment_distances(&a, &b, kind).unwrap();
                let near = NearPairs::of_segments(&a, &b, kind, &thresholds).unwrap();
                for score in near.precision_recall() {
                    prop_assert_eq!(score.matched, by_assignment(&dense, score.threshold));
                }
            }
            let starts = |list: &[LineSegment3]| -> Vec<_> { list.iter().map(|s| s.start).collect() };
            let (a, b) = (starts(&a), starts(&b));
            let dense = junction_distances(&a, &b).unwrap();
            let near = NearPairs::of_junctions(&a, &b, &thresholds).unwrap();
            for score in near.precision_recall() {
                prop_assert_eq!(score.matched, by_assignment(&dense, score.threshold));
            }
        }
    }

    /// The first prediction is exact for the first truth, but handing it to the second one
    /// makes the sum of distances smaller.
    #[test]
    fn far_predictions_disturb_no_matching() {
        let on_x = |x: &[f64]| -> Vec<_> { x.iter().map(|x| Vector3::new(*x, 0.0, 0.0)).collect() };
        let (predicted, truth) = (on_x(&[0.0, 0.05]), on_x(&[0.005, -0.145]));
        let near = NearPairs::of_junctions(&predicted, &truth, &[0.01]).unwrap();
        assert_eq!(near.precision_recall()[0].matched, 1);
    }

    #[test]
    fn many_are_matched_and_too_many_near_ones_are_refused() {
        let line: Vec<_> = (0..30_000)
            .map(|i| Vector3::new(f64::from(i), 0.0, 0.0))
            .collect();
        let scores = NearPairs::of_junctions(&line, &line, &[0.5, 1.5]).unwrap();
        assert!(
            scores
                .precision_recall()
                .iter()
                .all(|score| score.recall == 1.0)
        );
        assert!(NearPairs::of_junctions(&line, &line, &[1e4]).is_err());
        let far = Vector3::repeat(f64::MAX);
        assert!(NearPairs::of_junctions(&[far], &[far], &[0.5]).is_ok());
    }
}
