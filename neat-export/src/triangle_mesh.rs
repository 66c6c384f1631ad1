//! A triangle mesh and its file.

use crate::ExportError;
use nalgebra::Vector3;
use neat_core::file;
use std::path::Path;

/// Triangles that share vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// The vertices.
    pub vertices: Vec<Vector3<f64>>,
    /// Index triples into `vertices`, counter-clockwise as seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// The same mesh with every vertex mapped by `f`, such as from the world of a
    /// scene to the frame of the user's files. A map that mirrors turns the mesh
    /// inside out.
    pub fn map(&self, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        Self {
            vertices: self.vertices.iter().map(f).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// Removes the vertices of no triangle; the others keep their order.
    pub fn drop_unused_vertices(&mut self) {
        let mut used = vec![false; self.vertices.len()];
        for vertex in self.triangles.iter().flatten() {
            used[*vertex as usize] = true;
        }
        let mut new_index = Vec::with_capacity(used.len());
        let mut count = 0;
        for &used in &used {
            new_index.push(count);
            count += u32::from(used);
        }
        let mut used = used.into_iter();
        self.vertices.retain(|_| used.next().unwrap_or(false));
        for vertex in self.triangles.iter_mut().flatten() {
            *vertex = new_index[*vertex as usize];
        }
    }

    /// Writes a binary little-endian PLY: `vertex` (double x, y, z) and `face` (a
    /// list of three int).
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_ply(&self, path: &Path) -> Result<(), ExportError> {
        let mut bytes = format!(
            "ply\n\
             format binary_little_endian 1.0\n\
             element vertex {}\n\
             property double x\n\
             property double y\n\
             property double z\n\
             element face {}\n\
             property list uchar int vertex_indices\n\
             end_header\n",
            self.vertices.len(),
            self.triangles.len(),
        )
        .into_bytes();
        bytes.reserve(24 * self.vertices.len() + 13 * self.triangles.len());
        for coordinate in self.vertices.iter().flatten() {
            bytes.extend(coordinate.to_le_bytes());
        }
        for triangle in &self.triangles {
            bytes.push(3);
            bytes.extend(triangle.iter().flat_map(|vertex| vertex.to_le_bytes()));
        }
        Ok(file::write_atomically(path, &bytes)?)
    }
}
