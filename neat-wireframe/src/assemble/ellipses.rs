//! Ellipses in an image: chains of edgels that go most of the way around one.

use super::curve_pieces::chains;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use neat_core::EdgelMap;
use std::f64::consts::TAU;

/// Fewer edgels are no ellipse: the least circle whose chain is followed has a radius of 3 pixels.
const MIN_EDGELS: usize = 18;
/// Edgels lie so far from an ellipse at most, in pixels (root of the mean square): those of a straight
/// edge lie a third of that beside it, and those of a hexagon of this size more.
const MAX_RESIDUAL: f64 = 0.3;
/// Around an ellipse so much of the way has edgels.
const MIN_AROUND: f64 = 0.6;
/// Parts of the way around that are asked whether they have some.
const PARTS: usize = 24;

/// An ellipse in an image, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ellipse {
    pub center: Vector2<f64>,
    /// Half of its longer and its shorter axis.
    pub axes: [f64; 2],
    /// The direction of the shorter one.
    pub across: Vector2<f64>,
}

impl Ellipse {
    /// Through points, by least squares: x² + y² is a combination of the other terms of a conic.
    fn through(points: &[Vector2<f64>]) -> Option<Self> {
        let count = points.len() as f64;
        let mean = points.iter().sum::<Vector2<f64>>() / count;
        let square: f64 = points
            .iter()
            .map(|point| (point - mean).norm_squared())
            .sum();
        let scale = (square / count).sqrt();
        let mut normal = SMatrix::<f64, 5, 5>::zeros();
        let mut right = SVector::<f64, 5>::zeros();
        for point in points {
            let at = (point - mean) / scale;
            let terms = [
                at.x * at.x - at.y * at.y,
                2.0 * at.x * at.y,
                at.x,
                at.y,
                1.0,
            ];
            let row = SVector::from(terms);
            normal += row * row.transpose();
            right -= at.norm_squared() * row;
        }
        let [long, oblique, x, y, rest] = normal.cholesky()?.solve(&right).into();
        let quadratic = Matrix2::new(1.0 + long, oblique, oblique, 1.0 - long);
        let linear = Vector2::new(x, y);
        let center = -0.5 * quadratic.try_inverse()? * linear;
        let square = -(rest + 0.5 * linear.dot(&center));
        let flat = long.hypot(oblique);
        if flat >= 1.0 || square <= 0.0 {
            return None;
        }
        let (sine, cosine) = (0.5 * oblique.atan2(long)).sin_cos();
        Some(Self {
            center: mean + scale * center,
            axes: [1.0 - flat, 1.0 + flat].map(|factor| scale * (square / factor).sqrt()),
            across: Vector2::new(cosine, sine),
        })
    }

    /// A point in its frame, where it is the unit circle: along the longer and the shorter axis.
    fn in_units(&self, point: &Vector2<f64>) -> Vector2<f64> {
        let off = point - self.center;
        let along = Vector2::new(-self.across.y, self.across.x);
        Vector2::new(
            off.dot(&along) / self.axes[0],
            off.dot(&self.across) / self.axes[1],
        )
    }

    /// How far beside it a point lies, to the first order.
    pub(super) fn distance(&self, point: &Vector2<f64>) -> f64 {
        let at = self.in_units(point);
        let slope = Vector2::new(at.x / self.axes[0], at.y / self.axes[1]).norm();
        (at.norm_squared() - 1.0).abs() / (2.0 * slope)
    }

    /// Which share of the way around it some points go.
    fn share_around(&self, points: &[Vector2<f64>]) -> f64 {
        let mut has = [false; PARTS];
        for point in points {
            let at = self.in_units(point);
            let turn = at.y.atan2(at.x).rem_euclid(TAU) / TAU;
            has[((turn * PARTS as f64) as usize).min(PARTS - 1)] = true;
        }
        has.iter().filter(|has| **has).count() as f64 / PARTS as f64
    }
}

/// The ellipses of an image.
pub(super) fn ellipses(map: &EdgelMap) -> Vec<Ellipse> {
    let of_chain = |chain: Vec<Vector2<f64>>| {
        let ellipse = Ellipse::through(&chain)?;
        let square = |point: &Vector2<f64>| ellipse.distance(point).powi(2);
        let residual = (chain.iter().map(square).sum::<f64>() / chain.len() as f64).sqrt();
        let is_one = residual <= MAX_RESIDUAL && ellipse.share_around(&chain) >= MIN_AROUND;
        is_one.then_some(ellipse)
    };
    (chains(map, |_| true).into_iter())
        .filter(|chain| chain.len() >= MIN_EDGELS)
        .filter_map(of_chain)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::Edgel;

    /// The edgels around an ellipse or a regular polygon, from an angle on.
    fn edgels(at: impl Fn(f64) -> Vector2<f64>, from: f64) -> Vec<Edgel> {
        let count = 90;
        let edgel = |k: usize| {
            let turn = from + (TAU - from) * k as f64 / count as f64;
            let along = (at(turn + 1e-4) - at(turn - 1e-4)).normalize();
            Edgel {
                position: at(turn).cast(),
                normal: Vector2::new(along.y, -along.x).cast(),
            }
        };
        (0..count).map(edgel).collect()
    }

    fn turned(turn: f64) -> Vector2<f64> {
        let across = Vector2::new(0.6_f64, 0.8);
        let along = Vector2::new(-0.8, 0.6);
        let (sine, cosine) = turn.sin_cos();
        Vector2::new(50.0, 40.0) + 12.0 * cosine * along + 8.0 * sine * across
    }

    #[test]
    fn an_ellipse_is_found_by_most_of_it() {
        for (from, count) in [(0.0, 1), (0.35 * TAU, 1), (0.5 * TAU, 0)] {
            let map = EdgelMap::new(&edgels(turned, from), 100, 100);
            let found = ellipses(&map);
            assert_eq!(found.len(), count, "from {from}");
            for ellipse in found {
                assert!((ellipse.center - Vector2::new(50.0, 40.0)).norm() < 1e-3);
                assert!((ellipse.axes[0] - 12.0).abs() < 1e-3);
                assert!((ellipse.axes[1] - 8.0).abs() < 1e-3);
                assert!(ellipse.across.perp(&Vector2::new(0.6, 0.8)).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn a_hexagon_is_none() {
        let hexagon = |turn: f64| {
            let off = (turn.rem_euclid(TAU / 6.0) - TAU / 12.0).cos();
            Vector2::new(50.0, 40.0) + 9.0 / off * Vector2::new(turn.cos(), turn.sin())
        };
        let map = EdgelMap::new(&edgels(hexagon, 0.0), 100, 100);
        assert!(ellipses(&map).is_empty());
    }
}
