//! Results of other programs.
//!
//! | ending | what | written by |
//! | --- | --- | --- |
//! | `.json` | `junctions` and `edges` or `lines`, `arcs` and `splines` | neat |
//! | `.json` | `lines_end_pts`, `curves_ctl_pts` | EMAP and its successors, as `parametric_edges.json` |
//! | `.npz` | `lines3d` `[n, 2, 3]` | the published NEAT |
//! | `.npy` | `[n, 2, 3]` or `[n, 6]` | LIMAP |
//! | `.obj` | `v` and `l` | LIMAP, Line3D++, neat, CAD programs |
//! | `.ply` | `vertex`, and `edge` with `vertex1` and `vertex2` | neat, MeshLab, Open3D |
//! | `.txt` | a 3D line per line, with its 2D residuals | Line3D++ |
//!
//! Formats without junctions give a graph in which ends that are exactly equal
//! are one junction. `curves` of a `gt_wireframe.json` are part of a truth only.

mod line3dpp;
mod numpy;
mod obj;
mod parametric_edges;
mod ply;

pub use line3dpp::parse_line3dpp;
pub use numpy::{parse_neat_npz, parse_npy_lines};
pub use obj::parse_obj;
pub use parametric_edges::parse_parametric_edges;
pub use ply::parse_ply_edges;

use crate::edge_model::{CubicBezier, EdgeModel};
use crate::error::EvalError;
use nalgebra::Vector3;
use neat_core::ground_truth::{self, GroundTruth};
use neat_core::{CircularArc, LineSegment3, SceneError, Spline, Wireframe3d, file};
use serde::Deserialize;
use std::path::Path;

const REMEDY: &str = "give a result as .json, .obj, .ply, .npz, .npy or Line3D++'s .txt";

/// Reads the edges of a result; the ending of its name says how.
///
/// # Errors
/// If the file is missing, empty, damaged, or its ending is none of those above.
pub fn read(path: &Path) -> Result<EdgeModel, EvalError> {
    let parse: fn(&[u8], &Path) -> Result<EdgeModel, SceneError> = match ending(path).as_str() {
        "json" => parse_json,
        "npz" => |bytes, path| parse_neat_npz(bytes, path).map(EdgeModel::from),
        "npy" => |bytes, path| parse_npy_lines(bytes, path).map(EdgeModel::from),
        "obj" => |bytes, path| parse_obj(bytes, path).map(EdgeModel::from),
        "ply" => |bytes, path| parse_ply_edges(bytes, path).map(EdgeModel::from),
        "txt" => |bytes, path| parse_line3dpp(bytes, path).map(EdgeModel::from),
        _ => return Err(EvalError::UnknownFormat { path: path.into() }),
    };
    Ok(parse(&file::read(path, REMEDY)?, path)?)
}

/// Reads true edges: a `gt_wireframe.json` with its curves, or straight edges of
/// any format of [`read`].
///
/// # Errors
/// As [`read`].
pub fn read_truth(path: &Path) -> Result<GroundTruth, EvalError> {
    if ending(path) == "json" {
        return Ok(ground_truth::read_ground_truth(path)?);
    }
    Ok(GroundTruth {
        wireframe: read(path)?.wireframe,
        curves: Vec::new(),
    })
}

fn ending(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_lowercase()
}

/// Either of the two kinds of JSON.
fn parse_json(bytes: &[u8], path: &Path) -> Result<EdgeModel, SceneError> {
    if parametric_edges::is_parametric(bytes) {
        parse_parametric_edges(bytes, path)
    } else {
        let truth = ground_truth::parse(bytes, path)?;
        Ok(EdgeModel {
            wireframe: truth.wireframe,
            curves: curves(bytes, path)?,
        })
    }
}

/// The curves of the arcs and then the splines of a `wireframe.json`.
fn curves(bytes: &[u8], path: &Path) -> Result<Vec<CubicBezier>, SceneError> {
    #[derive(Deserialize)]
    struct WithCurves {
        #[serde(default)]
        arcs: Vec<CircularArc>,
        #[serde(default)]
        splines: Vec<Spline>,
    }
    let WithCurves { arcs, splines } =
        serde_json::from_slice(bytes).map_err(|error| malformed(path, error.to_string()))?;
    if let Some(arc) = arcs.iter().position(|arc| !arc.is_valid()) {
        return Err(malformed(path, format!("arc {arc} is none")));
    }
    if let Some(spline) = splines.iter().position(|spline| !spline.is_valid()) {
        return Err(malformed(path, format!("spline {spline} is none")));
    }
    let of_arcs = arcs.iter().flat_map(CubicBezier::of_arc);
    let of_splines = splines.iter().flat_map(CubicBezier::of_spline);
    Ok(of_arcs.chain(of_splines).collect())
}

/// [`SceneError::Malformed`] for the file at `path`.
fn malformed(path: &Path, reason: String) -> SceneError {
    SceneError::Malformed {
        path: path.into(),
        reason,
    }
}

/// A segment of six numbers: one end, then the other.
fn segment_of(&[a, b, c, d, e, f]: &[f64; 6]) -> LineSegment3 {
    LineSegment3::new(Vector3::new(a, b, c), Vector3::new(d, e, f))
}

