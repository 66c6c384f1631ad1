//! `surface-and-creases` against the script in Python that comes with the rendered scenes:
//! results that a formula makes of their truth have the scores that the script gives them.
//!
//! A hut is in `tests/data`. The scenes are no part of the repository: set `NEAT_DATA`, or
//! keep them in `../shared/data`.

use nalgebra::{Matrix3, Vector3};
use neat_core::{Camera, Intrinsics, Wireframe3d};
use neat_eval::{CreaseScores, CreaseShares, SceneTruth, SurfaceAndCreases, foreign};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Float64 on both sides: only the order of additions differs.
const TOLERANCE: f64 = 1e-9;
/// The script takes the length of the truth from before its coordinates were rounded.
const LENGTH_TOLERANCE: f64 = 1e-4;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

/// The folder of a rendered scene, or `None`, said aloud, where there is none.
#[expect(clippy::print_stderr, reason = "a skipped test must be seen")]
fn rendered(scene: &str) -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let root = std::env::var_os("NEAT_DATA").map_or_else(|| default.into(), PathBuf::from);
    let dir = root.join("photoreal").join(scene);
    if dir.is_dir() {
        return Some(dir);
    }
    eprintln!(
        "skipped: no rendered scene at {}, set NEAT_DATA",
        dir.display()
    );
    None
}

/// At most three centimetres (times the scale) along an axis; the same for equal arguments.
fn offset(junction: usize, axis: usize, scale: f64) -> f64 {
    let number = (junction * 7919 + axis * 104_729) % 997;
    (number as f64 / 997.0 - 0.5) * 0.06 * scale
}

fn moved(point: &Vector3<f64>, junction: usize, share: f64, scale: f64) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| point[axis] + share * offset(junction, axis, scale))
}

/// A result as bad as any: all junctions moved, every fifth edge missing, others made up, and
/// some of the curves and painted lines.
fn damaged(truth: &SceneTruth) -> Wireframe3d {
    let junctions = truth.wireframe.junctions.iter().enumerate();
    let junctions = junctions.map(|(index, p)| moved(p, index, 1.0, truth.scale));
    let edges = truth.wireframe.edges.iter().enumerate();
    let mut result = Wireframe3d {
        junctions: junctions.collect(),
        edges: edges
            .filter(|(index, _)| index % 5 != 0)
            .map(|(_, edge)| *edge)
            .collect(),
    };
    let count = result.junctions.len();
    result
        .edges
        .extend((0..count).step_by(40).map(|i| [i, (i + 7) % count]));
    let painted: Vec<_> = truth
        .texture_lines
        .iter()
        .map(|line| line.ends().to_vec())
        .collect();
    for line in truth
        .curves
        .iter()
        .step_by(3)
        .chain(painted.iter().step_by(10))
    {
        for (index, point) in line.iter().enumerate() {
            let last = result.junctions.len();
            result.junctions.push(moved(point, last, 0.2, truth.scale));
            if index > 0 {
                result.edges.push([last - 1, last]);
            }
        }
    }
    result
}

type Share = fn(&CreaseShares) -> Option<f64>;

/// The names that the script gives to the shares.
const SHARES: [(&str, Share); 12] = [
    ("J on surface", |s| s.junctions_on_surface),
    ("L on surface (32 per segment)", |s| s.points_on_surface),
    ("completeness (length)", |s| s.completeness),
    ("completeness, edges > 0.5 m", |s| s.completeness_of_long),
    ("completeness, curved", |s| s.completeness_of_curved),
    ("junction recall", |s| s.junction_recall),
    ("junction precision", |s| s.junction_precision),
    ("length on surface", |s| s.length_on_surface),
    ("length on a straight crease", |s| {
        s.length_on_straight_crease
    }),
    ("length on any crease", |s| s.length_on_crease),
    ("length on crease or texture line", |s| {
        s.length_on_crease_or_texture
    }),
    ("F1 (crease precision, completeness)", |s| Some(s.f1)),
];

