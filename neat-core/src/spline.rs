//! Smooth curves in space.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Control points that a piece of a cubic curve depends on.
const ORDER: usize = 4;
/// Places of each piece at which a spline is fitted to another curve.
const PLACES: usize = 4;
/// Steps of conjugate gradients at most, and the part of the squared residual at which they end: what
/// rounding leaves.
const MOST_STEPS: usize = 200;
const PRECISION: f64 = 1e-26;
/// Straight pieces of one cubic piece at most, when it is drawn.
const MOST_PIECES: f64 = 64.0;

/// A smooth curve: a uniform cubic B-spline, of which each piece depends on four control points.
///
/// An open one begins at its first control point and ends at its last, where its knots are
/// repeated. A closed one runs around near all of them.
///
/// ```
/// use nalgebra::Vector3;
/// use neat_core::Spline;
///
/// let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
/// let around = Spline {
///     controls: corners.map(|[x, y]| Vector3::new(x, y, 0.0)).to_vec(),
///     closed: true,
/// };
/// assert_eq!(around.pieces(), 4);
/// assert_eq!(around.point_at(0.0), around.point_at(4.0));
/// assert!((around.point_at(0.0) - Vector3::new(5.0 / 6.0, 1.0 / 6.0, 0.0)).norm() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spline {
    /// Control points: at least four, of a closed one at least three.
    pub controls: Vec<Vector3<f64>>,
    /// Whether it runs around.
    pub closed: bool,
}

impl Spline {
    /// The nearest one to a curve, given by its points at shares of its way from 0 to 1, by least
    /// squares at the same shares of its own places. An open one ends where the curve does. `None`
    /// with too few control points, or where the curve has no coordinates.
    pub fn nearest_to(
        curve: impl Fn(f64) -> Vector3<f64>,
        controls: usize,
        closed: bool,
    ) -> Option<Self> {
        let mut spline = Self {
            controls: vec![Vector3::zeros(); controls],
            closed,
        };
        let pieces = spline.pieces();
        if pieces == 0 || controls < ORDER - 1 {
            return None;
        }
        if !closed {
            spline.controls[0] = curve(0.0);
            spline.controls[controls - 1] = curve(1.0);
        }
        let places = || (0..=PLACES * pieces).map(|k| k as f64 / PLACES as f64);
        let weights: Vec<_> = places().map(|place| spline.weights_at(place)).collect();
        let points: Vec<_> = places().map(|place| curve(place / pieces as f64)).collect();
        // What control points lack, by what is lacking at each sample; ends of an open one lack
        // nothing.
        let gathered = |lacking: &dyn Fn(usize) -> Vector3<f64>| {
            let mut sums = vec![Vector3::zeros(); controls];
            for (k, weights) in weights.iter().enumerate() {
                let lacking = lacking(k);
                weights
                    .iter()
                    .for_each(|(control, weight)| sums[*control] += lacking * *weight);
            }
            if !closed {
                (sums[0], sums[controls - 1]) = (Vector3::zeros(), Vector3::zeros());
            }
            sums
        };
        let point = |controls: &[Vector3<f64>], k: usize| -> Vector3<f64> {
            let weighted = weights[k]
                .iter()
                .map(|(control, weight)| controls[*control] * *weight);
            weighted.sum()
        };
        // Conjugate gradients: B-splines are nearly independent, so that few steps do for any
        // number of them.
        let total = |a: &[Vector3<f64>], b: &[Vector3<f64>]| -> f64 {
            a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
        };
        let mut residual = gathered(&|k| points[k] - point(&spline.controls, k));
        let mut along = residual.clone();
        let first = total(&residual, &residual);
        let mut left = first;
        for _ in 0..MOST_STEPS {
            if left <= first * PRECISION {
                break;
            }
            let applied = gathered(&|k| point(&along, k));
            let step = left / total(&along, &applied);
            for control in 0..controls {
                spline.controls[control] += along[control] * step;
                residual[control] -= applied[control] * step;
            }
            let before = std::mem::replace(&mut left, total(&residual, &residual));
            for (along, residual) in along.iter_mut().zip(&residual) {
                *along = residual + *along * (left / before);
            }
        }
        spline.is_valid().then_some(spline)
    }

    /// How many cubic pieces it has.
    pub fn pieces(&self) -> usize {
        match self.closed {
            true => self.controls.len(),
            false => self.controls.len().saturating_sub(ORDER - 1),
        }
    }

    /// The control points that a place depends on and the weights by which their mean is the
    /// point there. Places run from 0 to the number of pieces.
    pub fn weights_at(&self, place: f64) -> [(usize, f64); 4] {
        let (piece, weights) = self.basis(place);
        std::array::from_fn(|k| ((piece + k) % self.controls.len(), weights[k]))
    }

