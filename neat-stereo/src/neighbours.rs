//! For each view the other views that show the same under a useful angle.

use crate::view::StereoView;
use nalgebra::{Vector2, Vector3};
use neat_core::Camera;

/// Rays that meet under a smaller angle say little about depth.
const MIN_ANGLE_IN_DEGREES: f64 = 3.0;
/// Beyond, patches of a surface no longer look alike.
const MAX_ANGLE_IN_DEGREES: f64 = 45.0;
/// Sight is tested on a grid of so many pixels along each side of the image …
const SAMPLED_PIXELS: usize = 8;
/// … times depths within the scene ball.
const SAMPLED_DEPTHS: usize = 6;

/// The neighbours of `views[view]`, at most `count`, best first.
///
/// Points within the ball of radius `ball_radius` around the origin stand for what there
/// is to see. A neighbour is worth the number of those that it sees under a useful angle,
/// small angles less.
pub(crate) fn neighbours(
    views: &[StereoView],
    view: usize,
    ball_radius: f64,
    count: usize,
) -> Vec<usize> {
    let here = &views[view].camera;
    let points = sample_points(here, ball_radius);
    let mut worths: Vec<(f64, usize)> = (views.iter().enumerate())
        .filter(|(index, other)| *index != view && other.levels().is_some())
        .map(|(index, other)| (worth(here, &other.camera, &points), index))
        .filter(|(worth, _)| *worth > 0.0)
        .collect();
    worths.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    worths.truncate(count);
    worths.into_iter().map(|(_, other)| other).collect()
}

fn sample_points(camera: &Camera, ball_radius: f64) -> Vec<Vector3<f64>> {
    let place = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
    let mut points = Vec::new();
    for k in 0..SAMPLED_PIXELS * SAMPLED_PIXELS {
        let pixel = Vector2::new(
            f64::from(camera.width) * place(k % SAMPLED_PIXELS, SAMPLED_PIXELS),
            f64::from(camera.height) * place(k / SAMPLED_PIXELS, SAMPLED_PIXELS),
        );
        let ray = camera.ray_through(&pixel);
        if let Some([near, far]) = ball_interval(&ray.origin, &ray.direction, ball_radius) {
            points.extend((0..SAMPLED_DEPTHS).map(|depth| {
                ray.origin + ray.direction * (near + (far - near) * place(depth, SAMPLED_DEPTHS))
            }));
        }
    }
    points
}

fn worth(here: &Camera, other: &Camera, points: &[Vector3<f64>]) -> f64 {
    let [min, max] = [MIN_ANGLE_IN_DEGREES, MAX_ANGLE_IN_DEGREES].map(f64::to_radians);
    let of_point = |point: &Vector3<f64>| {
        let angle = (point - here.center_in_world).angle(&(point - other.center_in_world));
        match (min..=max).contains(&angle) && other.sees(point) {
            // Beyond four times the least angle depth is well determined.
            true => (angle / (4.0 * min)).min(1.0),
            false => 0.0,
        }
    };
    points.iter().map(of_point).sum()
}

/// Distances at which a ray enters and leaves the ball around the origin, from the ray's
/// origin on; `None` where it misses the ball.
pub(crate) fn ball_interval(
    origin: &Vector3<f64>,
    direction: &Vector3<f64>,
    ball_radius: f64,
) -> Option<[f64; 2]> {
    let middle = -origin.dot(direction);
    let squared_half = ball_radius * ball_radius - (origin + middle * direction).norm_squared();
    let half = (squared_half > 0.0).then(|| squared_half.sqrt())?;
    let far = middle + half;
    (far > 0.0).then(|| [(middle - half).max(0.0), far])
}
