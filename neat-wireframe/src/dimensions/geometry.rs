//! Quantities as functions of positions.

use super::Quantity;
use nalgebra::Vector3;

/// The value of a quantity whose places lie at these points: for edges the ends of one after
/// the other.
pub(super) fn value(quantity: &Quantity, points: &[Vector3<f64>]) -> f64 {
    match (quantity, points) {
        (
            Quantity::Length { .. } | Quantity::Distance { .. } | Quantity::Spacing { .. },
            [a, b],
        ) => (b - a).norm(),
        (Quantity::Radius { .. }, [radius]) => radius.x,
        (Quantity::Gap { .. }, [a, b, c, d]) => gap([a, b], [c, d]),
        (Quantity::Angle { .. }, [a, b, c, d]) => angle(&(b - a), &(d - c)),
        _ => unreachable!(
            "dimensions::value: {quantity:?} has {} points",
            points.len()
        ),
    }
}

fn gap(one: [&Vector3<f64>; 2], other: [&Vector3<f64>; 2]) -> f64 {
    let length = |[a, b]: [&Vector3<f64>; 2]| (b - a).norm();
    let (short, [start, end]) = if length(one) <= length(other) {
        (one, other)
    } else {
        (other, one)
    };
    let along = (end - start).normalize();
    (0.5 * (short[0] + short[1]) - start).cross(&along).norm()
}

/// In degrees, from 0 to 90.
pub(super) fn angle(one: &Vector3<f64>, other: &Vector3<f64>) -> f64 {
    let (sine, cosine) = (one.cross(other).norm(), one.dot(other).abs());
    sine.atan2(cosine).to_degrees()
}

/// How far apart the directions of two edges are, as a vector across both; in degrees where it
/// is small.
pub(super) fn apart(points: &[Vector3<f64>]) -> Vector3<f64> {
    let [a, b, c, d] = points else {
        unreachable!("dimensions::apart: two edges have {} points", points.len());
    };
    let across = (b - a).normalize().cross(&(d - c).normalize());
    across.map(f64::to_degrees)
}