    /// The piece at a place, and the four B-splines of order 4 that are not 0 there (Cox and de
    /// Boor's recursion).
    fn basis(&self, place: f64) -> (usize, [f64; ORDER]) {
        let pieces = self.pieces();
        let piece = (place.max(0.0) as usize).min(pieces.saturating_sub(1));
        // The knots of piece k of a closed one are the integers around it.
        let knot = |offset: isize| {
            let knot = piece as isize + offset;
            if self.closed {
                knot as f64
            } else {
                knot.clamp(0, pieces as isize) as f64
            }
        };
        let mut weights = [1.0, 0.0, 0.0, 0.0];
        for degree in 1..ORDER {
            let mut carried = 0.0;
            for k in 0..degree {
                let [low, high] = [knot(k as isize + 1 - degree as isize), knot(k as isize + 1)];
                let share = weights[k] / (high - low);
                weights[k] = carried + (high - place) * share;
                carried = (place - low) * share;
            }
            weights[degree] = carried;
        }
        (piece, weights)
    }

    /// The point at a place, from 0 to the number of pieces.
    pub fn point_at(&self, place: f64) -> Vector3<f64> {
        let weighted = self.weights_at(place).map(|(k, w)| self.controls[k] * w);
        weighted.into_iter().sum()
    }

    /// Its cubic pieces, by the four control points of each as a Bézier curve.
    pub fn beziers(&self) -> Vec<[Vector3<f64>; 4]> {
        let bezier = |piece: usize| {
            // The cubic through four of its points.
            let at = |third: f64| self.point_at(piece as f64 + third / 3.0);
            let [a, b, c, d] = [at(0.0), at(1.0), at(2.0), at(3.0)];
            let first = (-5.0 * a + 18.0 * b - 9.0 * c + 2.0 * d) / 6.0;
            let second = (2.0 * a - 9.0 * b + 18.0 * c - 5.0 * d) / 6.0;
            [a, first, second, d]
        };
        (0..self.pieces()).map(bezier).collect()
    }

    /// Points along it, from end to end, that turn by about `most` radians from one to the next.
    /// The first and the last of a closed one are the same.
    pub fn points(&self, most: f64) -> Vec<Vector3<f64>> {
        let mut points = vec![self.point_at(0.0)];
        for (piece, controls) in self.beziers().into_iter().enumerate() {
            let legs = [1, 2, 3].map(|k| controls[k] - controls[k - 1]);
            let turn: f64 = legs.windows(2).map(|two| angle(&two[0], &two[1])).sum();
            let count = (turn / most).ceil().clamp(1.0, MOST_PIECES) as usize;
            let place = |k: usize| piece as f64 + k as f64 / count as f64;
            points.extend((1..=count).map(|k| self.point_at(place(k))));
        }
        if let (true, [first, .., last]) = (self.closed, &mut points[..]) {
            *last = *first;
        }
        points
    }

    /// Its length, by chords that turn by a hundredth of a radian.
    pub fn length(&self) -> f64 {
        let points = self.points(0.01);
        points
            .windows(2)
            .map(|ends| (ends[1] - ends[0]).norm())
            .sum()
    }

    /// Whether there are enough control points, all of them numbers, that are not one point.
    pub fn is_valid(&self) -> bool {
        let least = if self.closed { ORDER - 1 } else { ORDER };
        let finite = |point: &Vector3<f64>| point.iter().all(|x| x.is_finite());
        self.controls.len() >= least
            && self.controls.iter().all(finite)
            && self.controls.iter().any(|point| *point != self.controls[0])
    }

    /// The curve that an affine map makes of it, given by what it does with points.
    pub fn map(&self, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        Self {
            controls: self.controls.iter().map(f).collect(),
            closed: self.closed,
        }
    }
}

