//! Frustums: polygons swept upwards, with exact distance, faces and edges.

use super::planar_face::PlanarFace;
use super::polygon::Polygon;
use crate::{Camera, Wireframe3d};
use nalgebra::{Rotation3, Vector2, Vector3};

/// Nearer to the surface than this, the direction to it is rounding, and the
/// face's normal stands for it.
const ON_SURFACE: f64 = 1e-12;

/// A solid between a polygon and a scaled copy of it above: a prism when the
/// scale is 1, a truncated pyramid when it is smaller.
///
/// All of it is exact: faces are flat, edges are straight and are real creases.
#[derive(Clone, Debug, PartialEq)]
pub struct Frustum {
    faces: Vec<PlanarFace>,
    wireframe: Wireframe3d,
    profile: Polygon,
    half_height: f64,
    top_scale: f64,
    world_from_solid: Rotation3<f64>,
}

impl Frustum {
    /// The frustum over a simple counter-clockwise `profile` at
    /// z = -`half_height`, scaled by `top_scale` > 0 about the z axis at
    /// z = `half_height`, and then rotated into the world.
    pub(super) fn new(
        profile: &[[f64; 2]],
        half_height: f64,
        top_scale: f64,
        world_from_solid: Rotation3<f64>,
    ) -> Self {
        let n = profile.len();
        let ring = |scale: f64, z: f64| {
            profile
                .iter()
                .map(move |[x, y]| world_from_solid * Vector3::new(x * scale, y * scale, z))
        };
        let junctions: Vec<_> = ring(1.0, -half_height)
            .chain(ring(top_scale, half_height))
            .collect();
        let next = |i: usize| (i + 1) % n;
        let edges = (0..n)
            .map(|i| [i, next(i)])
            .chain((0..n).map(|i| [n + i, n + next(i)]))
            .chain((0..n).map(|i| [i, n + i]))
            .collect();
        let faces = (0..n)
            .map(|i| vec![i, next(i), n + next(i), n + i])
            .chain([(0..n).rev().collect(), (n..2 * n).collect()])
            .map(|corners| PlanarFace::new(corners, &junctions))
            .collect();
        Self {
            faces,
            wireframe: Wireframe3d { junctions, edges },
            profile: Polygon::new(profile.iter().map(|p| Vector2::from(*p)).collect()),
            half_height,
            top_scale,
            world_from_solid,
        }
    }

    /// Faces in the world: the sides in the order of the polygon, then bottom,
    /// then top.
    pub fn faces(&self) -> &[PlanarFace] {
        &self.faces
    }

    /// Junctions and edges in the world. With `n` sides: junctions 0..n are the
    /// bottom's, n..2n the top's; edges are the bottom ring, the top ring and
    /// the uprights.
    pub fn wireframe(&self) -> &Wireframe3d {
        &self.wireframe
    }

    /// Whether a world point lies inside.
    pub fn contains(&self, point_in_world: &Vector3<f64>) -> bool {
        let p = self
            .world_from_solid
            .inverse_transform_vector(point_in_world);
        let rise = (p.z / self.half_height + 1.0) / 2.0;
        let scale = 1.0 + (self.top_scale - 1.0) * rise;
        (0.0..1.0).contains(&rise) && self.profile.contains(&(p.xy() / scale))
    }

    /// Exact Euclidean distance from the surface, negative inside.
    pub fn sdf(&self, point_in_world: &Vector3<f64>) -> f64 {
        self.sdf_and_gradient(point_in_world).0
    }

    /// [`Self::sdf`] and its gradient, a unit vector away from the solid. On
    /// the surface it is a face's normal; where several points of the surface
    /// are equally near, it belongs to one of them.
    pub fn sdf_and_gradient(&self, point_in_world: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let (mut distance, mut gradient) = (f64::INFINITY, Vector3::zeros());
        for face in &self.faces {
            let offset = point_in_world - face.closest_point(point_in_world);
            let to_face = offset.norm();
            if to_face < distance {
                distance = to_face;
                gradient = if to_face > ON_SURFACE {
                    offset / to_face
                } else {
                    face.normal
                };
            }
        }
        if !self.contains(point_in_world) {
            (distance, gradient)
        } else if distance > ON_SURFACE {
            (-distance, -gradient)
        } else {
            (-distance, gradient)
        }
    }

    /// Lower and upper corner of the rectangle around the solid's image, in
    /// image coordinates. `None` unless all of it is in front of the camera.
    pub fn bounds_in_image(&self, camera: &Camera) -> Option<[Vector2<f64>; 2]> {
        bounds_in_image(&self.wireframe.junctions, camera)
    }
}

/// Lower and upper corner of the rectangle around the images of points, in image
/// coordinates. `None` unless all of them are in front of the camera.
pub(super) fn bounds_in_image(
    points: &[Vector3<f64>],
    camera: &Camera,
) -> Option<[Vector2<f64>; 2]> {
    let empty = [f64::INFINITY, f64::NEG_INFINITY].map(|bound| Vector2::new(bound, bound));
    (points.iter().map(|point| camera.project(point))).try_fold(
        empty,
        |[lower, upper], projection| {
            (projection.depth > 0.0)
                .then(|| [lower.inf(&projection.pixel), upper.sup(&projection.pixel)])
        },
    )
}
