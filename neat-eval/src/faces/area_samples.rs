//! Points spread evenly over triangles.

use crate::triangle::{Triangle, area};
use nalgebra::Vector3;

/// Steps of the R₂ sequence (M. Roberts, *The unreasonable effectiveness of quasirandom
/// sequences*, 2018): 1/φ and 1/φ² with φ³ = φ + 1. Its points leave no gaps, whatever their
/// number.
const R2: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];

/// A point of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct AreaSample {
    pub point: Vector3<f64>,
    /// The triangle, by its place.
    pub triangle: usize,
}

/// Points that each stand for a square of this side: systematic sampling along the sum of all
/// areas, so that no triangle has more than one point too many or too few.
pub(super) fn area_samples(triangles: &[Triangle], side: f64) -> Vec<AreaSample> {
    let step = side * side;
    let (mut samples, mut sum) = (Vec::new(), 0.0);
    for (index, corners) in triangles.iter().enumerate() {
        sum += area(corners);
        while (samples.len() as f64 + 0.5) * step < sum {
            samples.push(AreaSample {
                point: inner_point(corners, samples.len()),
                triangle: index,
            });
        }
    }
    samples
}

fn inner_point([a, b, c]: &Triangle, number: usize) -> Vector3<f64> {
    let [mut u, mut v] = R2.map(|step| (0.5 + step * number as f64).fract());
    // The other half of the square folds onto this one.
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    a + (b - a) * u + (c - a) * v
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_areas_have_equally_many_points() {
        let x = |length: f64| Vector3::new(length, 0.0, 0.0);
        let triangles = [
            [Vector3::zeros(), x(3.0), Vector3::y()],
            [Vector3::zeros(), x(1.0), x(2.0)],
            [
                Vector3::z(),
                x(1.0) + Vector3::z(),
                Vector3::y() + Vector3::z(),
            ],
        ];
        // 400 points for an area of 2.
        let samples = area_samples(&triangles, 0.005_f64.sqrt());
        let of = |index: usize| samples.iter().filter(move |s| s.triangle == index);
        assert_eq!([of(0).count(), of(1).count(), of(2).count()], [300, 0, 100]);
        assert!(of(2).all(|s| s.point.z == 1.0 && s.point.x + s.point.y <= 1.0 + 1e-12));
        // Their mean is the middle of the triangle.
        let mean = of(0).map(|s| s.point).sum::<Vector3<f64>>() / 300.0;
        assert!(
            (mean - Vector3::new(1.0, 1.0 / 3.0, 0.0)).norm() < 0.02,
            "{mean}"
        );
        assert!(area_samples(&[], 1.0).is_empty());
    }
}
