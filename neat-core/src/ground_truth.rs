//! 3D wireframes as JSON: ground truth, and our own results.
//!
//! Ground truth (`gt_wireframe.json`) calls its edges `lines` and may hold
//! `curves`: `{"junctions": [[x, y, z], …], "lines": [[i, j], …], "curves":
//! [{"type": "Circle", "points": [[x, y, z], …]}, …]}`, and `faces`, which are written here and
//! read by `neat-eval`. Our results
//! (`wireframe.json`) call them `edges`. Both are read by the same functions;
//! other keys are ignored.

use crate::{SceneError, Wireframe3d, file};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The wireframe of an object with the sharp edges that are not straight.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GroundTruth {
    /// The straight edges, in world units.
    pub wireframe: Wireframe3d,
    /// The other sharp edges. They are no part of the wireframe.
    pub curves: Vec<Curve>,
}

/// A sharp edge that is not straight.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// What the CAD model says it is, such as "Circle"; may be empty.
    #[serde(rename = "type", default)]
    pub kind: String,
    /// Points along it, in world units.
    pub points: Vec<Vector3<f64>>,
}

/// A face of a CAD model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Face {
    /// What it is a part of.
    #[serde(flatten)]
    pub surface: Surface,
    /// Its area.
    pub area: f64,
    /// The sharp edges around it.
    pub edges: Vec<FaceEdge>,
}

/// A sharp edge beside a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", content = "index", rename_all = "snake_case")]
pub enum FaceEdge {
    /// The index of a straight edge.
    Line(usize),
    /// The index of a curve.
    Curve(usize),
}

/// What faces of CAD models are parts of, in world units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Surface {
    /// A plane, with its unit normal away from the solid.
    Plane {
        /// The normal.
        normal: Vector3<f64>,
        /// The product of the normal with any point of it.
        offset: f64,
    },
    /// A cylinder.
    Cylinder {
        /// A point of the axis.
        axis_point: Vector3<f64>,
        /// The unit axis.
        axis: Vector3<f64>,
        /// The radius.
        radius: f64,
    },
    /// A cone.
    Cone {
        /// Where the radius is 0.
        apex: Vector3<f64>,
        /// The unit axis, from the apex into the cone.
        axis: Vector3<f64>,
        /// The angle between axis and surface, in radians.
        half_angle: f64,
    },
}

#[derive(Deserialize)]
struct ReadJson {
    junctions: Vec<Vector3<f64>>,
    #[serde(alias = "lines")]
    edges: Vec<[usize; 2]>,
    #[serde(default)]
    curves: Vec<Curve>,
}

#[derive(Serialize)]
struct GroundTruthJson<'a> {
    junctions: &'a [Vector3<f64>],
    lines: &'a [[usize; 2]],
    curves: &'a [Curve],
    #[serde(skip_serializing_if = "<[Face]>::is_empty")]
    faces: &'a [Face],
}

const REMEDY: &str = "give a file with `junctions` and `lines` or `edges`";

/// Reads ground truth, or a result as if it were one.
///
/// # Errors
/// If the file is missing, empty or no such JSON, a number is not finite, or an
/// edge names a junction that is not there.
pub fn read_ground_truth(path: &Path) -> Result<GroundTruth, SceneError> {
    parse(&file::read(path, REMEDY)?, path)
}

/// Reads the wireframe of a result or of ground truth.
///
/// # Errors
/// As [`read_ground_truth`].
pub fn read_wireframe(path: &Path) -> Result<Wireframe3d, SceneError> {
    read_ground_truth(path).map(|truth| truth.wireframe)
}

