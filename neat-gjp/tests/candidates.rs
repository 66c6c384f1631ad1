//! Local junctions and matching costs against the published code, and the forms
//! that it does not have on scenes small enough to read.

#[path = "../../tests/data/golden/reader.rs"]
mod golden;

use golden::Golden;
use nalgebra::{Matrix3, Matrix4, Vector2, Vector3};
use neat_core::assignment::assign;
use neat_core::{Camera, Intrinsics, LineSegment2};
use neat_gjp::candidates::{
    CandidateConfig, Clustering, Gate, JunctionView, LocalJunction, MatchingConfig, MatchingNorm,
    RenderedSegment, Support, matching_cost,
};

const TRAINING_STEP: &str = "06_training_step";
const ASSIGNMENT: &str = "07_gjp_assignment";

fn points<const D: usize>(golden: &Golden, name: &str) -> Vec<[f32; D]> {
    let narrow = |row: [f64; D]| row.map(|c| c as f32);
    golden.rows(name).into_iter().map(narrow).collect()
}

fn indices(golden: &Golden, name: &str) -> Vec<usize> {
    golden.numbers(name).iter().map(|&n| n as usize).collect()
}

fn assert_near(actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len());
    for (i, (a, e)) in actual.iter().zip(expected).enumerate() {
        assert!((a - e).abs() <= tolerance, "[{i}]: {a}, expected {e}");
    }
}

/// The recorded rays of one view.
struct Batch {
    camera: Camera,
    junctions: Vec<Vector2<f64>>,
    segments: Vec<RenderedSegment>,
}

impl Batch {
    fn open(golden: &Golden) -> Self {
        let k = Matrix3::from_row_slice(&golden.numbers("in/K"));
        let pose = Matrix4::from_row_slice(&golden.numbers("in/pose_c2w"));
        let ends: Vec<[f32; 3]> = points(golden, "common/lines3d");
        let detected = golden.rows::<5>("in/lines2d");
        let segments = ends
            .chunks(2)
            .zip(detected)
            .map(|(ends, [x1, y1, x2, y2, _score])| RenderedSegment {
                view: 0,
                ends_in_world: [ends[0], ends[1]],
                detected: LineSegment2::new(Vector2::new(x1, y1), Vector2::new(x2, y2)),
            })
            .collect();
        let junctions = golden.rows::<2>("in/junctions2d");
        Self {
            camera: Camera::from_matrices(Intrinsics::from_matrix(&k), &pose, 512, 512),
            junctions: junctions.into_iter().map(Vector2::from).collect(),
            segments,
        }
    }

    fn local_junctions(&self, config: &CandidateConfig) -> Vec<LocalJunction> {
        let view = JunctionView {
            camera: &self.camera,
            junctions_in_image: &self.junctions,
        };
        config.local_junctions(&self.segments, &[view]).unwrap()
    }
}

/// Checks one mode of the published code; `candidates` are what it matched with
/// the detected junctions, `limit` its gate in pixels.
fn assert_published(mode: &str, config: CandidateConfig, candidates: &str, limit: f64) {
    let golden = Golden::open(TRAINING_STEP);
    let batch = Batch::open(&golden);
    let candidates: Vec<[f32; 3]> = points(&golden, candidates);
    let cost = golden.numbers(&format!("f64.{mode}/jcost"));
    let rows = indices(&golden, &format!("{mode}/jassign_row_junction2d"));
    let columns = indices(&golden, &format!("{mode}/jassign_col_candidate"));

    let ungated = CandidateConfig {
        gate: Gate::Pixels(f64::INFINITY),
        ..config
    };
    let matched = batch.local_junctions(&ungated);
    assert_eq!(matched.len(), rows.len());
    for ((local, row), column) in matched.iter().zip(rows).zip(columns) {
        let support = local.support.unwrap();
        assert_eq!((support.view, support.junction), (0, row));
        let expected = cost[row * candidates.len() + column];
        // The accepted error of a projection in float32.
        assert_near(&[support.distance_in_pixels], &[expected], 2e-3);
        for axis in 0..3 {
            assert!((local.in_world[axis] - candidates[column][axis]).abs() < 1e-6);
        }
    }

    let kept = batch.local_junctions(&config);
    let within = |local: &&LocalJunction| local.support.unwrap().distance_in_pixels < limit;
    let expected: Vec<LocalJunction> = matched.iter().filter(within).copied().collect();
    assert_eq!(kept, expected);

    let in_world: Vec<f64> = kept
        .iter()
        .flat_map(|l| l.in_world.map(f64::from))
        .collect();
    assert_near(
        &in_world,
        &golden.numbers(&format!("{mode}/j3d_local")),
        1e-6,
    );
    let pixels: Vec<f64> = kept
        .iter()
        .map(|l| {
            batch
                .camera
                .project(&Vector3::from(l.in_world.map(f64::from)))
        })
        .flat_map(|projection| [projection.pixel.x, projection.pixel.y])
        .collect();
    assert_near(&pixels, &golden.numbers(&format!("{mode}/j2d_local")), 2e-3);
}

