//! Exact hidden-line removal among boxes.

use crate::blocks::Block;
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment3;

/// Boxes are this much smaller when they hide something, so that an edge is not
/// hidden by the faces that carry it.
const SHRINKAGE: f64 = 1e-7;
/// Parameters this near to an end of an edge are the end.
const END: f64 = 1e-5;

/// A stretch of an edge that can be seen.
pub struct VisibleStretch {
    /// The edge's index, twelve per box.
    pub edge: usize,
    /// The whole edge.
    pub segment: LineSegment3,
    /// Its visible parameters.
    pub range: [f64; 2],
}

/// The stretches of all edges that can be seen from `center`, which lies outside
/// all boxes, edge by edge.
pub fn visible_stretches(boxes: &[Block], center: &Vector3<f64>) -> Vec<VisibleStretch> {
    let cones: Vec<Cone> = boxes.iter().map(|block| Cone::new(block, center)).collect();
    let mut visible = Vec::new();
    let mut edge = 0;
    for (block, cone) in boxes.iter().zip(&cones) {
        let hiders: Vec<&Block> = boxes
            .iter()
            .zip(&cones)
            .filter(|(_, other)| other.may_hide(cone))
            .map(|(other, _)| other)
            .collect();
        for segment in block.segments() {
            let hidden = hiders
                .iter()
                .filter_map(|hider| hidden_range(&segment, hider, center))
                .collect();
            visible.extend(complement(hidden).into_iter().map(|range| VisibleStretch {
                edge,
                segment,
                range,
            }));
            edge += 1;
        }
    }
    visible
}

/// The cone around a box's bounding sphere, with its apex in the camera.
struct Cone {
    direction: Vector3<f64>,
    half_angle: f64,
    nearest: f64,
    farthest: f64,
}

impl Cone {
    fn new(block: &Block, apex: &Vector3<f64>) -> Self {
        let offset = block.center - apex;
        let (distance, radius) = (offset.norm(), block.half_sides.norm());
        Self {
            direction: offset / distance,
            half_angle: (radius / distance).min(1.0).asin(),
            nearest: distance - radius,
            farthest: distance + radius,
        }
    }

    fn may_hide(&self, other: &Self) -> bool {
        let angle = self.direction.dot(&other.direction).min(1.0).acos();
        self.nearest < other.farthest && angle <= self.half_angle + other.half_angle + 1e-6
    }
}

/// The parameters of `edge` at which `block` stands between it and `center`.
///
/// The triangle of sight lines is `center + u (start − center) + v (end − start)`
/// with 0 ≤ v ≤ u ≤ 1. The box cuts a convex polygon from it, and a point of the
/// polygon hides the parameter v / u.
fn hidden_range(edge: &LineSegment3, block: &Block, center: &Vector3<f64>) -> Option<[f64; 2]> {
    let in_block = |vector: Vector3<f64>| block.world_from_block.tr_mul(&vector);
    let from_block = in_block(center - block.center);
    let by_u = in_block(edge.start - center);
    let by_v = in_block(edge.end - edge.start);
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]];
    let mut polygon: Vec<Vector2<f64>> = corners.map(Vector2::from).to_vec();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let beyond_face = |p: &Vector2<f64>| {
                sign * (from_block[axis] + p.x * by_u[axis] + p.y * by_v[axis])
                    - (block.half_sides[axis] - SHRINKAGE)
            };
            polygon = clip(&polygon, beyond_face);
        }
    }
    let mut range: Option<[f64; 2]> = None;
    for t in polygon.iter().filter(|p| p.x > 0.0).map(|p| p.y / p.x) {
        let [low, high] = range.unwrap_or([t, t]);
        range = Some([low.min(t), high.max(t)]);
    }
    range
}

/// The part of a convex polygon where a linear function is not positive
/// (Sutherland and Hodgman 1974).
fn clip(polygon: &[Vector2<f64>], beyond: impl Fn(&Vector2<f64>) -> f64) -> Vec<Vector2<f64>> {
    let mut clipped = Vec::with_capacity(polygon.len() + 1);
    for (i, corner) in polygon.iter().enumerate() {
        let next = &polygon[(i + 1) % polygon.len()];
        let (here, there) = (beyond(corner), beyond(next));
        if here <= 0.0 {
            clipped.push(*corner);
        }
        if (here <= 0.0) != (there <= 0.0) {
            clipped.push(corner + (next - corner) * (here / (here - there)));
        }
    }
    clipped
}

/// What the ranges leave of [0, 1], ascending.
fn complement(mut hidden: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    hidden.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut visible = Vec::new();
    let mut seen_from = 0.0;
    for [low, high] in hidden {
        if low > seen_from + END {
            visible.push([seen_from, low]);
        }
        seen_from = high.max(seen_from);
    }
    if seen_from < 1.0 - END {
        visible.push([seen_from, 1.0]);
    }
    visible
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    fn cube(center: Vector3<f64>, half_side: f64) -> Block {
        Block {
            center,
            half_sides: Vector3::repeat(half_side),
            world_from_block: Matrix3::identity(),
        }
    }

    #[test]
    fn a_lone_box_shows_nine_edges_to_a_corner_and_four_to_a_face() {
        let boxes = [cube(Vector3::zeros(), 0.5)];
        let count = |center| visible_stretches(&boxes, &center).len();
        assert_eq!(count(Vector3::new(3.0, 2.5, 2.0)), 9);
        assert_eq!(count(Vector3::new(3.0, 0.1, 0.2)), 4);
        for stretch in visible_stretches(&boxes, &Vector3::new(3.0, 2.5, 2.0)) {
            assert_eq!(stretch.range, [0.0, 1.0]);
        }
    }

    #[test]
    fn a_box_in_front_hides_the_middle_of_an_edge() {
        let edge = LineSegment3::new(Vector3::new(-1.0, 0.0, 0.0), Vector3::new(1.0, 0.0, 0.0));
        let center = Vector3::new(0.0, 0.0, 4.0);
        let front = cube(Vector3::new(0.0, 0.0, 2.0), 0.25);
        let [low, high] = hidden_range(&edge, &front, &center).unwrap();
        // The near face, at z = 2.25, casts a shadow of half width 0.25 · 4 / 1.75.
        let half_width = 0.25 * 4.0 / 1.75;
        assert!((low - (1.0 - half_width) / 2.0).abs() < 1e-6);
        assert!((high - (1.0 + half_width) / 2.0).abs() < 1e-6);
        let behind = cube(Vector3::new(0.0, 0.0, -2.0), 0.25);
        assert_eq!(hidden_range(&edge, &behind, &center), None);
        assert_eq!(
            complement(vec![[0.4, 0.6], [0.1, 0.5]]),
            [[0.0, 0.1], [0.6, 1.0]]
        );
        assert!(complement(vec![[0.0, 1.0]]).is_empty());
    }
}
