//! An exact surface: triangles of a PLY file, how far points are from them, and what they hide.

use crate::box_tree::{Aabb, BoxTree};
use crate::triangle::{self, Triangle};
use nalgebra::Vector3;
use neat_core::ply::Ply;
use neat_core::{Camera, SceneError, file};
use std::path::Path;

/// A surface of triangles; their order and orientation play no role.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Corners.
    pub vertices: Vec<Vector3<f64>>,
    /// Indices of the three corners of every triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// Reads the vertices and faces of a PLY file; faces of more than three corners are cut
    /// into a fan.
    ///
    /// # Errors
    /// If the file is missing, empty or as for [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        Self::parse(&file::read(path, "give the surface as a PLY file")?, path)
    }

    /// [`Self::read`] from bytes; `path` is for messages.
    ///
    /// # Errors
    /// If they are no PLY file with vertices and faces, end early, a vertex is not finite,
    /// or a face has less than three corners or names no vertex.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, SceneError> {
        let ply = Ply::parse(bytes, path)?;
        let rows = ply.columns("vertex", ["x", "y", "z"])?;
        let vertices: Vec<_> = rows.into_iter().map(Vector3::from).collect();
        // Exact in f64, and all that u32 can name.
        let count = vertices.len().min(u32::MAX as usize) as f64;
        let mut triangles = Vec::new();
        ply.lists("face", &["vertex_indices", "vertex_index"], |corners| {
            let names_vertex = |index: &f64| (0.0..count).contains(index) && index.fract() == 0.0;
            if let Some(wrong) = corners.iter().find(|index| !names_vertex(index)) {
                return Err(format!(
                    "names vertex {wrong}, but there are {count} vertices"
                ));
            }
            let [first, others @ ..] = corners else {
                return Err("has no corners".into());
            };
            if others.len() < 2 {
                return Err(format!("has only {} corners", corners.len()));
            }
            let fan = others.windows(2);
            triangles.extend(fan.map(|pair| [*first, pair[0], pair[1]].map(|index| index as u32)));
            Ok(())
        })?;
        Ok(Self {
            vertices,
            triangles,
        })
    }

    /// The corners of all triangles.
    ///
    /// # Panics
    /// If a triangle names a vertex that does not exist.
    pub(crate) fn corners(&self) -> Vec<Triangle> {
        let corner = |index: u32| self.vertices[index as usize];
        (self.triangles.iter())
            .map(|triangle| triangle.map(corner))
            .collect()
    }

    /// The first triangle that names a vertex that does not exist.
    pub(crate) fn broken_triangle(&self) -> Option<usize> {
        let leads_nowhere = |index: &u32| *index as usize >= self.vertices.len();
        let is_broken = |triangle: &[u32; 3]| triangle.iter().any(leads_nowhere);
        self.triangles.iter().position(is_broken)
    }
}

/// A mesh, ready for questions.
pub(crate) struct Surface {
    triangles: Vec<Triangle>,
    tree: BoxTree,
}

impl Surface {
    /// Of a valid mesh of finite vertices.
    pub(crate) fn new(mesh: &TriangleMesh) -> Self {
        Self::of_triangles(mesh.corners())
    }

    /// Of finite triangles.
    pub(crate) fn of_triangles(triangles: Vec<Triangle>) -> Self {
        let boxes: Vec<Aabb> = triangles.iter().map(|t| Aabb::around(t)).collect();
        Self {
            tree: BoxTree::new(&boxes),
            triangles,
        }
    }

    /// Distance of a point from the surface; infinite without triangles.
    pub(crate) fn distance(&self, point: &Vector3<f64>) -> f64 {
        let nearest = self.distance_within(point, f64::INFINITY);
        nearest.unwrap_or(f64::INFINITY)
    }

    /// The same, where the surface is at most `reach` away: far points cost nothing.
    pub(crate) fn distance_within(&self, point: &Vector3<f64>, reach: f64) -> Option<f64> {
        let to = |index: usize| triangle::squared_distance(&self.triangles[index], point);
        self.tree.nearest(point, reach, to)
    }

    /// The same, of those triangles whose plane is turned by at most the angle of which `cosine`
    /// is that against the one with this unit normal; orientation plays no role.
    pub(crate) fn distance_along(
        &self,
        point: &Vector3<f64>,
        normal: &Vector3<f64>,
        cosine: f64,
        reach: f64,
    ) -> Option<f64> {
        let agrees = |triangle: &Triangle| {
            triangle::normal(triangle).is_some_and(|other| other.dot(normal).abs() >= cosine)
        };
        let to = |index: usize| match &self.triangles[index] {
            triangle if agrees(triangle) => triangle::squared_distance(triangle, point),
            _ => f64::INFINITY,
        };
        self.tree.nearest(point, reach, to)
    }

