//! Segments as NumPy arrays: of the published NEAT, and of LIMAP.

use super::{malformed, segment_of};
use crate::edge_model::wireframe_of_segments;
use neat_core::npz::{NpyArray, NpzReader, parse_npy};
use neat_core::{LineSegment3, SceneError, Wireframe3d};
use std::path::Path;

/// Reads `lines3d` of an `.npz` of the published NEAT (`neat-final-parsing.py`):
/// `…-wfi.npz` is the graph before its visibility check, `…-wfi_checked.npz` the
/// one after it.
///
/// # Errors
/// If the archive is damaged, has no such array of floats, or that is of another
/// shape.
pub fn parse_neat_npz(bytes: &[u8], path: &Path) -> Result<Wireframe3d, SceneError> {
    let array = NpzReader::from_bytes(bytes.to_vec(), path)?.array("lines3d")?;
    segments_of(&array, path)
}

/// Reads an `.npy` of shape `[n, 2, 3]` or `[n, 6]`, as LIMAP writes lines.
///
/// # Errors
/// If it is damaged, not of floats, or of another shape.
pub fn parse_npy_lines(bytes: &[u8], path: &Path) -> Result<Wireframe3d, SceneError> {
    segments_of(&parse_npy(bytes, path)?, path)
}

fn segments_of(array: &NpyArray, path: &Path) -> Result<Wireframe3d, SceneError> {
    if !matches!(array.shape[..], [_, 2, 3] | [_, 6]) {
        let shape = &array.shape;
        let reason = format!("shape {shape:?} is not that of segments, [n, 2, 3]");
        return Err(malformed(path, reason));
    }
    let (ends, _) = array.values.as_chunks::<6>();
    let segments: Vec<LineSegment3> = ends.iter().map(segment_of).collect();
    Ok(wireframe_of_segments(&segments))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_shapes_are_refused() {
        let array = |shape: &[usize]| NpyArray {
            shape: shape.to_vec(),
            values: vec![0.5; shape.iter().product()],
        };
        let path = Path::new("lines.npy");
        assert_eq!(segments_of(&array(&[4, 6]), path).unwrap().edges.len(), 4);
        assert!(
            segments_of(&array(&[0, 2, 3]), path)
                .unwrap()
                .edges
                .is_empty()
        );
        for shape in [&[6][..], &[2, 4, 3], &[3, 2]] {
            let message = segments_of(&array(shape), path).unwrap_err().to_string();
            assert!(message.contains("lines.npy") && message.contains("[n, 2, 3]"));
        }
    }
}
