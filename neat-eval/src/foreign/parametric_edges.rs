//! `parametric_edges.json` of EMAP, EdgeGaussians and CurveGaussian.
//!
//! `lines_end_pts` are segments of six numbers, `curves_ctl_pts` cubic Bézier
//! curves of twelve, nested in whatever way: the published readers flatten them.

use super::{malformed, segment_of};
use crate::edge_model::{CubicBezier, EdgeModel, wireframe_of_segments};
use nalgebra::Vector3;
use neat_core::{LineSegment3, SceneError, file};
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
struct ParametricEdges {
    #[serde(default)]
    curves_ctl_pts: Nested,
    #[serde(default)]
    lines_end_pts: Nested,
}

/// Numbers in lists in lists.
#[derive(Deserialize)]
#[serde(untagged)]
enum Nested {
    Number(f64),
    List(Vec<Nested>),
}

impl Default for Nested {
    fn default() -> Self {
        Self::List(Vec::new())
    }
}

impl Nested {
    fn flatten(&self, numbers: &mut Vec<f64>) {
        match self {
            Self::Number(number) => numbers.push(*number),
            Self::List(list) => list.iter().for_each(|inner| inner.flatten(numbers)),
        }
    }
}

/// Whether JSON has a key of this format.
pub(super) fn is_parametric(bytes: &[u8]) -> bool {
    [&b"\"lines_end_pts\""[..], b"\"curves_ctl_pts\""]
        .iter()
        .any(|key| bytes.windows(key.len()).any(|window| window == *key))
}

/// Reads segments and curves.
///
/// # Errors
/// If the text is no such JSON, or the numbers do not make whole segments and
/// curves.
pub fn parse_parametric_edges(bytes: &[u8], path: &Path) -> Result<EdgeModel, SceneError> {
    let json: ParametricEdges = file::parse_json(bytes, path, "parametric edges")?;
    let flat = |nested: &Nested| {
        let mut numbers = Vec::new();
        nested.flatten(&mut numbers);
        numbers
    };
    let whole = |key: &str, of: usize, rest: &[f64]| {
        if rest.is_empty() {
            return Ok(());
        }
        Err(malformed(
            path,
            format!("`{key}` does not hold {of} numbers per edge"),
        ))
    };
    let numbers = flat(&json.lines_end_pts);
    let (ends, rest) = numbers.as_chunks::<6>();
    whole("lines_end_pts", 6, rest)?;
    let segments: Vec<LineSegment3> = ends.iter().map(segment_of).collect();
    let numbers = flat(&json.curves_ctl_pts);
    let (curves, rest) = numbers.as_chunks::<12>();
    whole("curves_ctl_pts", 12, rest)?;
    let curve = |numbers: &[f64; 12]| CubicBezier {
        control_points: std::array::from_fn(|i| Vector3::from_column_slice(&numbers[3 * i..][..3])),
    };
    Ok(EdgeModel {
        wireframe: wireframe_of_segments(&segments),
        curves: curves.iter().map(curve).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<EdgeModel, String> {
        let path = Path::new("parametric_edges.json");
        parse_parametric_edges(text.as_bytes(), path).map_err(|error| error.to_string())
    }

    #[test]
    fn curves_are_read_nested_or_flat() {
        let nested = r#"{"curves_ctl_pts": [[[0,0,0],[1,0,0],[2,0,0],[3,0,0]]]}"#;
        let flat = r#"{"curves_ctl_pts": [[0,0,0,1,0,0,2,0,0,3,0,0]], "lines_end_pts": []}"#;
        assert_eq!(parse(nested).unwrap(), parse(flat).unwrap());
        let model = parse(flat).unwrap();
        assert_eq!(
            model.curves[0].control_points[3],
            Vector3::new(3.0, 0.0, 0.0)
        );
        assert!(model.wireframe.edges.is_empty());
    }

    #[test]
    fn halves_of_edges_are_refused() {
        let message = parse(r#"{"lines_end_pts": [[0,0,0],[1,1,1],[2,2,2]]}"#).unwrap_err();
        assert!(message.contains("lines_end_pts") && message.contains("parametric_edges.json"));
        assert!(parse(r#"{"lines_end_pts": [["a"]]}"#).is_err());
        assert!(parse(&format!("{{\"lines_end_pts\": {}}}", "[".repeat(4000))).is_err());
    }
}
