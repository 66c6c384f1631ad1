//! Chains of points as curves.

use nalgebra::Vector3;
use neat_core::LineSegment3;

/// The point of a chain of two points or more at a share of its length, from 0 to 1.
pub(super) fn point_along(chain: &[Vector3<f64>], share: f64) -> Vector3<f64> {
    let mut left = share * length_of_chain(chain);
    let last = chain.len() - 2;
    let lengths = chain.windows(2).map(|ends| (ends[1] - ends[0]).norm());
    for (piece, length) in lengths.enumerate() {
        if left <= length || piece == last {
            return chain[piece] + (chain[piece + 1] - chain[piece]) * (left / length);
        }
        left -= length;
    }
    unreachable!("point_along: a chain of {} points", chain.len())
}

/// The length of a chain.
pub(super) fn length_of_chain(chain: &[Vector3<f64>]) -> f64 {
    let pieces = chain.windows(2);
    pieces.map(|ends| (ends[1] - ends[0]).norm()).sum()
}

/// Distance of a point from the nearest of a chain.
pub(super) fn distance_to_chain(chain: &[Vector3<f64>], point: &Vector3<f64>) -> f64 {
    let pieces = chain
        .windows(2)
        .map(|ends| LineSegment3::new(ends[0], ends[1]));
    pieces
        .map(|piece| piece.distance_to_point(point))
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_shares_of_the_length() {
        let corner = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 1.0, 0.0]].map(Vector3::from);
        assert_eq!(point_along(&corner, 0.5), Vector3::new(2.0, 0.0, 0.0));
        assert_eq!(point_along(&corner, 0.875), Vector3::new(3.0, 0.5, 0.0));
        assert_eq!(point_along(&corner, 1.0), corner[2]);
        assert_eq!(length_of_chain(&corner), 4.0);
        assert_eq!(
            distance_to_chain(&corner, &Vector3::new(1.0, 0.0, 2.0)),
            2.0
        );
    }
}
