//! One triangle: how far a point is from it, and whether a line of sight meets it.
//!
//! A triangle without area is as far as its sides, and hides nothing.

use nalgebra::Vector3;
use neat_core::LineSegment3;

/// Corners in space.
pub(crate) type Triangle = [Vector3<f64>; 3];

/// Of barycentric coordinates: nothing passes between two triangles that share a side.
const SLACK: f64 = 1e-9;

/// Squared distance of `point` from the nearest point of the triangle.
///
/// The foot of the perpendicular counts if it is inside, else the nearest side: the same
/// number as by the regions of Ericson, *Real-Time Collision Detection*, 5.1.5.
pub(crate) fn squared_distance(triangle: &Triangle, point: &Vector3<f64>) -> f64 {
    let [a, b, c] = *triangle;
    let sides = [(a, b), (b, c), (c, a)];
    let normal = (b - a).cross(&(c - a));
    let squared_area = normal.norm_squared();
    let is_beside = |(start, end): &(Vector3<f64>, Vector3<f64>)| {
        normal.dot(&(end - start).cross(&(point - start))) >= 0.0
    };
    if squared_area > 0.0 && sides.iter().all(is_beside) {
        let height = normal.dot(&(point - a));
        return height * height / squared_area;
    }
    let to_side = |(start, end): (_, _)| {
        LineSegment3::new(start, end)
            .distance_to_point(point)
            .powi(2)
    };
    sides.map(to_side).into_iter().fold(f64::INFINITY, f64::min)
}

/// Half the product of two sides and the sine between them.
pub(crate) fn area([a, b, c]: &Triangle) -> f64 {
    0.5 * (b - a).cross(&(c - a)).norm()
}

/// Of length 1, by the order of the corners; `None` without an area.
pub(crate) fn normal([a, b, c]: &Triangle) -> Option<Vector3<f64>> {
    (b - a).cross(&(c - a)).try_normalize(0.0)
}

/// Whether the way from `start` to `end` meets the triangle, from either side (Möller and
/// Trumbore). A way within its plane does not.
pub(crate) fn is_met(triangle: &Triangle, start: &Vector3<f64>, end: &Vector3<f64>) -> bool {
    let [a, b, c] = *triangle;
    let (side, other, way) = (b - a, c - a, end - start);
    let across = way.cross(&other);
    let determinant = side.dot(&across);
    if determinant == 0.0 {
        return false;
    }
    let from_a = start - a;
    let u = from_a.dot(&across) / determinant;
    let turned = from_a.cross(&side);
    let v = way.dot(&turned) / determinant;
    let t = other.dot(&turned) / determinant;
    u >= -SLACK && v >= -SLACK && u + v <= 1.0 + SLACK && (0.0..=1.0).contains(&t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(x: f64, y: f64, z: f64) -> Vector3<f64> {
        Vector3::new(x, y, z)
    }

    const CORNERS: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]];

    #[test]
    fn every_region_has_its_distance() {
        let triangle = CORNERS.map(Vector3::from);
        for (point, squared) in [
            (at(1.0, 1.0, -2.0), 4.0),
            (at(1.0, 1.0, 0.0), 0.0),
            (at(-3.0, -4.0, 0.0), 25.0),
            (at(6.0, 0.0, 1.0), 5.0),
            (at(0.0, 5.0, 0.0), 4.0),
            (at(2.0, -1.0, 0.0), 1.0),
            (at(-1.0, 1.0, 1.0), 2.0),
            // The middle of the slanted side is (2, 1.5), its normal (3, 4) / 5.
            (at(5.0, 5.5, 0.0), 25.0),
        ] {
            for turn in 0..3 {
                let turned = [0, 1, 2].map(|i| triangle[(i + turn) % 3]);
                let found = squared_distance(&turned, &point);
                assert!((found - squared).abs() < 1e-12, "{point}: {found}");
            }
        }
    }

    #[test]
    fn triangles_without_area_are_sides_or_points() {
        let line = [at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(3.0, 0.0, 0.0)];
        assert_eq!(squared_distance(&line, &at(2.0, 2.0, 0.0)), 4.0);
        assert_eq!(
            squared_distance(&[at(1.0, 1.0, 1.0); 3], &at(1.0, 1.0, 3.0)),
            4.0
        );
        assert!(!is_met(&line, &at(1.0, 0.0, -1.0), &at(1.0, 0.0, 1.0)));
    }

    #[test]
    fn a_way_through_the_inside_is_met_and_others_not() {
        let triangle = CORNERS.map(Vector3::from);
        let met = |from: Vector3<f64>, to: Vector3<f64>| is_met(&triangle, &from, &to);
        assert!(met(at(1.0, 1.0, 5.0), at(1.0, 1.0, -5.0)));
        assert!(met(at(1.0, 1.0, -5.0), at(1.0, 1.0, 5.0)));
        assert!(met(at(0.0, 0.0, 1.0), at(0.0, 0.0, -1.0)), "a corner");
        assert!(!met(at(1.0, 1.0, 5.0), at(1.0, 1.0, 1.0)), "too short");
        assert!(!met(at(3.0, 3.0, 5.0), at(3.0, 3.0, -5.0)), "beside it");
        assert!(!met(at(-1.0, 1.0, 0.0), at(5.0, 1.0, 0.0)), "in its plane");
    }

    proptest! {
        /// No point of a fine grid on the triangle is nearer, and one is almost as near.
        #[test]
        fn the_distance_is_that_of_the_nearest_of_many_points(
            corners in prop::array::uniform3(prop::array::uniform3(-2.0..2.0)),
            point in prop::array::uniform3(-3.0..3.0),
        ) {
            let (triangle, point) = (corners.map(Vector3::from), Vector3::from(point));
            let [a, b, c] = triangle;
            let parts = 60;
            let nearest = (0..=parts)
                .flat_map(|i| (0..=parts - i).map(move |j| (i, j)))
                .map(|(i, j)| {
                    let [u, v] = [i, j].map(|k| f64::from(k) / f64::from(parts));
                    (a + u * (b - a) + v * (c - a) - point).norm()
                })
                .fold(f64::INFINITY, f64::min);
            let found = squared_distance(&triangle, &point).sqrt();
            let width = ((b - a).norm() + (c - a).norm()) / f64::from(parts);
            prop_assert!(found <= nearest + 1e-9 && nearest <= found + width, "{found} {nearest}");
        }
    }
}
