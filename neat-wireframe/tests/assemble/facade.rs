//! A façade: a plane with a grid of equal windows, seen by few cameras that stand
//! on a line in front of it. Repetition makes wrong matches, and edges along the
//! baseline cannot be triangulated by any pair of views: they are missing.

use crate::scores::scores_within;
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::{Camera, Intrinsics, LineSegment2, ScoredSegment2, Wireframe3d};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::{AssembleConfig, assemble};

/// Reproducible uniform numbers in [-1, 1) (SplitMix64).
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// 5 × 3 windows, each 0.12 wide and 0.2 high, in the plane z = 0.
fn facade() -> Wireframe3d {
    let mut wireframe = Wireframe3d::default();
    for column in -2..=2 {
        for row in -1..=1 {
            let center = Vector3::new(0.3 * f64::from(column), 0.35 * f64::from(row), 0.0);
            let first = wireframe.junctions.len();
            for (x, y) in [(-0.06, -0.1), (0.06, -0.1), (0.06, 0.1), (-0.06, 0.1)] {
                wireframe.junctions.push(center + Vector3::new(x, y, 0.0));
            }
            let corner = |k: usize| first + k % 4;
            wireframe
                .edges
                .extend((0..4).map(|k| [corner(k), corner(k + 1)]));
        }
    }
    wireframe
}

/// Cameras at z = -2.5 on a line along x, all turned to the middle.
fn cameras() -> Vec<Camera> {
    (0..9)
        .map(|i| {
            let center = Vector3::new(0.3 * f64::from(i - 4), 0.05, -2.5);
            let forward = -center.normalize();
            let right = Vector3::y().cross(&forward).normalize();
            Camera {
                intrinsics: Intrinsics {
                    fx: 1000.0,
                    fy: 1000.0,
                    cx: 500.0,
                    cy: 400.0,
                    skew: 0.0,
                },
                world_from_camera: Matrix3::from_columns(&[right, forward.cross(&right), forward]),
                center_in_world: center,
                width: 1000,
                height: 800,
            }
        })
        .collect()
}

/// Vertices with 0.4 pixels of noise; 85 % of the edges; 20 false ones per view.
fn observe(camera: &Camera, truth: &Wireframe3d, noise: &mut Noise) -> ViewObservation {
    let vertices: Vec<Vector2<f64>> = truth
        .junctions
        .iter()
        .map(|junction| {
            let jitter = Vector2::new(noise.uniform(), noise.uniform()) * 0.7;
            camera.project(junction).pixel + jitter
        })
        .collect();
    let mut segments: Vec<LineSegment2> = truth
        .edges
        .iter()
        .filter(|_| noise.uniform() < 0.7)
        .map(|[a, b]| LineSegment2::new(vertices[*a], vertices[*b]))
        .collect();
    for _ in 0..20 {
        let middle = Vector2::new(
            500.0 + 400.0 * noise.uniform(),
            400.0 + 300.0 * noise.uniform(),
        );
        let half = Vector2::new(noise.uniform(), noise.uniform()) * 40.0;
        segments.push(LineSegment2::new(middle - half, middle + half));
    }
    ViewObservation {
        camera: *camera,
        segments: segments
            .into_iter()
            .enumerate()
            .map(|(edge, segment)| ScoredSegment2 {
                segment,
                score: 0.9,
                edge,
            })
            .collect(),
        junctions: vertices,
    }
}

#[test]
fn windows_come_back_with_their_corners() {
    let truth = facade();
    let mut noise = Noise(7);
    let observations: Vec<_> = cameras()
        .iter()
        .map(|camera| observe(camera, &truth, &mut noise))
        .collect();
    let result = assemble(&observations, &[], 1.2, &AssembleConfig::default());
    let (junctions, segments) = scores_within(0.01, &result.wireframe, &truth);
    assert!(
        junctions.recall >= 0.95 && junctions.precision >= 0.9,
        "junctions: {junctions:?}"
    );
    // Half of the edges lie along the line of the cameras: with each of them, all cameras are
    // in one plane, and no pair of views proposes a place for it. Two thirds of these come
    // back between the corners of others.
    assert!(
        segments.recall >= 0.8 && segments.precision >= 0.9,
        "segments: {segments:?}, {:?}",
        result.report
    );
}
