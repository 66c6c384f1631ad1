//! Polygons in a plane.

use nalgebra::Vector2;

/// Area, positive if the points run counterclockwise.
pub(super) fn signed_area(polygon: &[Vector2<f64>]) -> f64 {
    let twice: f64 = sides(polygon).map(|[a, b]| a.perp(&b)).sum();
    0.5 * twice
}

/// Whether a point lies inside, by the even-odd rule.
pub(super) fn contains(polygon: &[Vector2<f64>], point: &Vector2<f64>) -> bool {
    let crossings = sides(polygon).filter(|[a, b]| {
        (a.y > point.y) != (b.y > point.y)
            && point.x < a.x + (point.y - a.y) * (b.x - a.x) / (b.y - a.y)
    });
    crossings.count() % 2 == 1
}

/// Whether two sides cross. They may touch, and lie on one line.
pub(super) fn crosses_itself(polygon: &[Vector2<f64>]) -> bool {
    let all: Vec<[Vector2<f64>; 2]> = sides(polygon).collect();
    let count = all.len();
    (0..count).any(|i| {
        (i + 2..count).any(|j| (i, j) != (0, count - 1) && segments_cross(&all[i], &all[j]))
    })
}

fn sides(polygon: &[Vector2<f64>]) -> impl Iterator<Item = [Vector2<f64>; 2]> + '_ {
    (0..polygon.len()).map(|k| [polygon[k], polygon[(k + 1) % polygon.len()]])
}

/// Whether two straight pieces cross; touching is none.
pub(super) fn segments_cross([a, b]: &[Vector2<f64>; 2], [c, d]: &[Vector2<f64>; 2]) -> bool {
    let side =
        |from: &Vector2<f64>, to: &Vector2<f64>, p: &Vector2<f64>| (to - from).perp(&(p - from));
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_and_a_bow_tie() {
        let square: Vec<Vector2<f64>> = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
            .map(Vector2::from)
            .to_vec();
        assert_eq!(signed_area(&square), 4.0);
        assert!(contains(&square, &Vector2::new(1.5, 0.5)));
        assert!(!contains(&square, &Vector2::new(2.5, 0.5)));
        assert!(!crosses_itself(&square));
        let bow_tie = [0, 2, 1, 3].map(|k| square[k]);
        assert!(crosses_itself(&bow_tie));
        let notched = [
            [0.0, 0.0],
            [3.0, 0.0],
            [3.0, 2.0],
            [2.0, 2.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [0.0, 2.0],
        ];
        assert!(!crosses_itself(&notched.map(Vector2::from)));
    }
}
