//! The JSON file that the HAWP wireframe detector writes for one image.
//!
//! `{"vertices": [[x, y], …], "vertices-score": […], "edges": [[i, j], …],
//! "edges-weights": […], "height": h, "width": w}`. Vertices are in pixel-index
//! coordinates: the centre of the first pixel is (0, 0). In memory they are in
//! image coordinates, which differ by the scene's pixel centre.

use crate::{SceneError, Wireframe2d, file};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Pairs as `[[a, b], …]` or as `[a, b, …]`.
#[derive(Deserialize, Serialize)]
#[serde(untagged)]
enum Pairs<T> {
    Nested(Vec<[T; 2]>),
    Flat(Vec<T>),
}

impl<T: Copy> Pairs<T> {
    /// The pairs, or `None` where a flat list ends within one.
    fn into_pairs(self) -> Option<Vec<[T; 2]>> {
        match self {
            Self::Nested(pairs) => Some(pairs),
            Self::Flat(values) => {
                let (pairs, rest) = values.as_chunks();
                rest.is_empty().then(|| pairs.to_vec())
            }
        }
    }
}

#[derive(Deserialize, Serialize)]
struct HawpJson {
    vertices: Pairs<f64>,
    #[serde(rename = "vertices-score")]
    vertices_score: Vec<f64>,
    edges: Pairs<usize>,
    #[serde(rename = "edges-weights")]
    edges_weights: Vec<f64>,
    height: u32,
    width: u32,
}

/// What to do about a missing wireframe.
pub(crate) const REMEDY: &str = "detect it with `neat detect` or HAWP, or remove the folder \
     `hawp` so that all are detected";

/// Reads a HAWP file and shifts its vertices by `pixel_center` to image
/// coordinates.
///
/// # Errors
/// If the file is missing, empty or no HAWP JSON, lists of one kind differ in
/// length, a number is not finite, or an edge names a vertex that is not there.
pub fn read(path: &Path, pixel_center: f64) -> Result<Wireframe2d, SceneError> {
    parse(&file::read(path, REMEDY)?, pixel_center, path)
}

/// [`read`] from bytes; `path` is for messages.
///
/// # Errors
/// As [`read`].
pub fn parse(bytes: &[u8], pixel_center: f64, path: &Path) -> Result<Wireframe2d, SceneError> {
    let json: HawpJson = file::parse_json(bytes, path, "HAWP wireframe")?;
    let odd = |list: &str| {
        SceneError::malformed(path, format!("the flat list `{list}` has an odd length"))
    };
    let vertices = json.vertices.into_pairs().ok_or_else(|| odd("vertices"))?;
    let wireframe = Wireframe2d {
        vertices: vertices
            .into_iter()
            .map(|vertex| Vector2::from(vertex).add_scalar(pixel_center))
            .collect(),
        vertex_scores: json.vertices_score,
        edges: json.edges.into_pairs().ok_or_else(|| odd("edges"))?,
        edge_scores: json.edges_weights,
        width: json.width,
        height: json.height,
    };
    wireframe
        .validate()
        .map_err(|problem| SceneError::view(path, &file_stem(path), problem))?;
    Ok(wireframe)
}

/// Writes a HAWP file: vertices are shifted back by `pixel_center`.
///
/// Reading gives the same wireframe; coordinates below one pixel can differ by
/// the rounding of the shift.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, wireframe: &Wireframe2d, pixel_center: f64) -> Result<(), SceneError> {
    file::write_atomically(path, &to_bytes(wireframe, pixel_center))
}

/// What [`write()`] writes.
pub fn to_bytes(wireframe: &Wireframe2d, pixel_center: f64) -> Vec<u8> {
    let json = HawpJson {
        vertices: Pairs::Nested(
            wireframe
                .vertices
                .iter()
                .map(|vertex| vertex.add_scalar(-pixel_center).into())
                .collect(),
        ),
        vertices_score: wireframe.vertex_scores.clone(),
        edges: Pairs::Nested(wireframe.edges.clone()),
        edges_weights: wireframe.edge_scores.clone(),
        height: wireframe.height,
        width: wireframe.width,
    };
    serde_json::to_vec(&json).expect("hawp_json::to_bytes: numbers and lists can be written")
}