/// [`read_ground_truth`] from bytes; `path` is for messages.
///
/// # Errors
/// As [`read_ground_truth`].
pub fn parse(bytes: &[u8], path: &Path) -> Result<GroundTruth, SceneError> {
    let json: ReadJson = file::parse_json(bytes, path, "3D wireframe")?;
    let junctions = json.junctions.len();
    for (edge, ends) in json.edges.iter().enumerate() {
        if let Some(end) = ends.iter().find(|&&end| end >= junctions) {
            let reason =
                format!("edge {edge} names junction {end}, but there are {junctions} junctions");
            return Err(SceneError::malformed(path, reason));
        }
    }
    Ok(GroundTruth {
        wireframe: Wireframe3d {
            junctions: json.junctions,
            edges: json.edges,
        },
        curves: json.curves,
    })
}

/// Writes ground truth, with the faces between its edges where they are known.
///
/// # Errors
/// If the file cannot be written.
pub fn write_ground_truth(
    path: &Path,
    truth: &GroundTruth,
    faces: &[Face],
) -> Result<(), SceneError> {
    let json = GroundTruthJson {
        faces,
        junctions: &truth.wireframe.junctions,
        lines: &truth.wireframe.edges,
        curves: &truth.curves,
    };
    write_json(path, &json)
}

/// Writes a wireframe as `{"junctions": …, "edges": …}`.
///
/// # Errors
/// If the file cannot be written.
pub fn write_wireframe(path: &Path, wireframe: &Wireframe3d) -> Result<(), SceneError> {
    write_json(path, wireframe)
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), SceneError> {
    let bytes =
        serde_json::to_vec(value).map_err(|source| SceneError::write(path, source.into()))?;
    file::write_atomically(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use proptest::prelude::*;

    const SMALL: &str = r#"{"junctions": [[0, 0, 0], [1.5, 0, -2]], "lines": [[0, 1]],
        "curves": [{"type": "Circle", "points": [[0, 0, 0], [0, 1, 0], [0, 1, 1]]}], "source": {"file": "a.step"}}"#;

    #[test]
    fn both_names_of_the_edges_are_read() {
        let path = Path::new("gt_wireframe.json");
        let truth = parse(SMALL.as_bytes(), path).unwrap();
        assert_eq!(truth.wireframe.edges, [[0, 1]]);
        assert_eq!(truth.wireframe.junctions[1], Vector3::new(1.5, 0.0, -2.0));
        assert_eq!(truth.curves[0].points.len(), 3);
        assert_eq!(truth.curves[0].kind, "Circle");
        let ours = SMALL.replace("lines", "edges");
        assert_eq!(parse(ours.as_bytes(), path).unwrap(), truth);
        let wrong = SMALL.replace("[[0, 1]]", "[[0, 2]]");
        let message = parse(wrong.as_bytes(), path).unwrap_err().to_string();
        assert!(message.contains("gt_wireframe.json") && message.contains("junction 2"));
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(
            junctions in prop::collection::vec(prop::array::uniform3(-1e3..1e3), 1..20),
            edges in prop::collection::vec(prop::array::uniform2(0usize..1000), 0..30),
        ) {
            let junctions: Vec<_> = junctions.into_iter().map(Vector3::from).collect();
            let edges = edges.iter().map(|e| e.map(|i| i % junctions.len())).collect();
            let truth = GroundTruth {
                curves: vec![Curve {
                    kind: "BSpline".into(),
                    points: junctions.clone(),
                }],
                wireframe: Wireframe3d { junctions, edges },
            };
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("a.json");
            write_ground_truth(&path, &truth, &[]).unwrap();
            prop_assert_eq!(&read_ground_truth(&path).unwrap(), &truth);
            write_wireframe(&path, &truth.wireframe).unwrap();
            prop_assert_eq!(read_wireframe(&path).unwrap(), truth.wireframe);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn truncated_and_damaged_files_do_not_panic(
            end in 0..SMALL.len(), bytes in damaged(SMALL),
        ) {
            let path = Path::new("a.json");
            prop_assert!(parse(&SMALL.as_bytes()[..end], path).is_err());
            if let Ok(truth) = parse(&bytes, path) {
                // Every edge names junctions that are there.
                let edges = truth.wireframe.edges.len();
                prop_assert_eq!(truth.wireframe.segments().len(), edges);
            }
        }
    }
}
