//! The exact truth of a rendered scene: its folder `truth`.
//!
//! | file | what |
//! | --- | --- |
//! | `stats.json` | `scale`: what the thresholds are multiplied by; 1 where it is not there |
//! | `wireframe.json` | `junctions` and `edges`: straight creases that images can show; perhaps `cut_end`, which junctions are no corners but places where an edge stops being seen, and `edge_views`, by which views each edge is seen |
//! | `curved.json` | creases that are not straight, as polylines |
//! | `texture_lines.json` | straight lines that are painted, as pairs of points; need not be there |
//! | `mesh.ply` | all surfaces |

use crate::triangle_mesh::TriangleMesh;
use nalgebra::Vector3;
use neat_core::{Camera, LineSegment3, SceneError, Wireframe3d, file, ground_truth};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::path::Path;

/// What a wireframe of a rendered scene is measured against, all in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneTruth {
    /// Thresholds and the spacing of samples are those of a house of metres times this.
    pub scale: f64,
    /// The straight creases.
    pub wireframe: Wireframe3d,
    /// Which junctions only end where an edge stops being seen; empty if none does.
    pub cut_ends: Vec<bool>,
    /// How many views see more than half of each edge, where that is known.
    pub edge_views: Option<Vec<usize>>,
    /// The other creases, as polylines.
    pub curves: Vec<Vec<Vector3<f64>>>,
    /// Painted lines: no crease, but not made up either.
    pub texture_lines: Vec<LineSegment3>,
    /// All surfaces.
    pub surface: TriangleMesh,
    /// The cameras of the scene: who sees an edge is found with them where `edge_views`
    /// is not known.
    pub cameras: Vec<Camera>,
}

impl Default for SceneTruth {
    fn default() -> Self {
        Self {
            scale: 1.0,
            wireframe: Wireframe3d::default(),
            cut_ends: Vec::new(),
            edge_views: None,
            curves: Vec::new(),
            texture_lines: Vec::new(),
            surface: TriangleMesh::default(),
            cameras: Vec::new(),
        }
    }
}

/// Of `stats.json`.
#[derive(Deserialize)]
struct Stats {
    #[serde(default = "one")]
    scale: f64,
}

fn one() -> f64 {
    1.0
}

/// Of `wireframe.json`, what [`ground_truth`] does not read.
#[derive(Deserialize)]
struct EdgeFacts {
    cut_end: Option<Vec<bool>>,
    /// The number of views is asked, not which they are.
    edge_views: Option<Vec<Vec<IgnoredAny>>>,
}

const REMEDY: &str = "give a scene with its truth: a folder `truth` with stats.json, wireframe.json, curved.json and mesh.ply";

impl SceneTruth {
    /// Reads the folder `truth` of the scene in `dir`; there are no cameras in it.
    ///
    /// # Errors
    /// If a file is missing, empty or damaged, or the files do not fit each other.
    pub fn read(dir: &Path) -> Result<Self, SceneError> {
        let folder = dir.join("truth");
        let path = |name: &str| folder.join(name);
        let bytes = |name: &str| file::read(&path(name), REMEDY);
        let texture = match path("texture_lines.json").exists() {
            true => parse_texture(&bytes("texture_lines.json")?, &path("texture_lines.json"))?,
            false => Vec::new(),
        };
        Ok(Self {
            scale: parse_scale(&bytes("stats.json")?, &path("stats.json"))?,
            curves: file::parse_json(
                &bytes("curved.json")?,
                &path("curved.json"),
                "list of curves",
            )?,
            texture_lines: texture,
            surface: TriangleMesh::parse(&bytes("mesh.ply")?, &path("mesh.ply"))?,
            ..Self::parse_wireframe(&bytes("wireframe.json")?, &path("wireframe.json"))?
        })
    }

    /// A truth that has what `wireframe.json` says, and nothing else; `path` is for messages.
    ///
    /// # Errors
    /// If the bytes are no such JSON, an edge names a junction that is not there, or there
    /// are not as many facts as junctions or edges.
    pub fn parse_wireframe(bytes: &[u8], path: &Path) -> Result<Self, SceneError> {
        let wireframe = ground_truth::parse(bytes, path)?.wireframe;
        let facts: EdgeFacts = file::parse_json(bytes, path, "true wireframe")?;
        let check = |name: &str, found: usize, what: &str, expected: usize| match found == expected
        {
            true => Ok(()),
            false => Err(SceneError::malformed(
                path,
                format!("`{name}` has {found} entries for {expected} {what}"),
            )),
        };
        if let Some(cut_end) = &facts.cut_end {
            check(
                "cut_end",
                cut_end.len(),
                "junctions",
                wireframe.junctions.len(),
            )?;
        }
        if let Some(views) = &facts.edge_views {
            check("edge_views", views.len(), "edges", wireframe.edges.len())?;
        }
        let count = |views: Vec<Vec<IgnoredAny>>| views.iter().map(Vec::len).collect();
        Ok(Self {
            wireframe,
            cut_ends: facts.cut_end.unwrap_or_default(),
            edge_views: facts.edge_views.map(count),
            ..Self::default()
        })
    }

