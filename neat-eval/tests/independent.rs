//! Every protocol against `scripts/check_metrics.py`, an implementation that
//! shares nothing with this one: the stored result gives the stored scores.

use nalgebra::Vector3;
use neat_core::Wireframe3d;
use neat_core::ground_truth::{GroundTruth, read_ground_truth};
use neat_core::ply::read_points;
use neat_eval::{
    EdgePoints, EditDistance, GroundPlane, LimapLength, NeatAbc, NeatSurface, ObservationMask,
    ScannedSurface, StructureScore, foreign,
};
use serde::Serialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Float64 on both sides: only the order of additions differs.
const TOLERANCE: f64 = 1e-9;
/// The script intersects meshes, this crate samples their volume.
const VOLUME_TOLERANCE: f64 = 3e-3;

/// The size of the unit cube on DTU's table, and as a building.
const MILLIMETRES: f64 = 100.0;
const METRES: f64 = 10.0;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

fn stored(protocol: &str) -> Value {
    let text = std::fs::read(data("scores.json")).unwrap();
    serde_json::from_slice::<Value>(&text).unwrap()[protocol].take()
}

/// Every number of `expected` is in `found`, under the same name.
fn assert_scores(found: &impl Serialize, expected: &Value, tolerance: f64) {
    fn compare(found: &Value, expected: &Value, tolerance: f64, path: &str) {
        match expected {
            Value::Object(fields) => {
                for (name, expected) in fields {
                    compare(&found[name], expected, tolerance, &format!("{path}/{name}"));
                }
            }
            Value::Array(list) => {
                assert_eq!(found.as_array().map(Vec::len), Some(list.len()), "{path}");
                for (i, expected) in list.iter().enumerate() {
                    compare(&found[i], expected, tolerance, &format!("{path}/{i}"));
                }
            }
            expected => {
                let (found, expected) = (found.as_f64().unwrap(), expected.as_f64().unwrap());
                let allowed = tolerance * expected.abs().max(1.0);
                assert!(
                    (found - expected).abs() <= allowed,
                    "{path}: {found} is not {expected}"
                );
            }
        }
    }
    assert!(!expected.is_null(), "no stored scores");
    compare(
        &serde_json::to_value(found).unwrap(),
        expected,
        tolerance,
        "",
    );
}

fn truth() -> GroundTruth {
    read_ground_truth(&data("truth.json")).unwrap()
}

fn predicted(scale: f64) -> Wireframe3d {
    let model = foreign::read(&data("predicted.json")).unwrap();
    model.wireframe.map(|p| p * scale)
}

fn scan() -> Vec<Vector3<f64>> {
    read_points(&data("scan.ply")).unwrap()
}

#[test]
fn neat_abc() {
    let scores = NeatAbc::default()
        .evaluate(&predicted(1.0), None, &truth().wireframe)
        .unwrap();
    assert_scores(&scores.wireframe, &stored("neat-abc"), TOLERANCE);
}

#[test]
fn neat_dtu_with_scipys_mat_files() {
    let mut surface = ScannedSurface {
        points: scan(),
        ..Default::default()
    };
    let predicted = predicted(MILLIMETRES);
    let scores = NeatSurface::blended_mvs().evaluate(&predicted, &surface);
    assert_scores(&scores.unwrap(), &stored("neat-blended-mvs"), TOLERANCE);

    surface.mask = Some(ObservationMask::read(&data("ObsMask1_10.mat")).unwrap());
    surface.ground_plane = Some(GroundPlane::read(&data("Plane1.mat")).unwrap());
    for seed in 0..3 {
        // Only equal ends are thinned out, in whatever order.
        let dtu = NeatSurface {
            seed,
            ..NeatSurface::dtu()
        };
        let scores = dtu.evaluate(&predicted, &surface).unwrap();
        assert_scores(&scores, &stored("neat-dtu"), TOLERANCE);
    }
}

#[test]
fn edge_points() {
    let model = foreign::read(&data("parametric_edges.json")).unwrap();
    for (name, protocol) in [
        ("emap", EdgePoints::emap()),
        ("curve-gaussian", EdgePoints::curve_gaussian()),
        ("edge-gaussians", EdgePoints::edge_gaussians()),
        ("nef", EdgePoints::nef()),
    ] {
        let scores = protocol.evaluate(&model, &truth()).unwrap();
        assert_scores(&scores, &stored(name), TOLERANCE);
    }
}

#[test]
fn limap_length() {
    let surface: Vec<_> = scan().iter().map(|p| p / MILLIMETRES).collect();
    let scores = LimapLength::tanks_and_temples()
        .evaluate(&predicted(1.0).segments(), &surface)
        .unwrap();
    assert_scores(&scores.thresholds, &stored("limap-tnt"), TOLERANCE);
}

#[test]
fn structure_score() {
    let truth = truth().wireframe.map(|p| p * METRES);
    let scores = StructureScore::default()
        .evaluate(&predicted(METRES), &truth)
        .unwrap();
    assert_scores(&scores, &stored("hss"), VOLUME_TOLERANCE);
}

#[test]
fn edit_distance() {
    let truth = truth().wireframe.map(|p| p * METRES);
    for (name, register) in [("registered", true), ("plain", false)] {
        let distance = EditDistance {
            register,
            ..EditDistance::default()
        };
        let scores = distance.evaluate(&predicted(METRES), &truth).unwrap();
        assert_scores(&scores.wed, &stored("wed")[name], TOLERANCE);
    }
}
