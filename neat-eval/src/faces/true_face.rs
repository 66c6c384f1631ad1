//! The faces of a CAD model, as `gt_wireframe.json` lists them.

use nalgebra::Vector3;
use neat_core::{SceneError, file};
use neat_wireframe::faces::Surface;
use serde::Deserialize;
use std::path::Path;

/// A true face.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueFace {
    /// What it is a part of; `None` where that is no plane, cylinder, cone or sphere. The side of its
    /// normal plays no role.
    pub surface: Option<Surface>,
    /// Its area.
    pub area: f64,
    /// Points along its boundary; empty where the file does not say what that is.
    pub boundary: Vec<Vector3<f64>>,
}

#[derive(Deserialize)]
struct TruthJson {
    #[serde(default)]
    junctions: Vec<Vector3<f64>>,
    #[serde(default, alias = "edges")]
    lines: Vec<[usize; 2]>,
    #[serde(default)]
    curves: Vec<CurveJson>,
    #[serde(default)]
    smooth_edges: Vec<CurveJson>,
    #[serde(default)]
    faces: Vec<FaceJson>,
}

#[derive(Deserialize)]
struct CurveJson {
    points: Vec<Vector3<f64>>,
    /// Why no image shows it, of a smooth one.
    reason: Option<String>,
}

#[derive(Deserialize)]
struct FaceJson {
    #[serde(rename = "type")]
    kind: String,
    area: f64,
    normal: Option<Vector3<f64>>,
    offset: Option<f64>,
    axis_point: Option<Vector3<f64>>,
    axis: Option<Vector3<f64>>,
    center: Option<Vector3<f64>>,
    radius: Option<f64>,
    apex: Option<Vector3<f64>>,
    half_angle: Option<f64>,
    #[serde(default)]
    edges: Vec<BoundaryJson>,
}

#[derive(Deserialize)]
struct BoundaryJson {
    kind: String,
    index: usize,
}

impl TrueFace {
    /// Reads the `faces` of a true wireframe, with the edges around them; none where it has none.
    ///
    /// # Errors
    /// If the file is missing or no such JSON, a plane, a cylinder, a cone or a sphere lacks its numbers, or
    /// a face names an edge that is not there.
    pub fn read(path: &Path) -> Result<Vec<Self>, SceneError> {
        Self::parse(
            &file::read(path, "give a true wireframe with `faces`")?,
            path,
        )
    }

    /// [`Self::read`] from bytes; `path` is for messages.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Vec<Self>, SceneError> {
        let truth: TruthJson = file::parse_json(bytes, path, "true wireframe with faces")?;
        let face = |(index, face): (usize, &FaceJson)| {
            face.read(&truth)
                .map_err(|reason| SceneError::malformed(path, format!("face {index} {reason}")))
        };
        truth.faces.iter().enumerate().map(face).collect()
    }
}

impl FaceJson {
    fn read(&self, truth: &TruthJson) -> Result<TrueFace, String> {
        if !(self.area.is_finite() && self.area > 0.0) {
            return Err(format!("has the area {}", self.area));
        }
        let mut boundary = Vec::new();
        for edge in &self.edges {
            let points = edge.points(truth);
            let missing = || format!("names {} {}, which is not there", edge.kind, edge.index);
            boundary.extend(points.ok_or_else(missing)?);
        }
        Ok(TrueFace {
            surface: self.surface()?,
            area: self.area,
            boundary,
        })
    }

    fn surface(&self) -> Result<Option<Surface>, String> {
        let surface =
            match self.kind.as_str() {
                "plane" => (self.normal.zip(self.offset))
                    .map(|(normal, offset)| Surface::Plane { normal, offset }),
                "cylinder" => self.axis_point.zip(self.axis).zip(self.radius).map(
                    |((point, axis), radius)| Surface::Cylinder {
                        point,
                        axis,
                        radius,
                        convex: true,
                    },
                ),
                "cone" => self.apex.zip(self.axis).zip(self.half_angle).map(
                    |((apex, axis), half_angle)| Surface::Cone {
                        apex,
                        axis,
                        half_angle,
                        convex: true,
                    },
                ),
                "sphere" => self
                    .center
                    .zip(self.radius)
                    .map(|(center, radius)| Surface::Sphere {
                        center,
                        radius,
                        convex: true,
                    }),
                _ => return Ok(None),
            };
        let missing = || format!("is a {} without its numbers", self.kind);
        surface.map(Some).ok_or_else(missing)
    }
}

impl BoundaryJson {
    fn points(&self, truth: &TruthJson) -> Option<Vec<Vector3<f64>>> {
        match self.kind.as_str() {
            "line" => {
                let ends = truth.lines.get(self.index)?;
                (ends.iter())
                    .map(|end| truth.junctions.get(*end).copied())
                    .collect()
            }
            "curve" => Some(truth.curves.get(self.index)?.points.clone()),
            _ => {
                let edge = truth.smooth_edges.get(self.index)?;
                // A seam is where a model happens to be cut open.
                let is_seam = edge.reason.as_deref() == Some("seam");
                Some(if is_seam {
                    Vec::new()
                } else {
                    edge.points.clone()
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUTH: &str = r#"{"junctions": [[0, 0, 0], [1, 0, 0]], "lines": [[0, 1]],
        "curves": [{"points": [[1, 0, 0], [0, 0, 0]]}], "smooth_edges": [],
        "faces": [{"type": "plane", "normal": [0, 0, 1], "offset": 0, "area": 0.5,
                   "edges": [{"kind": "line", "index": 0}, {"kind": "curve", "index": 0}]},
                  {"type": "torus", "area": 2}]}"#;

    #[test]
    fn faces_have_their_surface_and_boundary() {
        let faces = TrueFace::parse(TRUTH.as_bytes(), Path::new("gt.json")).unwrap();
        let (normal, offset) = (Vector3::z(), 0.0);
        assert_eq!(faces[0].surface, Some(Surface::Plane { normal, offset }));
        assert_eq!(faces[0].boundary.len(), 4);
        assert_eq!((faces[1].surface, faces[1].area), (None, 2.0));
        let none = TrueFace::parse(br#"{"junctions": [], "lines": []}"#, Path::new("gt.json"));
        assert!(none.unwrap().is_empty());
    }

    #[test]
    fn broken_faces_are_refused_with_a_reason() {
        for (from, to, reason) in [
            (
                r#""offset": 0, "#,
                "",
                "face 0 is a plane without its numbers",
            ),
            (
                r#""line", "index": 0"#,
                r#""line", "index": 1"#,
                "face 0 names line 1",
            ),
            (
                r#""curve", "index": 0"#,
                r#""smooth", "index": 0"#,
                "names smooth 0",
            ),
            (r#""area": 2"#, r#""area": -2"#, "face 1 has the area -2"),
        ] {
            let text = TRUTH.replacen(from, to, 1);
            let error = TrueFace::parse(text.as_bytes(), Path::new("gt.json")).unwrap_err();
            let message = error.to_string();
            assert!(
                message.contains(reason) && message.contains("gt.json"),
                "{message}"
            );
        }
    }
}