fn assert_scores(scores: &CreaseScores, scene: &str) {
    let text = std::fs::read(data("creases.json")).unwrap();
    let stored = serde_json::from_slice::<Value>(&text).unwrap()[scene].take();
    let compare = |found: f64, expected: &Value, what: &str| {
        let expected = expected.as_f64().unwrap();
        let tolerance = if what == "truth_length" {
            LENGTH_TOLERANCE
        } else {
            TOLERANCE
        };
        let allowed = tolerance * expected.abs().max(1.0);
        assert!(
            (found - expected).abs() <= allowed,
            "{scene}, {what}: {found} is not {expected}"
        );
    };
    let (junctions, segments) = (scores.junction_accuracy, scores.segment_accuracy);
    for (what, found) in [
        ("ACC-J", junctions.unwrap().mean),
        ("ACC-L", segments.unwrap().mean),
        ("ACC-J median", junctions.unwrap().median),
        ("ACC-L median", segments.unwrap().median),
        ("junctions", scores.predicted.junctions as f64),
        ("edges", scores.predicted.edges as f64),
        ("length", scores.predicted.length),
        ("truth_corners", scores.truth.junctions as f64),
        ("truth_edges", scores.truth.edges as f64),
        ("truth_length", scores.truth.length),
    ] {
        compare(found, &stored[what], what);
    }
    for (index, shares) in scores.thresholds.iter().enumerate() {
        compare(shares.threshold, &stored["taus"][index], "taus");
        for (what, share) in SHARES {
            compare(share(shares).unwrap(), &stored[what][index], what);
        }
    }
}

#[test]
fn a_hut_has_the_scores_of_the_script() {
    let truth = SceneTruth::read(&data("hut")).unwrap();
    let result = foreign::read(&data("hut/result.json")).unwrap();
    let scores = SurfaceAndCreases::default().evaluate(&result.wireframe, &truth);
    assert_scores(&scores.unwrap(), "hut");
}

#[test]
fn rendered_scenes_have_the_scores_of_the_script() {
    for scene in ["house_1", "objects_1", "facade_1"] {
        let Some(dir) = rendered(scene) else {
            return;
        };
        let truth = SceneTruth::read(&dir).unwrap();
        let scores = SurfaceAndCreases::default()
            .evaluate(&damaged(&truth), &truth)
            .unwrap();
        assert_scores(&scores, scene);
        // The bins share out all edges, and the two of the longest are the row of long ones.
        let bins = &scores.by_length;
        let length: f64 = bins.iter().map(|bin| bin.length).sum();
        assert!((length / scores.truth.length - 1.0).abs() < 1e-9);
        let found =
            |index: usize| bins[index].recall.as_ref().map_or(0.0, |r| r[1]) * bins[index].length;
        let of_long = (found(2) + found(3)) / (bins[2].length + bins[3].length);
        assert!((of_long - scores.thresholds[1].completeness_of_long.unwrap()).abs() < 1e-9);
    }
}

/// The cameras of `truth/cameras.json`.
fn cameras(dir: &Path) -> Vec<Camera> {
    let text = std::fs::read(dir.join("truth/cameras.json")).unwrap();
    let list: Vec<Value> = serde_json::from_slice(&text).unwrap();
    let camera = |view: &Value| {
        let number = |name: &str| view[name].as_f64().unwrap();
        let camera_from_world =
            Matrix3::from_fn(|row, column| view["R"][row][column].as_f64().unwrap());
        let (f, cx, cy) = (number("f"), number("cx"), number("cy"));
        Camera {
            intrinsics: Intrinsics::new(f, f, cx, cy),
            world_from_camera: camera_from_world.transpose(),
            center_in_world: Vector3::from_fn(|axis, _| view["centre"][axis].as_f64().unwrap()),
            width: number("width") as u32,
            height: number("height") as u32,
        }
    };
    list.iter().map(camera).collect()
}

/// The truth counts a view only where surfaces beside the edge differ in the image, too; still
/// the length in each bin is almost the same by lines of sight.
#[test]
fn lines_of_sight_agree_with_the_views_that_the_truth_tells() {
    for scene in ["house_1", "objects_1", "facade_1"] {
        let Some(dir) = rendered(scene) else {
            return;
        };
        let mut truth = SceneTruth::read(&dir).unwrap();
        let told = SurfaceAndCreases::default()
            .evaluate(&truth.wireframe, &truth)
            .unwrap();
        truth.edge_views = None;
        truth.cameras = cameras(&dir);
        let seen = SurfaceAndCreases::default()
            .evaluate(&truth.wireframe, &truth)
            .unwrap();
        let lengths = |scores: &CreaseScores| -> Vec<f64> {
            let bins = scores.by_views.as_ref().unwrap();
            bins.iter()
                .map(|bin| bin.length / scores.truth.length)
                .collect()
        };
        for (told, seen) in lengths(&told).iter().zip(lengths(&seen)) {
            assert!((told - seen).abs() < 0.05, "{scene}: {told} and {seen}");
        }
    }
}
