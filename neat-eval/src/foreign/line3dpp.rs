//! The text file of Line3D++ (Hofer et al., CVIU 2016; `Line3D::save3DLinesAsTXT`
//! of manhofer/Line3Dpp).
//!
//! One 3D line per line of text: the number of its collinear segments, six
//! coordinates for each, and the number of its 2D residuals, each with camera,
//! segment and four pixel coordinates.

use super::{malformed, segment_of};
use crate::edge_model::wireframe_of_segments;
use neat_core::{LineSegment3, SceneError, Wireframe3d};
use std::path::Path;

/// Reads the segments of all lines.
///
/// # Errors
/// If a line does not have the numbers that it announces, or a coordinate is not
/// finite.
pub fn parse_line3dpp(bytes: &[u8], path: &Path) -> Result<Wireframe3d, SceneError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| malformed(path, "it is not text, as results of Line3D++ are".into()))?;
    let mut segments = Vec::new();
    for (number, line) in text.lines().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let found = line_segments(line).ok_or_else(|| {
            let number = number + 1;
            malformed(path, format!("line {number} is not a 3D line of Line3D++"))
        })?;
        segments.extend(found);
    }
    Ok(wireframe_of_segments(&segments))
}

fn line_segments(line: &str) -> Option<Vec<LineSegment3>> {
    let numbers: Vec<f64> = line
        .split_whitespace()
        .map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()))
        .collect::<Option<_>>()?;
    let (coordinates, rest) = counted(&numbers)?;
    let (_residuals, rest) = counted(rest)?;
    let (ends, _) = coordinates.as_chunks::<6>();
    (rest.is_empty()).then(|| ends.iter().map(segment_of).collect())
}

/// The sixes that a leading number announces, and what follows them.
fn counted(numbers: &[f64]) -> Option<(&[f64], &[f64])> {
    let (count, rest) = numbers.split_first()?;
    if *count < 0.0 || count.fract() != 0.0 {
        return None;
    }
    // A cast saturates, and then there are too few numbers.
    rest.split_at_checked((*count as usize).checked_mul(6)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn collinear_segments_and_residuals() {
        let text = "2 0 0 0 1 0 0 2 0 0 3 0 0 1 4 17 1.5 2.5 3.5 4.5 \n\n";
        let wireframe = parse_line3dpp(text.as_bytes(), Path::new("a.txt")).unwrap();
        assert_eq!(wireframe.edges, [[0, 1], [2, 3]]);
        assert_eq!(wireframe.junctions[3], Vector3::new(3.0, 0.0, 0.0));
    }

    #[test]
    fn lines_that_lack_numbers_are_named() {
        for text in [
            "2 0 0 0 1 0 0 0",
            "1 0 0 0 1 0 0",
            "1 0 0 0 1 0 nan 0",
            "-1 0",
            "1e30 0",
        ] {
            let text = format!("\n{text}\n");
            let error = parse_line3dpp(text.as_bytes(), Path::new("a.txt")).unwrap_err();
            assert!(error.to_string().contains("line 2"), "{text}");
        }
    }
}