#[test]
fn clustered_candidates_are_the_published_ones() {
    let config = CandidateConfig::published();
    assert_published("dbscan", config, "dbscan/dbscan_means", 10.0);
}

#[test]
fn candidates_below_the_median_are_the_published_ones() {
    let median = Golden::open(TRAINING_STEP).numbers("median/median")[0];
    let config = CandidateConfig::published_toy();
    // The recorded median is float32: far nearer to itself than to its neighbours.
    assert_published("median", config, "common/lines3d", median - 1e-3);
}

#[test]
fn the_matching_cost_of_a_training_step_is_the_published_one() {
    let golden = Golden::open(TRAINING_STEP);
    let published = MatchingConfig::published();
    for mode in ["dbscan", "median"] {
        let cost = matching_cost(
            &points(&golden, &format!("{mode}/j3d_local")),
            &points(&golden, &format!("{mode}/j2d_local_calib")),
            &points(&golden, &format!("{mode}/j3d_global")),
            &points(&golden, &format!("{mode}/j2d_global_calib")),
            published.weight_2d,
            published.norm,
        );
        assert_near(&cost, &golden.numbers(&format!("{mode}/gcost")), 1e-5);
    }
}

#[test]
fn matching_costs_and_assignments_are_the_published_ones() {
    let golden = Golden::open(ASSIGNMENT);
    let published = MatchingConfig::published();
    for case in ["p20x64", "p64x64", "p90x64"] {
        let local: Vec<[f32; 3]> = points(&golden, &format!("{case}/j3d_local"));
        let global: Vec<[f32; 3]> = points(&golden, &format!("{case}/j3d_global"));
        let cost = matching_cost(
            &local,
            &points(&golden, &format!("{case}/j2d_local_calib")),
            &global,
            &points(&golden, &format!("{case}/j2d_global_calib")),
            published.weight_2d,
            published.norm,
        );
        assert_near(&cost, &golden.numbers(&format!("f64.{case}/cost")), 1e-5);

        let matching = assign(&cost, local.len(), global.len()).unwrap();
        let total = golden.numbers(&format!("f64.{case}/total_cost"))[0];
        assert_near(&[matching.total_cost], &[total], 1e-5 * total);
        // p64x64 has many best assignments; the others have one.
        if case != "p64x64" {
            let rows = indices(&golden, &format!("{case}/assign_row_local"));
            let columns = indices(&golden, &format!("{case}/assign_col_global"));
            let expected: Vec<_> = rows.into_iter().zip(columns).collect();
            assert_eq!(matching.pairs().collect::<Vec<_>>(), expected, "{case}");
        }
    }
}

#[test]
fn without_weight_the_cost_is_the_distance_in_the_world() {
    let cost = |norm| {
        matching_cost(
            &[[0.0; 3]],
            &[],
            &[[3.0, -4.0, 0.0], [0.0; 3]],
            &[],
            0.0,
            norm,
        )
    };
    assert_eq!(cost(MatchingNorm::L1), [7.0, 0.0]);
    assert_eq!(cost(MatchingNorm::L2), [5.0, 0.0]);
}

/// At the origin, looking along +Z, focal length 100: the plane z = 1 has 100
/// pixels per unit.
fn camera() -> Camera {
    let intrinsics = Intrinsics {
        fx: 100.0,
        fy: 100.0,
        cx: 0.0,
        cy: 0.0,
        skew: 0.0,
    };
    Camera::from_matrices(intrinsics, &Matrix4::identity(), 200, 200)
}

fn segment(view: usize, ends_in_world: [[f32; 3]; 2], detected: [[f64; 2]; 2]) -> RenderedSegment {
    let [start, end] = detected.map(Vector2::from);
    RenderedSegment {
        view,
        ends_in_world,
        detected: LineSegment2::new(start, end),
    }
}

fn positions(local: &[LocalJunction]) -> Vec<[f32; 3]> {
    local.iter().map(|junction| junction.in_world).collect()
}

