//! Which views show the same under a useful angle.

use crate::{Camera, Ray};
use nalgebra::Vector3;

/// Points per ray.
const SAMPLED_DEPTHS: usize = 6;

/// Points on `rays` within the ball of radius `ball_radius` around the origin, at depths all
/// through it: they stand for what there is to see, as long as nobody knows.
pub fn points_in_ball(rays: impl IntoIterator<Item = Ray>, ball_radius: f64) -> Vec<Vector3<f64>> {
    let mut points = Vec::new();
    for ray in rays {
        if let Some([near, far]) = ray.interval_in_ball(ball_radius) {
            points.extend((0..SAMPLED_DEPTHS).map(|depth| {
                let share = (depth as f64 + 0.5) / SAMPLED_DEPTHS as f64;
                ray.origin + ray.direction * (near + (far - near) * share)
            }));
        }
    }
    points
}

/// Of `others`, cameras with the numbers of their views, those that see what `camera` does, at
/// most `count`, best first.
///
/// A view is worth the number of `points` that it sees under an angle within
/// `angles_in_degrees`; below four times the least one, from which on depth is well
/// determined, less.
pub fn neighbours<'a>(
    camera: &Camera,
    others: impl IntoIterator<Item = (usize, &'a Camera)>,
    points: &[Vector3<f64>],
    angles_in_degrees: [f64; 2],
    count: usize,
) -> Vec<usize> {
    let [min, max] = angles_in_degrees.map(f64::to_radians);
    let worth = |other: &Camera| -> f64 {
        let of_point = |point: &Vector3<f64>| {
            let here = point - camera.center_in_world;
            let there = point - other.center_in_world;
            let angle = here.angle(&there);
            if (min..=max).contains(&angle) && other.sees(point) {
                (angle / (4.0 * min)).min(1.0)
            } else {
                0.0
            }
        };
        points.iter().map(of_point).sum()
    };
    let mut worths: Vec<(f64, usize)> = (others.into_iter())
        .map(|(view, other)| (worth(other), view))
        .filter(|(worth, _)| *worth > 0.0)
        .collect();
    worths.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    worths.truncate(count);
    worths.into_iter().map(|(_, view)| view).collect()
}
