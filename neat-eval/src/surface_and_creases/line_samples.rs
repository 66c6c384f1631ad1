//! Points along lines, and how far they are from lines of like direction.

use crate::EvalError;
use crate::box_tree::{Aabb, BoxTree};
use crate::total::total;
use nalgebra::Vector3;
use neat_core::LineSegment3;
use rayon::prelude::*;

/// Shorter lines are points.
const MIN_LENGTH: f64 = 1e-9;
/// More points than these are a mistake in the unit of the lines.
const MAX_SAMPLES: usize = 1 << 23;
/// Lines are indexed in pieces of at most so many times the reach: a long one across the
/// axes would have all in its box.
const PIECE: f64 = 8.0;

/// Points in the middles of equal parts of lines, at least two on each.
pub(super) struct LineSamples {
    pub points: Vec<Vector3<f64>>,
    /// Of every point the line that it is on, by its place in `lines`.
    line_of: Vec<usize>,
    lines: Vec<SampledLine>,
}

/// A line that is no point.
struct SampledLine {
    /// Its index among all that were to be sampled.
    index: usize,
    direction: Vector3<f64>,
    /// The length that each of its samples stands for.
    weight: f64,
}

/// Lines that samples may be near to.
pub(super) struct LineCover {
    pieces: Vec<Piece>,
    tree: BoxTree,
    reach: f64,
    min_cosine: f64,
}

struct Piece {
    segment: LineSegment3,
    direction: Vector3<f64>,
}

impl LineSamples {
    /// Points at most `spacing` apart; `what` is for messages.
    ///
    /// # Errors
    /// If there would be more than 2²³ of them.
    pub(super) fn new(
        segments: &[LineSegment3],
        spacing: f64,
        what: &'static str,
    ) -> Result<Self, EvalError> {
        let mut samples = Self {
            points: Vec::new(),
            line_of: Vec::new(),
            lines: Vec::new(),
        };
        for (index, segment) in segments.iter().enumerate() {
            let length = segment.length();
            if length < MIN_LENGTH {
                continue;
            }
            let parts = (length / spacing).ceil().max(2.0);
            let room = MAX_SAMPLES - samples.points.len();
            // An infinite length has NaN parts, which no range contains.
            if !(0.0..=room as f64).contains(&parts) {
                return Err(EvalError::OutOfScale { what, spacing });
            }
            let middle = |part: usize| segment.point_at((part as f64 + 0.5) / parts);
            samples.points.extend((0..parts as usize).map(middle));
            samples
                .line_of
                .resize(samples.points.len(), samples.lines.len());
            samples.lines.push(SampledLine {
                index,
                direction: (segment.end - segment.start) / length,
                weight: length / parts,
            });
        }
        Ok(samples)
    }

    /// Distance of each sample from the nearest line that runs its way; `None` beyond reach.
    pub(super) fn distances(&self, cover: &LineCover) -> Vec<Option<f64>> {
        let samples = self.points.par_iter().zip(&self.line_of);
        samples
            .map(|(point, &line)| cover.distance(point, &self.lines[line].direction))
            .collect()
    }

    /// The length that the samples that `is_counted` stand for; it is told the index of a
    /// sample and that of its line.
    pub(super) fn length_of(&self, mut is_counted: impl FnMut(usize, usize) -> bool) -> f64 {
        let samples = self.line_of.iter().enumerate();
        let weight = |(sample, &line): (usize, &usize)| {
            let line = &self.lines[line];
            is_counted(sample, line.index).then_some(line.weight)
        };
        total(samples.filter_map(weight))
    }
}

impl LineCover {
    /// Of lines up to `reach` away that are turned by at most `angle` degrees.
    ///
    /// # Errors
    /// If they are so long that something else must be meant.
    pub(super) fn new(
        segments: &[LineSegment3],
        reach: f64,
        angle: f64,
        what: &'static str,
    ) -> Result<Self, EvalError> {
        let spacing = PIECE * reach;
        let mut pieces = Vec::new();
        for segment in segments {
            let length = segment.length();
            if length < MIN_LENGTH {
                continue;
            }
            // A reach of nothing asks for no pieces.
            let parts = if reach > 0.0 {
                (length / spacing).ceil().max(1.0)
            } else {
                1.0
            };
            if !(0.0..=(MAX_SAMPLES - pieces.len()) as f64).contains(&parts) {
                return Err(EvalError::OutOfScale { what, spacing });
            }
            let direction = (segment.end - segment.start) / length;
            let at = |part: usize| segment.point_at(part as f64 / parts);
            pieces.extend((0..parts as usize).map(|part| Piece {
                segment: LineSegment3::new(at(part), at(part + 1)),
                direction,
            }));
        }
        let boxes: Vec<Aabb> = (pieces.iter())
            .map(|piece| Aabb::around(&piece.segment.ends()))
            .collect();
        Ok(Self {
            tree: BoxTree::new(&boxes),
            pieces,
            reach,
            min_cosine: angle.to_radians().cos(),
        })
    }

