//! Prisms: objects with an exact wireframe and an exact signed distance.

use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, LineSegment2, LineSegment3};
use neat_wireframe::{SignedDistance, Wireframe3d};

/// A polygon, swept along z from `-half_height` to `half_height`.
pub struct Prism {
    profile: Vec<Vector2<f64>>,
    half_height: f64,
}

impl Prism {
    pub fn cube() -> Self {
        Self::new(&[(-0.4, -0.4), (0.4, -0.4), (0.4, 0.4), (-0.4, 0.4)], 0.4)
    }

    pub fn l_shape() -> Self {
        let profile = [
            (-0.5, -0.5),
            (0.5, -0.5),
            (0.5, -0.1),
            (-0.05, -0.1),
            (-0.05, 0.5),
            (-0.5, 0.5),
        ];
        Self::new(&profile, 0.35)
    }

    pub fn new(profile: &[(f64, f64)], half_height: f64) -> Self {
        Self {
            profile: profile.iter().map(|(x, y)| Vector2::new(*x, *y)).collect(),
            half_height,
        }
    }

    /// Bottom junctions first, then top; per corner its bottom, top and upright
    /// edge.
    pub fn wireframe(&self) -> Wireframe3d {
        let n = self.profile.len();
        let level = |z: f64| self.profile.iter().map(move |p| Vector3::new(p.x, p.y, z));
        let edges = (0..n).flat_map(|i| {
            let next = (i + 1) % n;
            [[i, next], [n + i, n + next], [i, n + i]]
        });
        Wireframe3d {
            junctions: level(-self.half_height)
                .chain(level(self.half_height))
                .collect(),
            edges: edges.collect(),
        }
    }

    pub fn distance(&self, point: &Vector3<f64>) -> f64 {
        let in_profile = self.distance_in_plane(&point.xy());
        let beyond_height = point.z.abs() - self.half_height;
        let outside = Vector2::new(in_profile.max(0.0), beyond_height.max(0.0)).norm();
        outside + in_profile.max(beyond_height).min(0.0)
    }

    fn distance_in_plane(&self, point: &Vector2<f64>) -> f64 {
        let n = self.profile.len();
        let mut distance = f64::INFINITY;
        let mut inside = false;
        for i in 0..n {
            let (a, b) = (self.profile[i], self.profile[(i + 1) % n]);
            distance = distance.min(LineSegment2::new(a, b).distance_to_point(point));
            let crosses = (a.y > point.y) != (b.y > point.y);
            if crosses && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x) {
                inside = !inside;
            }
        }
        if inside { -distance } else { distance }
    }

    pub fn sees(&self, camera: &Camera, edge: &LineSegment3) -> bool {
        (1..20).all(|i| {
            let point = edge.point_at(f64::from(i) / 20.0);
            (1..150).all(|step| {
                let t = f64::from(step) / 150.0;
                self.distance(&(point + (camera.center_in_world - point) * t)) > -1e-6
            })
        })
    }
}

/// The prism scaled about the origin.
pub struct Scaled<'a>(pub &'a Prism, pub f64);

impl SignedDistance for Scaled<'_> {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        let distance = |p: &Vector3<f64>| self.0.distance(&(p / self.1)) * self.1;
        points.iter().map(distance).collect()
    }

    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        with_numeric_gradient(self, points)
    }
}

/// The distances of a surface with central differences.
pub fn with_numeric_gradient(
    surface: &dyn SignedDistance,
    points: &[Vector3<f64>],
) -> Vec<(f64, Vector3<f64>)> {
    let step = 1e-6;
    let gradient = |p: &Vector3<f64>| {
        Vector3::from_fn(|axis, _| {
            let offset = Vector3::ith(axis, step);
            let ends = surface.sdf(&[p + offset, p - offset]);
            (ends[0] - ends[1]) / (2.0 * step)
        })
    };
    surface
        .sdf(points)
        .into_iter()
        .zip(points.iter().map(gradient))
        .collect()
}