    /// The junctions that are corners.
    pub(super) fn corners(&self) -> Vec<Vector3<f64>> {
        let is_cut = |index: usize| self.cut_ends.get(index).copied().unwrap_or(false);
        let junctions = self.wireframe.junctions.iter().enumerate();
        junctions
            .filter(|(index, _)| !is_cut(*index))
            .map(|(_, p)| *p)
            .collect()
    }

    /// The pieces of all curves.
    pub(super) fn curve_pieces(&self) -> Vec<LineSegment3> {
        let pieces = self.curves.iter().flat_map(|curve| curve.windows(2));
        pieces
            .map(|ends| LineSegment3::new(ends[0], ends[1]))
            .collect()
    }
}

fn parse_scale(bytes: &[u8], path: &Path) -> Result<f64, SceneError> {
    let Stats { scale } = file::parse_json(bytes, path, "description of a true scene")?;
    match super::is_positive(scale) {
        true => Ok(scale),
        false => Err(SceneError::malformed(
            path,
            format!("`scale` is {scale}, not above zero"),
        )),
    }
}

fn parse_texture(bytes: &[u8], path: &Path) -> Result<Vec<LineSegment3>, SceneError> {
    let pairs: Vec<[Vector3<f64>; 2]> = file::parse_json(bytes, path, "list of lines")?;
    Ok((pairs.into_iter())
        .map(|[start, end]| LineSegment3::new(start, end))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle_mesh::tests::CUBE;
    use std::fs;

    const FILES: [(&str, &str); 5] = [
        ("stats.json", r#"{"scene": "cube", "scale": 0.5}"#),
        (
            "wireframe.json",
            r#"{"junctions": [[0, 0, 0], [1, 0, 0], [0.5, 0, 0]], "edges": [[0, 1], [0, 2]],
                "cut_end": [false, false, true], "edge_views": [[0, 3, 4], []]}"#,
        ),
        ("curved.json", "[[[0, 0, 0], [0, 1, 0], [0, 1, 1]], []]"),
        ("texture_lines.json", "[[[0, 0, 1], [1, 0, 1]]]"),
        ("mesh.ply", CUBE),
    ];

    /// The scene, with `from` replaced in the file `name`.
    fn read(name: &str, from: &str, to: &str) -> Result<SceneTruth, SceneError> {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("truth")).unwrap();
        for (file, text) in FILES {
            let text = if file == name {
                text.replacen(from, to, 1)
            } else {
                text.into()
            };
            fs::write(dir.path().join("truth").join(file), text).unwrap();
        }
        SceneTruth::read(dir.path())
    }

    #[test]
    fn all_files_are_read() {
        let truth = read("", "", "").unwrap();
        assert_eq!(truth.scale, 0.5);
        assert_eq!(truth.corners(), truth.wireframe.junctions[..2]);
        assert_eq!(truth.edge_views, Some(vec![3, 0]));
        assert_eq!(truth.curve_pieces().len(), 2);
        assert_eq!(truth.texture_lines[0].length(), 1.0);
        assert_eq!(truth.surface.triangles.len(), 12);
        assert!(truth.cameras.is_empty());
        let plain = read("wireframe.json", "cut_end", "other").unwrap();
        assert_eq!(plain.corners().len(), 3);
        assert_eq!(read("stats.json", "scale", "other").unwrap().scale, 1.0);
    }

    #[test]
    fn texture_lines_need_not_be_there_and_all_else_must() {
        for (file, _) in FILES {
            let dir = tempfile::tempdir().unwrap();
            fs::create_dir(dir.path().join("truth")).unwrap();
            for (other, text) in FILES.iter().filter(|(other, _)| *other != file) {
                fs::write(dir.path().join("truth").join(other), text).unwrap();
            }
            match SceneTruth::read(dir.path()) {
                Ok(truth) => assert!(truth.texture_lines.is_empty(), "without {file}"),
                Err(error) => {
                    let message = error.to_string();
                    assert!(
                        message.contains(file) && message.contains("give a scene"),
                        "{message}"
                    );
                }
            }
        }
    }

    #[test]
    fn files_that_do_not_fit_are_refused_with_a_reason() {
        for (file, from, to, reason) in [
            ("stats.json", "0.5", "0", "`scale` is 0"),
            ("stats.json", "0.5", "-1", "not above zero"),
            ("stats.json", "0.5", "1e-320", "not above zero"),
            ("stats.json", "{", "", "not a valid description"),
            (
                "wireframe.json",
                ", true",
                "",
                "`cut_end` has 2 entries for 3 junctions",
            ),
            (
                "wireframe.json",
                ", []",
                "",
                "`edge_views` has 1 entries for 2 edges",
            ),
            (
                "wireframe.json",
                "[0, 2]",
                "[0, 3]",
                "edge 1 names junction 3",
            ),
            (
                "curved.json",
                "[0, 1, 1]",
                "[0, 1]",
                "not a valid list of curves",
            ),
            (
                "texture_lines.json",
                ", [1, 0, 1]",
                "",
                "not a valid list of lines",
            ),
            ("mesh.ply", "4 0 1 2 3", "4 0 1 2 9", "names vertex 9"),
        ] {
            let message = read(file, from, to).unwrap_err().to_string();
            assert!(
                message.contains(reason) && message.contains(file),
                "{message}"
            );
        }
    }
}