/// The graph, if its edges name vertices that exist and all is finite.
fn checked(wireframe: Wireframe3d, path: &Path) -> Result<Wireframe3d, SceneError> {
    neat_wireframe::validity::check_wireframe(&wireframe.junctions, &wireframe.edges)
        .map_err(|flaw| malformed(path, flaw.to_string()))?;
    Ok(wireframe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use neat_core::ground_truth::write_wireframe;
    use neat_core::npz::{NpyArray, write_npz};
    use neat_wireframe::export::{WireframeDocument, write_json, write_obj, write_ply};
    use proptest::prelude::*;

    #[test]
    fn arcs_and_splines_of_a_wireframe_are_curves_and_must_be_such() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("wireframe.json");
        let arc = CircularArc {
            center: Vector3::new(1.0, 2.0, 3.0),
            axes: [Vector3::x(), Vector3::y()],
            radius: 2.0,
            angles: [0.0, 1.5],
        };
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 1.0]];
        let spline = Spline {
            controls: corners.map(|[x, y]| Vector3::new(x, y, 0.5)).to_vec(),
            closed: true,
        };
        let document = WireframeDocument {
            junctions: vec![Vector3::zeros(), Vector3::x()],
            edges: vec![[0, 1]],
            arcs: vec![arc],
            splines: vec![spline.clone()],
            ..Default::default()
        };
        write_json(&path, &document).unwrap();
        let model = read(&path).unwrap();
        let expected = [CubicBezier::of_arc(&arc), CubicBezier::of_spline(&spline)];
        assert_eq!(model.curves, expected.concat());
        assert_eq!(model.wireframe.edges, [[0, 1]]);
        let is_refused = |document: &WireframeDocument, named| {
            std::fs::write(&path, serde_json::to_vec(document).unwrap()).unwrap();
            assert!(read(&path).unwrap_err().to_string().contains(named));
            assert!(write_json(&path, document).is_err());
        };
        let mut bad = document.clone();
        bad.arcs[0].radius = -1.0;
        is_refused(&bad, "arc 0");
        bad = document;
        bad.splines[0].controls.truncate(2);
        is_refused(&bad, "spline 0");
    }
    use std::collections::BTreeMap;
    use std::fs;

    fn l_shape() -> Wireframe3d {
        Wireframe3d {
            junctions: [[0.0, 0.5, 0.0], [1.25, 0.5, 0.0], [1.25, 2.0, -3.0]]
                .map(Vector3::from)
                .to_vec(),
            edges: vec![[0, 1], [1, 2]],
        }
    }

    /// The same wireframe in every format, as (name, bytes).
    fn every_format() -> Vec<(&'static str, Vec<u8>)> {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str| dir.path().join(name);
        write_wireframe(&file("a.json"), &l_shape()).unwrap();
        write_obj(&file("a.obj"), &l_shape(), &[]).unwrap();
        write_ply(&file("a.ply"), &l_shape(), &[]).unwrap();
        let ends = l_shape().segments();
        let values = ends.iter().flat_map(|s| s.ends());
        let lines = NpyArray {
            shape: vec![2, 2, 3],
            values: values.flat_map(|p| [p.x, p.y, p.z]).collect(),
        };
        write_npz(&file("a.npz"), &BTreeMap::from([("lines3d", lines)])).unwrap();
        fs::write(
            file("a.txt"),
            "1 0 0.5 0 1.25 0.5 0 2 0 7 1 2 3 4 5 9 10 20 30 40\n1 1.25 0.5 0 1.25 2 -3 0\n",
        )
        .unwrap();
        fs::write(
            file("parametric_edges.json"),
            r#"{"curves_ctl_pts": [], "lines_end_pts":
                [[[0, 0.5, 0], [1.25, 0.5, 0]], [1.25, 0.5, 0, 1.25, 2, -3]]}"#,
        )
        .unwrap();
        [
            "a.json",
            "a.obj",
            "a.ply",
            "a.npz",
            "a.txt",
            "parametric_edges.json",
        ]
        .into_iter()
        .map(|name| (name, fs::read(file(name)).unwrap()))
        .collect()
    }

    #[test]
    fn every_format_gives_the_same_graph() {
        let dir = tempfile::tempdir().unwrap();
        for (name, bytes) in every_format() {
            let path = dir.path().join(name);
            fs::write(&path, bytes).unwrap();
            assert_eq!(read(&path).unwrap().wireframe, l_shape(), "{name}");
            if name != "parametric_edges.json" {
                assert_eq!(read_truth(&path).unwrap().wireframe, l_shape(), "{name}");
            }
        }
    }

    #[test]
    fn errors_name_the_file() {
        let message = |name: &str| read(Path::new(name)).unwrap_err().to_string();
        assert!(message("/nowhere/a.obj").contains("a.obj does not exist"));
        assert!(message("result.dxf").contains("no reader for this ending"));
    }

    fn parse_any(name: &str, bytes: &[u8]) -> Option<EdgeModel> {
        let path = Path::new(name);
        match name.rsplit('.').next().unwrap() {
            "json" => parse_json(bytes, path).ok(),
            "obj" => parse_obj(bytes, path).ok().map(EdgeModel::from),
            "ply" => parse_ply_edges(bytes, path).ok().map(EdgeModel::from),
            "npz" => parse_neat_npz(bytes, path).ok().map(EdgeModel::from),
            _ => parse_line3dpp(bytes, path).ok().map(EdgeModel::from),
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]
        #[test]
        fn damaged_and_truncated_files_do_not_panic(
            changes in prop::collection::vec(
                (any::<prop::sample::Index>(), prop::collection::vec(any::<u8>(), 0..4), 0..4_usize),
                1..4,
            ),
            end: prop::sample::Index,
            truncate: bool,
        ) {
            for (name, bytes) in every_format() {
                let mut damaged = bytes.clone();
                for (at, new, removed) in &changes {
                    let at = at.index(damaged.len().max(1));
                    let end = (at + removed).min(damaged.len());
                    damaged.splice(at.min(end)..end, new.iter().copied());
                }
                if truncate {
                    damaged.truncate(end.index(damaged.len().max(1)));
                }
                if let Some(model) = parse_any(name, &damaged) {
                    prop_assert!(checked(model.wireframe, Path::new(name)).is_ok());
                }
            }
        }
    }
}
