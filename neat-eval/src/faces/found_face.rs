//! The faces of a result.

use crate::error::EvalError;
use crate::triangle::Triangle;
use nalgebra::Vector3;
use neat_core::SceneError;
use neat_wireframe::export::{ExportError, WireframeDocument, parse_json};
use neat_wireframe::faces::{ShellGeometry, Surface};
use std::collections::BTreeMap;
use std::path::Path;

/// A face of a result.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundFace {
    /// What it is a part of.
    pub surface: Surface,
    /// Its exact area, in squared units of the file.
    pub area: f64,
    /// Corners of triangles that cover it; they follow arcs to a thousandth of their radius.
    pub triangles: Vec<[Vector3<f64>; 3]>,
}

impl FoundFace {
    /// The faces of all shells, in their order.
    ///
    /// - `document`: one that passes [`WireframeDocument::check`].
    pub fn of_document(document: &WireframeDocument) -> Vec<Self> {
        let (wireframe, points) = (document.wireframe(), document.drawn().junctions);
        let mut triangles = document.triangles_of_faces().into_iter();
        let mut found = Vec::new();
        for shell in &document.shells {
            let geometry = ShellGeometry::new(shell, &document.graph(&wireframe));
            found.extend(shell.faces.iter().zip(&mut triangles).map(|(face, cut)| {
                let corners = |triangle: [usize; 3]| triangle.map(|corner| points[corner]);
                Self {
                    surface: face.surface,
                    area: geometry.area(face).abs(),
                    triangles: cut.into_iter().map(corners).collect(),
                }
            }));
        }
        found
    }

    /// The corners of triangles along its boundary: those of sides that one triangle has alone.
    pub fn boundary(&self) -> Vec<Vector3<f64>> {
        type Side = [[u64; 3]; 2];
        let bits = |point: &Vector3<f64>| -> [u64; 3] { [0, 1, 2].map(|k| point[k].to_bits()) };
        let mut count: BTreeMap<Side, (usize, Vector3<f64>)> = BTreeMap::new();
        for [a, b, c] in &self.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let mut side = [bits(from), bits(to)];
                side.sort_unstable();
                count.entry(side).or_insert((0, *from)).0 += 1;
            }
        }
        let alone = count.into_values().filter(|(count, _)| *count == 1);
        alone.map(|(_, from)| from).collect()
    }

    /// Reads those of a `wireframe.json`, which may have none.
    ///
    /// # Errors
    /// If the file is missing, or is no `wireframe.json` that is whole.
    pub fn read(path: &Path) -> Result<Vec<Self>, EvalError> {
        let bytes = neat_core::file::read(path, "give the wireframe.json of a run")?;
        let document = parse_json(&bytes, path).map_err(|error| match error {
            ExportError::File(error) => error,
            other => SceneError::malformed(path, other.to_string()),
        })?;
        Ok(Self::of_document(&document))
    }
}

/// The triangles of all faces.
pub(super) fn triangles_of(faces: &[FoundFace]) -> Vec<Triangle> {
    faces
        .iter()
        .flat_map(|face| face.triangles.clone())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle::area;
    use neat_wireframe::faces::{MeasuredGraph, find_shells};

    #[test]
    fn the_triangles_of_a_face_cover_its_area() {
        let corner = |i: usize| Vector3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
        let mut document = WireframeDocument {
            junctions: (0..8).map(corner).collect(),
            edges: (0..8)
                .flat_map(|i| [1, 2, 4].map(|bit| [i, i | bit]))
                .filter(|[a, b]| a != b)
                .collect(),
            ..WireframeDocument::default()
        };
        document.shells = find_shells(&MeasuredGraph::of(&document.wireframe()), &[], &[]);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("wireframe.json");
        neat_wireframe::export::write_json(&path, &document).unwrap();
        let faces = FoundFace::read(&path).unwrap();
        assert_eq!(faces.len(), 6);
        for face in &faces {
            let covered: f64 = face.triangles.iter().map(area).sum();
            assert!((face.area - 1.0).abs() < 1e-9 && (covered - 1.0).abs() < 1e-9);
            // The diagonal between its triangles is within.
            assert_eq!(face.boundary().len(), 4);
        }
        std::fs::write(&path, "{}").unwrap();
        let message = FoundFace::read(&path).unwrap_err().to_string();
        assert!(message.contains("wireframe.json"), "{message}");
    }
}
