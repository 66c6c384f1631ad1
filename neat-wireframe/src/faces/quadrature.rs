//! Integrals along curves.

use nalgebra::Vector3;

/// Places on [0, 1] and their weights, of Gauss and Legendre: exact up to degree 9.
pub(super) const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_4),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

/// Of a cubic by its four control points as a Bézier curve.
pub(super) fn place_and_derivative(
    [a, b, c, d]: &[Vector3<f64>; 4],
    t: f64,
) -> (Vector3<f64>, Vector3<f64>) {
    let s = 1.0 - t;
    let point = a * (s * s * s) + (b * s + c * t) * (3.0 * s * t) + d * (t * t * t);
    let along = ((b - a) * (s * s) + (c - b) * (2.0 * s * t) + (d - c) * (t * t)) * 3.0;
    (point, along)
}