#[test]
fn any_junction_keeps_what_is_near_one_in_its_own_view_and_then_clusters() {
    let camera = camera();
    let (first, second) = ([Vector2::new(50.0, 0.0)], [Vector2::new(0.0, 50.0)]);
    let views = [&first, &second].map(|junctions_in_image| JunctionView {
        camera: &camera,
        junctions_in_image,
    });
    let anywhere = [[0.0; 2]; 2];
    let segments = [
        // 5 px off, and exactly 10 px off, which is not within.
        segment(0, [[0.45, 0.0, 1.0], [0.6, 0.0, 1.0]], anywhere),
        // Near the junction of the other view only.
        segment(1, [[0.5, 0.0, 1.0], [0.0, 0.5, 1.0]], anywhere),
        // Behind the camera, and next to the first end point.
        segment(0, [[-0.5, 0.0, -1.0], [0.455, 0.0, 1.0]], anywhere),
    ];
    let unclustered = CandidateConfig {
        clustering: Clustering::None,
        ..CandidateConfig::paper()
    };
    let local = unclustered.local_junctions(&segments, &views).unwrap();
    assert_eq!(
        positions(&local),
        [[0.45, 0.0, 1.0], [0.0, 0.5, 1.0], [0.455, 0.0, 1.0]]
    );

    let local = CandidateConfig::paper()
        .local_junctions(&segments, &views)
        .unwrap();
    assert_eq!(positions(&local), [[0.4525, 0.0, 1.0]]);
}

#[test]
fn own_end_keeps_what_is_near_its_end_in_the_better_order() {
    let camera = camera();
    let junctions = [Vector2::new(90.0, 0.0)];
    let views = [JunctionView {
        camera: &camera,
        junctions_in_image: &junctions,
    }];
    let detected = [[0.0, 0.0], [50.0, 0.0]];
    let segments = [
        segment(0, [[0.02, 0.0, 1.0], [0.52, 0.0, 1.0]], detected),
        segment(0, [[0.53, 0.0, 1.0], [0.03, 0.0, 1.0]], detected),
        // Near a detected junction, but far from its own end.
        segment(0, [[0.04, 0.0, 1.0], [0.9, 0.0, 1.0]], detected),
        segment(0, [[f32::NAN; 3], [f32::NAN; 3]], detected),
    ];
    let local = CandidateConfig::fast()
        .local_junctions(&segments, &views)
        .unwrap();
    let expected = [0.02, 0.52, 0.53, 0.03, 0.04].map(|x| [x, 0.0, 1.0]);
    assert_eq!(positions(&local), expected);
    assert!(local.iter().all(|junction| junction.support.is_none()));
}

#[test]
fn without_candidates_or_junctions_there_are_no_local_junctions() {
    let camera = camera();
    let junctions = [Vector2::new(50.0, 0.0)];
    let scattered = segment(0, [[0.45, 0.0, 1.0], [0.9, 0.0, 1.0]], [[500.0; 2]; 2]);
    let broken = segment(0, [[f32::NAN; 3], [f32::INFINITY; 3]], [[0.0; 2]; 2]);
    let local = |config: &CandidateConfig, segments: &[RenderedSegment], junctions: &[_]| {
        let view = JunctionView {
            camera: &camera,
            junctions_in_image: junctions,
        };
        config.local_junctions(segments, &[view]).unwrap()
    };
    for config in [
        CandidateConfig::published(),
        CandidateConfig::published_toy(),
        CandidateConfig::paper(),
        CandidateConfig::fast(),
    ] {
        assert!(local(&config, &[], &junctions).is_empty());
        assert!(local(&config, &[broken], &junctions).is_empty());
        assert!(local(&config, &[scattered], &[]).is_empty());
    }
    // No two end points are near each other: the published code crashes here.
    assert!(local(&CandidateConfig::published(), &[scattered], &junctions).is_empty());
}

#[test]
fn the_configuration_reads_from_toml() {
    let text = r#"
        support = "own-end"
        gate = { pixels = 5.0 }
        clustering = { dbscan = { eps = 0.02, min_samples = 3 } }
    "#;
    let config: CandidateConfig = toml::from_str(text).unwrap();
    let expected = CandidateConfig {
        support: Support::OwnEnd,
        gate: Gate::Pixels(5.0),
        clustering: Clustering::Dbscan {
            eps: 0.02,
            min_samples: 3,
        },
    };
    assert_eq!(config, expected);

    let text = toml::to_string(&CandidateConfig::published_toy()).unwrap();
    assert_eq!(
        toml::from_str::<CandidateConfig>(&text).unwrap(),
        CandidateConfig::published_toy()
    );
    assert_eq!(
        toml::from_str::<CandidateConfig>("").unwrap(),
        CandidateConfig::published()
    );
    assert!(toml::from_str::<CandidateConfig>("gates = 5.0").is_err());
}