/// The angle between two directions; 0 if one is none.
fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    let cosine = a.dot(b) / (a.norm() * b.norm());
    if cosine.is_nan() {
        0.0
    } else {
        cosine.clamp(-1.0, 1.0).acos().min(PI)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wavy(count: usize, closed: bool) -> Spline {
        let control = |k: usize| {
            let t = k as f64;
            Vector3::new(t.cos() + 0.1 * t, (1.3 * t).sin(), 0.2 * t)
        };
        Spline {
            controls: (0..count).map(control).collect(),
            closed,
        }
    }

    #[test]
    fn ends_are_control_points_and_weights_are_a_mean() {
        for count in 4..9 {
            let spline = wavy(count, false);
            assert_eq!(spline.pieces(), count - 3);
            assert_eq!(spline.point_at(0.0), spline.controls[0]);
            let end = spline.point_at(spline.pieces() as f64);
            assert!((end - spline.controls[count - 1]).norm() < 1e-12);
            for k in 0..=20 {
                let weights = spline.weights_at(spline.pieces() as f64 * f64::from(k) / 20.0);
                assert!(weights.iter().all(|(_, w)| *w >= -1e-12));
                assert!((weights.iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn it_is_smooth_from_piece_to_piece() {
        for spline in [wavy(9, false), wavy(7, true), wavy(3, true)] {
            let last = spline.pieces();
            let knots = if spline.closed { 0..last } else { 1..last };
            for knot in knots.map(|knot| knot as f64) {
                let around = |by: f64| {
                    let place = knot + by;
                    let wraps = spline.closed && place < 0.0;
                    spline.point_at(if wraps { place + last as f64 } else { place })
                };
                // Differences of first and second order from both sides.
                let h = 1e-3;
                let first = |by: f64| (around(by + 0.5 * h) - around(by - 0.5 * h)) / h;
                let second = |by: f64| (first(by + h) - first(by - h)) / (2.0 * h);
                assert!((first(2.0 * h) - first(-2.0 * h)).norm() < 0.02);
                assert!((second(3.0 * h) - second(-3.0 * h)).norm() < 0.05);
            }
        }
    }

    #[test]
    fn four_control_points_are_a_bezier_curve_and_pieces_are() {
        let spline = wavy(4, false);
        let [bezier] = spline.beziers()[..] else {
            panic!("one piece")
        };
        for k in 0..4 {
            assert!((bezier[k] - spline.controls[k]).norm() < 1e-12);
        }
        let spline = wavy(6, true);
        for (piece, [a, b, c, d]) in spline.beziers().into_iter().enumerate() {
            let middle = (a + 3.0 * (b + c) + d) / 8.0;
            assert!((middle - spline.point_at(piece as f64 + 0.5)).norm() < 1e-12);
        }
    }

    #[test]
    fn the_nearest_spline_is_near() {
        let arc = |sweep: f64| {
            move |share: f64| Vector3::new((sweep * share).cos(), (sweep * share).sin(), 0.5)
        };
        for (sweep, controls, closed) in [(2.0 * PI, 16, true), (2.0, 8, false), (0.3, 4, false)] {
            let spline = Spline::nearest_to(arc(sweep), controls, closed).unwrap();
            for point in spline.points(0.01) {
                let off = (point.xy().norm() - 1.0).abs();
                assert!(off < 1e-4, "{sweep}: {off}");
                assert!((point.z - 0.5).abs() < 1e-12);
            }
            if !closed {
                assert_eq!(spline.controls[0], arc(sweep)(0.0));
                assert_eq!(spline.controls[controls - 1], arc(sweep)(1.0));
            }
        }
        // Another spline is found again.
        for spline in [wavy(9, false), wavy(7, true)] {
            let pieces = spline.pieces() as f64;
            let curve = |share: f64| spline.point_at(share * pieces);
            let again = Spline::nearest_to(curve, spline.controls.len(), spline.closed).unwrap();
            for (found, control) in again.controls.iter().zip(&spline.controls) {
                assert!((found - control).norm() < 1e-9);
            }
        }
        assert!(Spline::nearest_to(arc(1.0), 3, false).is_none());
        assert!(Spline::nearest_to(|_| Vector3::repeat(f64::NAN), 8, true).is_none());
    }

    #[test]
    fn points_follow_it_and_close() {
        let around = Spline {
            controls: (0..16)
                .map(|k| {
                    let (sine, cosine) = (PI * f64::from(k) / 8.0).sin_cos();
                    Vector3::new(2.0 * cosine, sine, 0.0)
                })
                .collect(),
            closed: true,
        };
        let points = around.points(0.05);
        assert_eq!(points[0], points[points.len() - 1]);
        assert!(points.len() > 100 && points.len() < 200);
        // Near the ellipse of its control points, whose perimeter is 9.688.
        assert!((around.length() - 9.688).abs() < 0.3);
        let moved = around.map(|point| 2.0 * point + Vector3::x());
        assert!((moved.length() - 2.0 * around.length()).abs() < 1e-9);
        assert!(
            around.is_valid()
                && !Spline {
                    controls: vec![Vector3::x(); 5],
                    closed: true
                }
                .is_valid()
        );
        assert!(!wavy(3, false).is_valid() && wavy(3, true).is_valid());
    }
}
