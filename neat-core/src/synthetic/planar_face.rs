//! Flat faces in space.

use super::profile::Profile;
use crate::Ray;
use nalgebra::{Rotation3, Vector2, Vector3};

/// A flat face of a solid: a simple polygon, convex or not, or whatever lines and arcs bound.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarFace {
    /// Corners of the curve around it, counter-clockwise when seen from outside the solid; none of a
    /// circle. Where arcs join them it is more or less than their polygon.
    pub outline: Vec<Vector3<f64>>,
    /// Which junction of the solid's wireframe each corner is.
    pub junctions: Vec<usize>,
    /// Unit normal, away from the solid.
    pub normal: Vector3<f64>,
    /// A point of the plane.
    origin: Vector3<f64>,
    /// Orthonormal directions in the plane; with the normal, right-handed.
    tangents: [Vector3<f64>; 2],
    /// The face in plane coordinates: along the tangents, from the origin.
    profile: Profile,
}

impl PlanarFace {
    /// The polygon through the given junctions, which must lie in one plane, with
    /// the first two apart.
    pub(super) fn polygon(junctions: Vec<usize>, positions: &[Vector3<f64>]) -> Self {
        let outline: Vec<_> = junctions.iter().map(|j| positions[*j]).collect();
        // Newell's normal: right for concave outlines too.
        let normal = (0..outline.len())
            .map(|i| outline[i].cross(&outline[(i + 1) % outline.len()]))
            .sum::<Vector3<f64>>()
            .normalize();
        let u = (outline[1] - outline[0]).normalize();
        let tangents = [u, normal.cross(&u)];
        let corners: Vec<_> = outline
            .iter()
            .map(|corner| plane_coordinates(&(corner - outline[0]), &tangents))
            .collect();
        Self {
            profile: Profile::polygon(&corners),
            origin: outline[0],
            outline,
            junctions,
            normal,
            tangents,
        }
    }

    /// A profile in the plane z = `height`, turned into the world: the upper end of a solid, or the
    /// lower one, which is seen from below. `junctions` are its corners as [`Self::junctions`].
    pub(super) fn end(
        profile: &Profile,
        height: f64,
        world_from_solid: &Rotation3<f64>,
        is_upper: bool,
        junctions: Vec<usize>,
        positions: &[Vector3<f64>],
    ) -> Self {
        let [x, y, z] =
            [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| world_from_solid * axis);
        let (tangents, normal, profile) = if is_upper {
            ([x, y], z, profile.clone())
        } else {
            ([y, x], -z, profile.mirrored())
        };
        Self {
            outline: junctions.iter().map(|j| positions[*j]).collect(),
            junctions,
            normal,
            origin: z * height,
            tangents,
            profile,
        }
    }

    /// Signed distance from the face's infinite plane, positive outside.
    pub fn plane_distance(&self, point: &Vector3<f64>) -> f64 {
        (point - self.origin).dot(&self.normal)
    }

    /// The point of the face nearest to `point`.
    pub fn closest_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let foot = self.to_plane(point);
        let nearest = if self.profile.contains(&foot) {
            foot
        } else {
            self.profile.closest_point_on_outline(&foot)
        };
        self.to_world(&nearest)
    }

    /// Distance along `ray` at which it crosses the face, from either side.
    /// `None` if it misses or runs parallel.
    pub fn intersect(&self, ray: &Ray) -> Option<f64> {
        let distance = -self.plane_distance(&ray.origin) / ray.direction.dot(&self.normal);
        let crossing = ray.origin + ray.direction * distance;
        (distance.is_finite() && distance > 0.0 && self.profile.contains(&self.to_plane(&crossing)))
            .then_some(distance)
    }

    /// Whether an edge of the wireframe lies in this face.
    pub fn contains_edge(&self, edge: &[usize; 2]) -> bool {
        edge.iter().all(|end| self.junctions.contains(end))
    }

    /// Its area.
    pub fn area(&self) -> f64 {
        self.profile.area().abs()
    }

    /// Points whose convex hull holds the face.
    pub(super) fn hull(&self) -> Vec<Vector3<f64>> {
        (self.profile.sides().flat_map(|side| side.hull()))
            .map(|point| self.to_world(&point))
            .collect()
    }

    /// Plane coordinates of the foot of the perpendicular from `point`.
    fn to_plane(&self, point: &Vector3<f64>) -> Vector2<f64> {
        plane_coordinates(&(point - self.origin), &self.tangents)
    }

    fn to_world(&self, point: &Vector2<f64>) -> Vector3<f64> {
        self.origin + self.tangents[0] * point.x + self.tangents[1] * point.y
    }
}

/// Components of `offset` along two directions.
fn plane_coordinates(offset: &Vector3<f64>, tangents: &[Vector3<f64>; 2]) -> Vector2<f64> {
    Vector2::new(offset.dot(&tangents[0]), offset.dot(&tangents[1]))
}