    /// Whether a camera sees a point: it is in the image, and no surface lies more than `margin`
    /// before it.
    pub(crate) fn shows(&self, camera: &Camera, point: &Vector3<f64>, margin: f64) -> bool {
        if !camera.sees(point) {
            return false;
        }
        let way = point - camera.center_in_world;
        let distance = way.norm();
        if distance <= margin {
            return true;
        }
        let before = camera.center_in_world + way * (1.0 - margin / distance);
        !self.hides(&camera.center_in_world, &before)
    }

    /// Whether the surface lies between the two points.
    pub(crate) fn hides(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        let meets = |index: usize| triangle::is_met(&self.triangles[index], from, to);
        self.tree.any_between(from, to, meets)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A PLY file of the cube from 0 to 1, its faces as squares.
    pub(crate) const CUBE: &str = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\n\
        property float y\nproperty float z\nelement face 6\n\
        property list uchar int vertex_indices\nend_header\n\
        0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n\
        4 0 1 2 3\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";

    pub(crate) fn cube() -> TriangleMesh {
        parse(CUBE).unwrap()
    }

    fn parse(text: &str) -> Result<TriangleMesh, SceneError> {
        TriangleMesh::parse(text.as_bytes(), Path::new("mesh.ply"))
    }

    #[test]
    fn squares_become_two_triangles_each() {
        let cube = cube();
        assert_eq!((cube.vertices.len(), cube.triangles.len()), (8, 12));
        assert_eq!(cube.triangles[..2], [[0, 1, 2], [0, 2, 3]]);
        let surface = Surface::new(&cube);
        let distance = |x, y, z| surface.distance(&Vector3::new(x, y, z));
        assert_eq!(distance(0.5, 0.5, 0.75), 0.25);
        assert_eq!(distance(0.5, 0.3, 3.0), 2.0);
        assert_eq!(distance(4.0, 5.0, 0.5), 5.0);
        let sees = |from: [f64; 3], to: [f64; 3]| !surface.hides(&from.into(), &to.into());
        assert!(!sees([0.5, 0.5, 2.0], [0.5, 0.5, 0.5]));
        assert!(sees([0.5, 0.5, 2.0], [0.5, 0.5, 1.1]));
        assert!(sees([0.1, 0.1, 0.1], [0.9, 0.8, 0.7]));
    }

    #[test]
    fn bad_files_are_refused_with_a_reason() {
        for (from, to, reason) in [
            ("4 0 1 2 3", "4 0 1 2 8", "face 0 names vertex 8"),
            ("4 0 1 2 3", "4 0 1 2 -1", "names vertex -1"),
            ("4 0 1 2 3", "4 0 1 2 0.5", "names vertex 0.5"),
            ("4 0 1 2 3", "4 0 1 nan 0.5", "names vertex NaN"),
            ("4 0 1 2 3", "2 0 1", "face 0 has only 2 corners"),
            ("4 0 1 2 3", "0", "face 0 has no corners"),
            ("element face 6", "element face 7", "row 6 of 7"),
            ("vertex_indices", "corners", "no list `vertex_indices`"),
            ("0 0 0", "0 0 inf", "not finite"),
        ] {
            let message = parse(&CUBE.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(message.contains(reason), "{message}");
            assert!(message.contains("mesh.ply"), "{message}");
        }
        assert_eq!(
            Surface::new(&TriangleMesh::default()).distance(&Vector3::zeros()),
            f64::INFINITY
        );
    }

    proptest! {
        #[test]
        fn the_tree_gives_what_a_scan_of_all_triangles_gives(
            vertices in prop::collection::vec(prop::array::uniform3(-2.0..2.0), 3..30),
            corners in prop::collection::vec(prop::array::uniform3(0_u32..1000), 1..60),
            points in prop::collection::vec(prop::array::uniform3(-4.0..4.0), 2..12),
        ) {
            let count = vertices.len() as u32;
            let mesh = TriangleMesh {
                vertices: vertices.into_iter().map(Vector3::from).collect(),
                triangles: corners.iter().map(|t| t.map(|i| i % count)).collect(),
            };
            let (surface, triangles) = (Surface::new(&mesh), mesh.corners());
            let points: Vec<Vector3<f64>> = points.into_iter().map(Vector3::from).collect();
            for pair in points.windows(2) {
                let scanned = (triangles.iter())
                    .map(|t| triangle::squared_distance(t, &pair[0]))
                    .fold(f64::INFINITY, f64::min);
                // The box of a triangle may round to a little farther away than itself.
                prop_assert!((surface.distance(&pair[0]) - scanned.sqrt()).abs() < 1e-12);
                let hidden = triangles.iter().any(|t| triangle::is_met(t, &pair[0], &pair[1]));
                prop_assert_eq!(surface.hides(&pair[0], &pair[1]), hidden);
            }
        }
    }
}