    fn distance(&self, point: &Vector3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        self.tree.nearest(point, self.reach, |index| {
            let piece = &self.pieces[index];
            match piece.direction.dot(direction).abs() >= self.min_cosine {
                true => piece.segment.distance_to_point(point).powi(2),
                false => f64::INFINITY,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn line(start: [f64; 3], end: [f64; 3]) -> LineSegment3 {
        LineSegment3::new(start.into(), end.into())
    }

    #[test]
    fn samples_are_the_middles_of_parts() {
        let lines = [
            line([5.0; 3], [5.0; 3]),
            line([0.0; 3], [0.95, 0.0, 0.0]),
            line([0.0; 3], [0.0, 0.1, 0.0]),
        ];
        let samples = LineSamples::new(&lines, 0.25, "result").unwrap();
        let x: Vec<f64> = samples.points.iter().map(|p| p.x).collect();
        for (x, expected) in x.iter().zip([0.11875, 0.35625, 0.59375, 0.83125, 0.0, 0.0]) {
            assert!((x - expected).abs() < 1e-15);
        }
        assert_eq!(samples.points.len(), 6);
        assert!((samples.length_of(|_, _| true) - 1.05).abs() < 1e-15);
        assert!((samples.length_of(|_, line| line == 2) - 0.1).abs() < 1e-15);
        assert!((samples.length_of(|sample, _| sample < 2) - 0.475).abs() < 1e-15);
    }

    #[test]
    fn lines_without_end_are_refused() {
        let message = |length: f64| {
            let lines = [line([0.0; 3], [length, 0.0, 0.0])];
            assert!(LineCover::new(&lines, 0.05, 10.0, "result").is_err());
            LineSamples::new(&lines, 0.01, "result")
                .err()
                .unwrap()
                .to_string()
        };
        for length in [1e8, 1e200, f64::MAX] {
            assert!(message(length).contains("the result is too large for points every 0.01"));
        }
    }

    #[test]
    fn only_lines_of_like_direction_are_near() {
        let samples = LineSamples::new(&[line([0.0; 3], [1.0, 0.0, 0.0])], 0.5, "").unwrap();
        let along = |turn: f64| {
            let (sin, cos) = turn.to_radians().sin_cos();
            line([-cos, -sin, 0.01], [cos, sin, 0.01])
        };
        let near = |turn: f64, reach: f64| {
            let cover = LineCover::new(&[along(turn)], reach, 10.0, "").unwrap();
            samples.distances(&cover)[0].is_some()
        };
        assert!(near(9.9, 0.2) && near(-9.9, 0.2) && near(170.1, 0.2));
        assert!(!near(10.1, 0.2) && !near(90.0, 0.2) && !near(0.0, 0.009));
        let nothing = LineCover::new(&[], 0.2, 10.0, "").unwrap();
        assert_eq!(samples.distances(&nothing), [None, None]);
    }

    proptest! {
        #[test]
        fn distances_are_those_of_a_scan_of_all_lines(
            ends in prop::collection::vec(prop::array::uniform6(-1.0..1.0), 2..30),
            reach in 0.0..0.6, angle in 0.0..90.0,
        ) {
            let lines: Vec<_> = (ends.iter())
                .map(|&[a, b, c, d, e, f]| line([a, b, c], [d, e, f]))
                .collect();
            let (of, to) = lines.split_at(lines.len() / 2);
            let samples = LineSamples::new(of, 0.1, "").unwrap();
            let found = samples.distances(&LineCover::new(to, reach, angle, "").unwrap());
            for (index, point) in samples.points.iter().enumerate() {
                let direction = samples.lines[samples.line_of[index]].direction;
                let scanned = (to.iter())
                    .filter(|l| (l.end - l.start).normalize().dot(&direction).abs() >= angle.to_radians().cos())
                    .map(|l| l.distance_to_point(point))
                    .fold(f64::INFINITY, f64::min);
                match found[index] {
                    Some(distance) => prop_assert!((distance - scanned).abs() < 1e-12),
                    None => prop_assert!(scanned > reach - 1e-12),
                }
            }
        }
    }
}
