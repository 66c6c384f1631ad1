//! PLY with edges: a `vertex` element with x, y and z, and an `edge` element with
//! `vertex1` and `vertex2`. Other elements are passed over.

use super::{checked, malformed};
use nalgebra::Vector3;
use neat_core::ply::Ply;
use neat_core::{SceneError, Wireframe3d};
use std::path::Path;

/// Reads vertices and edges.
///
/// # Errors
/// If the header is not that of a PLY file with vertices and edges, the file ends
/// early, an edge names no vertex, or a vertex is not finite.
pub fn parse_ply_edges(bytes: &[u8], path: &Path) -> Result<Wireframe3d, SceneError> {
    let ply = Ply::parse(bytes, path)?;
    let junctions = ply.columns("vertex", ["x", "y", "z"])?;
    let edges = ply.columns("edge", ["vertex1", "vertex2"])?;
    if edges.iter().flatten().any(|&index| index < 0.0) {
        return Err(malformed(path, "an edge has a negative index".into()));
    }
    let wireframe = Wireframe3d {
        junctions: junctions.into_iter().map(Vector3::from).collect(),
        edges: (edges.into_iter())
            .map(|edge| edge.map(|index| index as usize))
            .collect(),
    };
    checked(wireframe, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "ply\nformat ascii 1.0\nelement edge 1\nproperty short vertex1\n\
        property int vertex2\nelement vertex 2\nproperty float x\nproperty double y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\n\
        end_header\n1 0\n1 2 3\n-4 5e-1 6\n2 0 -1\n";

    fn parse(text: &str) -> Result<Wireframe3d, SceneError> {
        parse_ply_edges(text.as_bytes(), Path::new("a.ply"))
    }

    #[test]
    fn vertices_and_edges_are_the_graph() {
        let wireframe = parse(TEXT).unwrap();
        let expected = [Vector3::new(1.0, 2.0, 3.0), Vector3::new(-4.0, 0.5, 6.0)];
        assert_eq!(wireframe.junctions, expected);
        assert_eq!(wireframe.edges, [[1, 0]]);
    }

    #[test]
    fn bad_files_are_refused_with_a_reason() {
        for (from, to, reason) in [
            ("element edge", "element edges", "no element `edge`"),
            ("\n1 0\n", "\n-1 0\n", "negative"),
            ("\n1 0\n", "\n7 0\n", "junctions"),
            ("5e-1", "nan", "finite"),
            ("-4 5e-1 6", "-4 5e-1", "too few numbers"),
        ] {
            let message = parse(&TEXT.replace(from, to)).unwrap_err().to_string();
            assert!(message.contains(reason), "{message}");
            assert!(message.contains("a.ply"), "{message}");
        }
    }
}
