//! For each view the other views that show the same under a useful angle.

use crate::view::StereoView;
use nalgebra::Vector2;
use neat_core::{Camera, Ray, points_in_ball};

/// Rays that meet under a smaller angle say little about depth; beyond the larger one, patches
/// of a surface no longer look alike.
const ANGLES_IN_DEGREES: [f64; 2] = [3.0, 45.0];
/// Sight is tested on a grid of so many pixels along each side of the image.
const SAMPLED_PIXELS: usize = 8;

/// The neighbours of `views[view]`, at most `count`, best first.
///
/// Points within the ball of radius `ball_radius` around the origin stand for what there
/// is to see.
pub(crate) fn neighbours(
    views: &[StereoView],
    view: usize,
    ball_radius: f64,
    count: usize,
) -> Vec<usize> {
    let camera = &views[view].camera;
    let others = (views.iter().enumerate())
        .filter(|(index, other)| *index != view && other.levels().is_some())
        .map(|(index, other)| (index, &other.camera));
    let points = points_in_ball(sampled_rays(camera), ball_radius);
    neat_core::neighbours(camera, others, &points, ANGLES_IN_DEGREES, count)
}

/// The rays through a grid of pixels.
fn sampled_rays(camera: &Camera) -> impl Iterator<Item = Ray> {
    let place = |k: usize| (k as f64 + 0.5) / SAMPLED_PIXELS as f64;
    (0..SAMPLED_PIXELS * SAMPLED_PIXELS).map(move |k| {
        camera.ray_through(&Vector2::new(
            f64::from(camera.width) * place(k % SAMPLED_PIXELS),
            f64::from(camera.height) * place(k / SAMPLED_PIXELS),
        ))
    })
}
