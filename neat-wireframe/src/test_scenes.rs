//! Hand-made cameras, views and noise for the unit tests of this crate.

use crate::projection::project_in_front;
use crate::{SignedDistance, ViewObservation};
use nalgebra::{Matrix3, Vector3};
use neat_core::{Camera, Intrinsics, LineSegment2, ScoredSegment2};

/// A 512 × 512 camera with focal length 700 that looks at the origin.
pub(crate) fn camera_looking_at_origin(center_in_world: &Vector3<f64>) -> Camera {
    let forward = -center_in_world.normalize();
    let side = if forward.z.abs() < 0.9 {
        Vector3::z()
    } else {
        Vector3::x()
    };
    let right = forward.cross(&side).normalize();
    let down = forward.cross(&right);
    Camera {
        intrinsics: Intrinsics {
            fx: 700.0,
            fy: 700.0,
            cx: 256.0,
            cy: 256.0,
            skew: 0.0,
        },
        world_from_camera: Matrix3::from_columns(&[right, down, forward]),
        center_in_world: *center_in_world,
        width: 512,
        height: 512,
    }
}

/// `count` cameras spread evenly over the sphere of radius 2.5 (Fibonacci
/// lattice).
pub(crate) fn cameras_on_sphere(count: usize) -> Vec<Camera> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let (sin, cos) = (golden_angle * i as f64).sin_cos();
            let radius = (1.0 - z * z).sqrt();
            camera_looking_at_origin(&(2.5 * Vector3::new(radius * cos, radius * sin, z)))
        })
        .collect()
}

/// Views that see every edge of a graph, without noise and occlusion.
pub(crate) fn views_of_edges(
    cameras: &[Camera],
    junctions: &[Vector3<f64>],
    edges: &[[usize; 2]],
) -> Vec<ViewObservation> {
    cameras
        .iter()
        .map(|camera| ViewObservation {
            camera: *camera,
            segments: edges
                .iter()
                .enumerate()
                .filter_map(|(edge, [a, b])| {
                    Some(ScoredSegment2 {
                        segment: LineSegment2::new(
                            project_in_front(camera, &junctions[*a])?,
                            project_in_front(camera, &junctions[*b])?,
                        ),
                        score: 1.0,
                        edge,
                    })
                })
                .collect(),
            junctions: Vec::new(),
        })
        .collect()
}

/// Reproducible uniform numbers (SplitMix64).
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    /// Uniform in [-1, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Three independent uniform numbers in [-1, 1).
    pub(crate) fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.uniform())
    }
}

/// The surface of a cube around the origin with this half side.
pub(crate) struct CubeSurface(pub(crate) f64);

impl SignedDistance for CubeSurface {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        points.iter().map(|p| p.amax() - self.0).collect()
    }

    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        let gradient = |p: &Vector3<f64>| Vector3::ith(p.iamax(), p[p.iamax()].signum());
        (points.iter().zip(self.sdf(points)))
            .map(|(p, sdf)| (sdf, gradient(p)))
            .collect()
    }
}

/// The eight corners of a cube of half side 0.5 and its twelve edges, as the
/// corners' indices in binary order.
pub(crate) fn cube() -> (Vec<Vector3<f64>>, Vec<[usize; 2]>) {
    let corner = |i: usize, bit: usize| if i >> bit & 1 == 1 { 0.5 } else { -0.5 };
    let junctions = (0..8)
        .map(|i| Vector3::new(corner(i, 0), corner(i, 1), corner(i, 2)))
        .collect();
    let mut edges: Vec<[usize; 2]> = (0..8)
        .flat_map(|a| (0..3).map(move |bit| [a, a | 1 << bit]))
        .filter(|[a, b]| a < b)
        .collect();
    edges.sort_unstable();
    (junctions, edges)
}
