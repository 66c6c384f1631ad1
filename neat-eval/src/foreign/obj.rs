//! Wavefront OBJ: `v` and `l` elements; all others are passed over.

use super::{checked, malformed};
use nalgebra::Vector3;
use neat_core::{SceneError, Wireframe3d};
use std::path::Path;

/// Reads vertices and lines. A line through more than two vertices is as many
/// edges less one; negative indices count from the last vertex so far.
///
/// # Errors
/// If a line of the text cannot be read, an edge names no vertex, or a vertex is
/// not finite.
pub fn parse_obj(bytes: &[u8], path: &Path) -> Result<Wireframe3d, SceneError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| malformed(path, "it is not text, as OBJ files are".into()))?;
    let mut wireframe = Wireframe3d::default();
    for (number, line) in text.lines().enumerate() {
        let unreadable = || malformed(path, format!("line {} is not valid: {line}", number + 1));
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let coordinates: Vec<f64> = words
                    .take(3)
                    .map(|word| word.parse().ok())
                    .collect::<Option<_>>()
                    .ok_or_else(unreadable)?;
                let [x, y, z] = coordinates[..] else {
                    return Err(unreadable());
                };
                wireframe.junctions.push(Vector3::new(x, y, z));
            }
            Some("l") => {
                let vertices: Vec<usize> = words
                    .map(|word| vertex_index(word, wireframe.junctions.len()))
                    .collect::<Option<_>>()
                    .ok_or_else(unreadable)?;
                let pairs = vertices.windows(2).map(|pair| [pair[0], pair[1]]);
                wireframe.edges.extend(pairs);
            }
            _ => {}
        }
    }
    checked(wireframe, path)
}

/// From `7`, `7/3` or `-1`, counted from 0.
fn vertex_index(word: &str, vertices: usize) -> Option<usize> {
    let index: i64 = word.split('/').next()?.parse().ok()?;
    if index > 0 {
        usize::try_from(index - 1).ok()
    } else {
        let back = usize::try_from(index.checked_neg()?).ok()?;
        vertices.checked_sub(back).filter(|_| back > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Wireframe3d, String> {
        parse_obj(text.as_bytes(), Path::new("a.obj")).map_err(|error| error.to_string())
    }

    #[test]
    fn polylines_and_relative_indices_are_read() {
        let text =
            "# a comment\nv 0 0 0\nv 1 0 0 1.0\nvn 0 0 1\nv 1 1 0\nl 1 2 3\nl -1/4 -3\nf 1 2 3\n";
        let wireframe = parse(text).unwrap();
        assert_eq!(wireframe.junctions.len(), 3);
        assert_eq!(wireframe.edges, [[0, 1], [1, 2], [2, 0]]);
    }

    #[test]
    fn bad_lines_are_named() {
        assert!(parse("v 0 0\n").unwrap_err().contains("line 1"));
        assert!(parse("v 0 0 0\nl 1 0\n").unwrap_err().contains("line 2"));
        assert!(parse("v 0 0 0\nl 1 2\n").unwrap_err().contains("a.obj"));
        assert!(parse("v 0 nan 0\n").unwrap_err().contains("finite"));
    }
}
