//! Recall of the true edges by their length, and by the number of views that see them.

use super::line_samples::LineSamples;
use serde::{Deserialize, Serialize};

/// Bounds between lengths, in metres of a house (times the scale).
///
/// A detector works in pixels, so each bin is twice as long as the one before. At 10 m from
/// a camera of 860 px, 0.25 m are 22 px, about the shortest that detectors find reliably;
/// 0.5 m is where the row of long edges begins, which is the two upper bins together.
pub(super) const LENGTHS: [f64; 3] = [0.25, 0.5, 1.0];

/// The fewest views of each bin. Less than three do not confirm a line: two always agree.
/// With three or four there is one to spare; from there on each bin has twice the views.
pub(super) const VIEWS: [usize; 4] = [0, 3, 5, 9];

/// Recall of some of the true edges: those longer than `from` and at most as long as `to`,
/// or those that at least `from` and at most `to` views see.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecallBin {
    /// A length in the unit of the truth, or a number of views.
    pub from: f64,
    /// The same; `None` without bound.
    pub to: Option<f64>,
    /// Length of these edges.
    pub length: f64,
    /// Share of it that is found, one number per threshold; `None` where there are none.
    pub recall: Option<Vec<f64>>,
}

/// Samples of the true edges with their distances from the result.
pub(super) struct Recall<'a> {
    pub samples: &'a LineSamples,
    pub distances: &'a [Option<f64>],
    pub thresholds: &'a [f64],
}

impl Recall<'_> {
    /// Shares of the length of the edges with `is_asked`, by threshold; `None` if there are
    /// no such edges.
    pub(super) fn of(&self, is_asked: impl Fn(usize) -> bool) -> (f64, Option<Vec<f64>>) {
        let length = self.samples.length_of(|_, edge| is_asked(edge));
        let found = |threshold: &f64| {
            let is_near = |sample: usize| self.distances[sample].is_some_and(|d| d <= *threshold);
            let near = (self.samples).length_of(|sample, edge| is_asked(edge) && is_near(sample));
            near / length
        };
        let shares = || self.thresholds.iter().map(found).collect();
        (length, (length > 0.0).then(shares))
    }

    /// One bin of edges, by a number that every edge has.
    fn bin(&self, from: f64, to: Option<f64>, is_in: impl Fn(usize) -> bool) -> RecallBin {
        let (length, recall) = self.of(is_in);
        RecallBin {
            from,
            to,
            length,
            recall,
        }
    }

    /// By the lengths of the edges, between the bounds [`LENGTHS`] times `scale`.
    pub(super) fn by_length(&self, lengths: &[f64], scale: f64) -> Vec<RecallBin> {
        let bounds = LENGTHS.map(|length| length * scale);
        let from = std::iter::once(0.0).chain(bounds);
        let to = bounds.map(Some).into_iter().chain([None]);
        from.zip(to)
            .map(|(from, to)| {
                let is_in = |edge: usize| {
                    lengths[edge] > from && to.is_none_or(|bound| lengths[edge] <= bound)
                };
                self.bin(from, to, is_in)
            })
            .collect()
    }

    /// By the number of views that see each edge.
    pub(super) fn by_views(&self, views: &[usize]) -> Vec<RecallBin> {
        let to = VIEWS[1..].iter().map(|&next| Some(next - 1)).chain([None]);
        (VIEWS.into_iter().zip(to))
            .map(|(from, to)| {
                let is_in =
                    |edge: usize| views[edge] >= from && to.is_none_or(|most| views[edge] <= most);
                self.bin(from as f64, to.map(|most| most as f64), is_in)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use neat_core::LineSegment3;

    #[test]
    fn every_edge_is_in_one_bin() {
        let lengths = [0.25, 0.3, 0.5, 1.0, 4.0];
        let lines = lengths.map(|x| LineSegment3::new(Vector3::zeros(), Vector3::x() * x));
        let samples = LineSamples::new(&lines, 0.01, "").unwrap();
        // Found is all of the first two lines, at 2; nothing at 1.
        let first = samples.length_of(|_, line| line < 2);
        let mut distances = vec![None; samples.points.len()];
        distances[..55].fill(Some(1.5));
        assert!((first - 0.55).abs() < 1e-12);
        let recall = Recall {
            samples: &samples,
            distances: &distances,
            thresholds: &[1.0, 2.0],
        };
        let bins = recall.by_length(&lengths, 1.0);
        let of = |bins: &[RecallBin]| -> Vec<f64> { bins.iter().map(|bin| bin.length).collect() };
        for (found, expected) in of(&bins).iter().zip([0.25, 0.8, 1.0, 4.0]) {
            assert!((found - expected).abs() < 1e-12, "{found}");
        }
        assert_eq!(bins[0].recall, Some(vec![0.0, 1.0]));
        let second = bins[1].recall.as_ref().unwrap()[1];
        assert!((second - 0.3 / 0.8).abs() < 1e-12);
        assert_eq!((bins[3].from, bins[3].to), (1.0, None));
        // Half the scale: the bounds are halved, too.
        assert!((of(&recall.by_length(&lengths, 0.5))[3] - 5.0).abs() < 1e-12);

        let bins = recall.by_views(&[2, 3, 4, 5, 8]);
        for (found, expected) in of(&bins).iter().zip([0.25, 0.8, 5.0, 0.0]) {
            assert!((found - expected).abs() < 1e-12, "{found}");
        }
        assert_eq!(bins[3].recall, None);
        assert_eq!((bins[1].from, bins[1].to), (3.0, Some(4.0)));
    }
}
