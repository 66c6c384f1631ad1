//! How far the planes of found faces are from those of the surface, and how they are turned.
//!
//! Source: ours, for rendered scenes with their exact mesh. A found face is compared with the
//! plane along whose parts of the mesh most of it lies: between windows a wall is many parts.

use super::area_samples::area_samples;
use super::found_face::FoundFace;
use super::planar_patches::PlanarPatch;
use super::scene_faces::SceneFaces;
use crate::error::EvalError;
use crate::surface_and_creases::SceneTruth;
use crate::total::total;
use crate::triangle_mesh::Surface as Mesh;
use nalgebra::Vector3;
use neat_wireframe::faces::Surface;
use rayon::prelude::*;

/// What is farther from a face, in metres of a house, is another surface: less than walls are
/// thick, and ten times what a plane should be off at most.
const REACH: f64 = 0.2;

/// The plane of a found face beside that of the surface on which it lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneOffset {
    /// Of the found face, in squared units of the truth.
    pub area: f64,
    /// Of the true plane, of length 1.
    pub normal: Vector3<f64>,
    /// Distance of the two planes in the middle of what lies along the true one.
    pub offset: f64,
    /// Between the two planes, in degrees.
    pub angle: f64,
}

impl SceneFaces {
    /// For each found face its plane beside that of the mesh; `None` for a face of a cylinder and
    /// where less than half of its area lies along the planar parts of the mesh in one plane.
    ///
    /// # Errors
    /// As those of [`Self::evaluate`].
    pub fn plane_offsets(
        &self,
        found: &[FoundFace],
        truth: &SceneTruth,
    ) -> Result<Vec<Option<PlaneOffset>>, EvalError> {
        let triangles: Vec<_> = found.iter().flat_map(|face| &face.triangles).collect();
        let triangles: Vec<_> = triangles.into_iter().copied().collect();
        self.check(&triangles, truth)?;
        let patches = self.patches(&truth.surface.corners(), truth.scale);
        let patches: Vec<(PlanarPatch, Mesh)> = (patches.into_iter())
            .map(|patch| {
                let mesh = Mesh::of_triangles(patch.triangles.clone());
                (patch, mesh)
            })
            .collect();
        let offset = |face: &FoundFace| self.plane_offset(face, &patches, truth.scale);
        Ok(found.par_iter().map(offset).collect())
    }

    fn plane_offset(
        &self,
        face: &FoundFace,
        patches: &[(PlanarPatch, Mesh)],
        scale: f64,
    ) -> Option<PlaneOffset> {
        let Surface::Plane { normal, offset } = face.surface else {
            return None;
        };
        let cosine = self.max_angle.to_radians().cos();
        let alike: Vec<_> = (patches.iter())
            .filter(|(patch, _)| patch.normal.dot(&normal).abs() >= cosine)
            .collect();
        let samples = area_samples(&face.triangles, self.spacing * scale);
        let mut along: Vec<Vec<Vector3<f64>>> = vec![Vec::new(); alike.len()];
        for sample in &samples {
            let distance = |(_, mesh): &(PlanarPatch, Mesh)| {
                mesh.distance_within(&sample.point, REACH * scale)
            };
            let near = (alike.iter().enumerate())
                .filter_map(|(place, patch)| Some((distance(patch)?, place)));
            if let Some((_, place)) = near.min_by(|a, b| a.0.total_cmp(&b.0)) {
                along[place].push(sample.point);
            }
        }
        let in_plane = |plane: &PlanarPatch| {
            let within = alike.iter().zip(&along).filter(|((other, _), _)| {
                let mut corners = other.triangles.iter().flatten();
                corners.all(|corner| plane.height(corner).abs() <= self.thickness * scale)
            });
            within
                .flat_map(|(_, points)| points)
                .collect::<Vec<&Vector3<f64>>>()
        };
        let planes = alike.iter().map(|(patch, _)| (patch, in_plane(patch)));
        let (patch, points) = planes.max_by_key(|(_, points)| points.len())?;
        if points.is_empty() || 2 * points.len() < samples.len() {
            return None;
        }
        let coordinate = |axis: usize| total(points.iter().map(|p| p[axis])) / points.len() as f64;
        let middle = Vector3::from([0, 1, 2].map(coordinate));
        // Corners lie off the plane of the face by their noise.
        let middle_of_plane = middle - normal * (normal.dot(&middle) - offset);
        Some(PlaneOffset {
            area: face.area,
            normal: patch.normal,
            offset: patch.height(&middle_of_plane).abs(),
            angle: (patch.normal.cross(&normal).norm().min(1.0))
                .asin()
                .to_degrees(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle_mesh::tests::cube;

    /// A square over the face z = 1 of a cube, turned about the line in its middle.
    fn lid(side: f64, height: f64, turned: f64) -> FoundFace {
        let (sine, cosine) = f64::to_radians(turned).sin_cos();
        let at = |u: f64, v: f64| {
            let over = side * (v - 0.5);
            Vector3::new(
                0.5 + side * (u - 0.5),
                0.5 + over * cosine,
                1.0 + height + over * sine,
            )
        };
        let normal = Vector3::new(0.0, -sine, cosine);
        FoundFace {
            surface: Surface::Plane {
                normal,
                offset: normal.dot(&at(0.0, 0.0)),
            },
            area: side * side,
            triangles: vec![
                [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0)],
                [at(0.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)],
            ],
        }
    }

    #[test]
    fn offset_and_angle_are_those_to_the_plane_on_which_most_lies() {
        let truth = SceneTruth {
            surface: cube(),
            ..SceneTruth::default()
        };
        let protocol = SceneFaces {
            spacing: 0.01,
            ..SceneFaces::default()
        };
        let found = [
            lid(0.8, 0.03, 2.0),
            lid(0.8, 0.3, 0.0),
            lid(0.8, 0.0, 20.0),
            lid(2.0, 0.01, 0.0),
        ];
        let offsets = protocol.plane_offsets(&found, &truth).unwrap();
        let one = offsets[0].unwrap();
        assert!((one.offset - 0.03).abs() < 1e-3, "{one:?}");
        assert!((one.angle - 2.0).abs() < 1e-9 && one.normal.z.abs() == 1.0);
        // Too far, turned too much, and mostly beside it.
        assert_eq!(offsets[1..], [None, None, None]);
    }
}