/// File name without ending, for names of views.
pub(crate) fn file_stem(path: &Path) -> String {
    path.file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ViewError;
    use crate::Wireframe2dError;
    use crate::mutation::{CASES, damaged};
    use proptest::prelude::*;

    const SMALL: &str = r#"{"vertices": [[1.5, 2.25], [3.0, 4.0]], "vertices-score": [0.9, 0.8],
        "edges": [[0, 1]], "edges-weights": [0.7], "height": 8, "width": 9}"#;

    fn small(pixel_center: f64) -> Wireframe2d {
        parse(SMALL.as_bytes(), pixel_center, Path::new("small.json")).unwrap()
    }

    fn error(json: &str) -> SceneError {
        parse(json.as_bytes(), 0.0, Path::new("hawp/view_7.json")).unwrap_err()
    }

    #[test]
    fn vertices_are_shifted_to_image_coordinates() {
        assert_eq!(small(0.0).vertices[0], Vector2::new(1.5, 2.25));
        assert_eq!(small(0.5).vertices[0], Vector2::new(2.0, 2.75));
        assert_eq!((small(0.0).width, small(0.0).height), (9, 8));
    }

    #[test]
    fn flat_and_nested_lists_mean_the_same() {
        let flat = SMALL
            .replace("[[1.5, 2.25], [3.0, 4.0]]", "[1.5, 2.25, 3.0, 4.0]")
            .replace("[[0, 1]]", "[0, 1]");
        let flat = parse(flat.as_bytes(), 0.0, Path::new("small.json")).unwrap();
        assert_eq!(flat, small(0.0));
        let odd = SMALL.replace("[[0, 1]]", "[0, 1, 1]");
        assert!(error(&odd).to_string().contains("odd"));
    }

    #[test]
    fn messages_name_the_file_and_what_is_wrong() {
        let out_of_range = error(&SMALL.replace("[[0, 1]]", "[[0, 2]]"));
        assert!(matches!(
            out_of_range,
            SceneError::View {
                problem: ViewError::Wireframe(Wireframe2dError::VertexOutOfRange {
                    edge: 0,
                    vertex: 2,
                    vertices: 2
                }),
                ..
            }
        ));
        let message = out_of_range.to_string();
        assert!(message.contains("hawp/view_7.json") && message.contains("vertex 2"));
        assert!(
            error(&SMALL.replace("[0.7]", "[0.7, 0.6]"))
                .to_string()
                .contains("2 scores")
        );
        assert!(
            error(&SMALL.replace("\"width\": 9", "\"width\": 0"))
                .to_string()
                .contains("without pixels")
        );
        let not_a_number = error(&SMALL.replace("1.5", "NaN"));
        assert!(matches!(not_a_number, SceneError::Json { .. }));
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(
            vertices in prop::collection::vec((1.0..4e3, 1.0..4e3, 0.0..1.0), 1..20),
            edges in prop::collection::vec((0usize..1000, 0usize..1000, 0.0..1.0), 0..30),
            half: bool,
        ) {
            let pixel_center = if half { 0.5 } else { 0.0 };
            let index = |i: usize| i % vertices.len();
            let wireframe = Wireframe2d {
                vertices: vertices.iter().map(|v| Vector2::new(v.0, v.1)).collect(),
                vertex_scores: vertices.iter().map(|v| v.2).collect(),
                edges: edges.iter().map(|e| [index(e.0), index(e.1)]).collect(),
                edge_scores: edges.iter().map(|e| e.2).collect(),
                width: 4000,
                height: 4000,
            };
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("a.json");
            write(&path, &wireframe, pixel_center).unwrap();
            prop_assert_eq!(read(&path, pixel_center).unwrap(), wireframe);
        }

        #[test]
        fn random_bytes_are_errors(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            prop_assert!(parse(&bytes, 0.5, Path::new("a.json")).is_err());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn truncated_and_damaged_files_do_not_panic(
            end in 0..SMALL.len(), bytes in damaged(SMALL),
        ) {
            let path = Path::new("a.json");
            prop_assert!(parse(&SMALL.as_bytes()[..end], 0.0, path).is_err());
            if let Ok(wireframe) = parse(&bytes, 0.0, path) {
                prop_assert!(wireframe.validate().is_ok());
            }
        }
    }
}
