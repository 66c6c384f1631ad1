//! Simple polygons in the plane.

use crate::LineSegment2;
use nalgebra::Vector2;

/// A simple polygon, convex or not; the last vertex joins the first.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Polygon {
    vertices: Vec<Vector2<f64>>,
}

impl Polygon {
    /// The polygon through `vertices`, in order.
    pub(super) fn new(vertices: Vec<Vector2<f64>>) -> Self {
        Self { vertices }
    }

    /// The sides, each from one vertex to the next.
    fn sides(&self) -> impl Iterator<Item = LineSegment2> {
        let ends = self.vertices.iter().cycle().skip(1);
        self.vertices
            .iter()
            .zip(ends)
            .map(|(start, end)| LineSegment2::new(*start, *end))
    }

    /// Whether `point` lies inside, by the parity of the sides to its right.
    pub(super) fn contains(&self, point: &Vector2<f64>) -> bool {
        self.sides()
            .filter(|side| (side.start.y > point.y) != (side.end.y > point.y))
            .filter(|side| {
                let t = (point.y - side.start.y) / (side.end.y - side.start.y);
                point.x < side.start.x + t * (side.end.x - side.start.x)
            })
            .count()
            % 2
            == 1
    }

    /// The point of the outline nearest to `point`.
    pub(super) fn closest_point_on_outline(&self, point: &Vector2<f64>) -> Vector2<f64> {
        self.sides()
            .map(|side| side.point_at(side.line_parameter(point).clamp(0.0, 1.0)))
            .min_by(|a, b| {
                (a - point)
                    .norm_squared()
                    .total_cmp(&(b - point).norm_squared())
            })
            .unwrap_or(*point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn l_shape() -> Polygon {
        let corners = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)];
        Polygon::new(
            corners
                .map(|(x, y)| Vector2::new(f64::from(x), f64::from(y)))
                .to_vec(),
        )
    }

    #[test]
    fn the_notch_is_outside() {
        let polygon = l_shape();
        assert!(polygon.contains(&Vector2::new(0.5, 1.5)));
        assert!(polygon.contains(&Vector2::new(1.5, 0.5)));
        assert!(!polygon.contains(&Vector2::new(1.5, 1.5)));
        assert!(!polygon.contains(&Vector2::new(-0.1, 1.0)));
    }

    #[test]
    fn the_outline_is_nearest_at_a_side_or_at_a_corner() {
        let polygon = l_shape();
        let on_side = polygon.closest_point_on_outline(&Vector2::new(1.4, 1.9));
        assert_eq!(on_side, Vector2::new(1.0, 1.9));
        let at_corner = polygon.closest_point_on_outline(&Vector2::new(3.0, -1.0));
        assert_eq!(at_corner, Vector2::new(2.0, 0.0));
    }
}
