//! Flat polygonal faces in space.

use super::polygon::Polygon;
use crate::Ray;
use nalgebra::{Vector2, Vector3};

/// A flat face of a solid: a simple polygon, convex or not.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarFace {
    /// Corners, counter-clockwise when seen from outside the solid.
    pub outline: Vec<Vector3<f64>>,
    /// Which junction of the solid's wireframe each corner is.
    pub junctions: Vec<usize>,
    /// Unit normal, away from the solid.
    pub normal: Vector3<f64>,
    /// Orthonormal directions in the plane; with the normal, right-handed.
    tangents: [Vector3<f64>; 2],
    /// The outline in plane coordinates: along the tangents, from corner 0.
    polygon: Polygon,
}

impl PlanarFace {
    /// The face through the given junctions, which must lie in one plane, with
    /// the first two apart.
    pub(super) fn new(junctions: Vec<usize>, positions: &[Vector3<f64>]) -> Self {
        let outline: Vec<_> = junctions.iter().map(|j| positions[*j]).collect();
        // Newell's normal: right for concave outlines too.
        let normal = (0..outline.len())
            .map(|i| outline[i].cross(&outline[(i + 1) % outline.len()]))
            .sum::<Vector3<f64>>()
            .normalize();
        let u = (outline[1] - outline[0]).normalize();
        let tangents = [u, normal.cross(&u)];
        let corners = outline
            .iter()
            .map(|corner| plane_coordinates(&(corner - outline[0]), &tangents));
        Self {
            polygon: Polygon::new(corners.collect()),
            outline,
            junctions,
            normal,
            tangents,
        }
    }

    /// Signed distance from the face's infinite plane, positive outside.
    pub fn plane_distance(&self, point: &Vector3<f64>) -> f64 {
        (point - self.outline[0]).dot(&self.normal)
    }

    /// The point of the face nearest to `point`.
    pub fn closest_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let foot = self.to_plane(point);
        let nearest = if self.polygon.contains(&foot) {
            foot
        } else {
            self.polygon.closest_point_on_outline(&foot)
        };
        self.outline[0] + self.tangents[0] * nearest.x + self.tangents[1] * nearest.y
    }

    /// Distance along `ray` at which it crosses the face, from either side.
    /// `None` if it misses or runs parallel.
    pub fn intersect(&self, ray: &Ray) -> Option<f64> {
        let distance = -self.plane_distance(&ray.origin) / ray.direction.dot(&self.normal);
        let crossing = ray.origin + ray.direction * distance;
        (distance.is_finite() && distance > 0.0 && self.polygon.contains(&self.to_plane(&crossing)))
            .then_some(distance)
    }

    /// Whether an edge of the wireframe lies in this face.
    pub fn contains_edge(&self, edge: &[usize; 2]) -> bool {
        edge.iter().all(|end| self.junctions.contains(end))
    }

    /// Plane coordinates of the foot of the perpendicular from `point`.
    fn to_plane(&self, point: &Vector3<f64>) -> Vector2<f64> {
        plane_coordinates(&(point - self.outline[0]), &self.tangents)
    }
}

/// Components of `offset` along two directions.
fn plane_coordinates(offset: &Vector3<f64>, tangents: &[Vector3<f64>; 2]) -> Vector2<f64> {
    Vector2::new(offset.dot(&tangents[0]), offset.dot(&tangents[1]))
}
