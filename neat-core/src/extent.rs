//! How far points reach, without strays: for pictures, which would be small for them.

use nalgebra::SVector;

/// Strays are, along an axis, among this share of the points at each end …
const STRAY: f64 = 0.01;
/// … and farther from the others than this share of their extent.
const BEYOND: f64 = 0.5;

/// The least and the greatest coordinates of the points but for strays; `None` of nothing.
pub fn extent_of_most<const D: usize>(points: &[SVector<f64, D>]) -> Option<[SVector<f64, D>; 2]> {
    let mut corners = [*points.first()?; 2];
    for axis in 0..D {
        let mut values: Vec<f64> = points.iter().map(|point| point[axis]).collect();
        values.sort_by(f64::total_cmp);
        let last = values.len() - 1;
        let strays = (STRAY * values.len() as f64) as usize;
        let (low, high) = (values[strays], values[last - strays]);
        let beyond = BEYOND * (high - low);
        corners[0][axis] = values[0].max(low - beyond);
        corners[1][axis] = values[last].min(high + beyond);
    }
    Some(corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector1, Vector2};

    #[test]
    fn strays_are_few_and_far() {
        let extent = |values: &[f64]| {
            let points: Vec<_> = values.iter().map(|value| Vector1::new(*value)).collect();
            extent_of_most(&points).map(|corners| corners.map(|corner| corner.x))
        };
        let even = |more: &[f64]| {
            let values: Vec<f64> = (0..200)
                .map(f64::from)
                .chain(more.iter().copied())
                .collect();
            extent(&values)
        };
        assert_eq!(even(&[]), Some([0.0, 199.0]));
        let [low, high] = even(&[1e4]).unwrap();
        assert!(low == 0.0 && (199.0..400.0).contains(&high), "{high}");
        // Near the others, or as many as they.
        assert_eq!(even(&[220.0]), Some([0.0, 220.0]));
        assert_eq!(extent(&[0.0, 1.0, 1e4, 1e4 + 1.0]), Some([0.0, 1e4 + 1.0]));
        assert_eq!(extent(&[3.0]), Some([3.0; 2]));
        assert_eq!(extent(&[]), None);
    }

    #[test]
    fn each_axis_has_its_own() {
        let points = [[1.0, 5.0], [2.0, 4.0], [0.0, 6.0]].map(Vector2::from);
        let expected = [[0.0, 4.0], [2.0, 6.0]].map(Vector2::from);
        assert_eq!(extent_of_most(&points), Some(expected));
    }
}
