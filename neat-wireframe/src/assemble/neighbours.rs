//! For each view the other views that see the same part of the scene under a
//! useful angle.

use super::view_segments::PreparedView;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Rays that meet under a smaller angle say little about depth.
const MIN_ANGLE_IN_DEGREES: f64 = 2.0;
/// Views from farther apart see other sides of things.
const MAX_ANGLE_IN_DEGREES: f64 = 60.0;
/// Points per view at which shared sight is tested: segments …
const SAMPLED_SEGMENTS: usize = 64;
/// … times depths within the scene ball.
const SAMPLED_DEPTHS: usize = 6;

/// The neighbours of every view, at most `count`, best first.
///
/// Where structure lies is not known yet, so points on the rays of a view's
/// segments within the ball of radius `ball_radius` stand for it; a neighbour is
/// worth the number of these that it sees under a useful angle, small angles
/// less.
pub(super) fn neighbours(
    views: &[PreparedView],
    ball_radius: f64,
    count: usize,
) -> Vec<Vec<usize>> {
    views
        .par_iter()
        .enumerate()
        .map(|(i, view)| {
            let points = sample_points(view, ball_radius);
            let mut worths: Vec<(f64, usize)> = views
                .iter()
                .enumerate()
                .filter(|(j, other)| *j != i && !other.segments.is_empty())
                .map(|(j, other)| (worth(view, other, &points), j))
                .filter(|(worth, _)| *worth > 0.0)
                .collect();
            worths.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            worths.truncate(count);
            worths.into_iter().map(|(_, j)| j).collect()
        })
        .collect()
}

/// Points within the ball on the rays through the middles of some segments.
fn sample_points(view: &PreparedView, ball_radius: f64) -> Vec<Vector3<f64>> {
    let step = view.segments.len().div_ceil(SAMPLED_SEGMENTS.max(1)).max(1);
    let depths = SAMPLED_DEPTHS.max(1);
    let mut points = Vec::new();
    for segment in view.segments.iter().step_by(step) {
        let ray = (segment.rays[0] + segment.rays[1]).normalize();
        let Some([near, far]) = ball_interval(&view.camera.center_in_world, &ray, ball_radius)
        else {
            continue;
        };
        points.extend((0..depths).map(|k| {
            let share = (k as f64 + 0.5) / depths as f64;
            view.camera.center_in_world + ray * (near + (far - near) * share)
        }));
    }
    points
}

fn worth(view: &PreparedView, other: &PreparedView, points: &[Vector3<f64>]) -> f64 {
    let [min, max] = [MIN_ANGLE_IN_DEGREES, MAX_ANGLE_IN_DEGREES].map(f64::to_radians);
    points
        .iter()
        .filter(|point| other.camera.sees(point))
        .map(|point| {
            let here = point - view.camera.center_in_world;
            let there = point - other.camera.center_in_world;
            let angle = here.angle(&there);
            if (min..=max).contains(&angle) {
                // Beyond four times the least angle depth is well determined.
                (angle / (4.0 * min)).min(1.0)
            } else {
                0.0
            }
        })
        .sum()
}

/// Distances at which a ray enters and leaves the ball around the origin, from
/// the ray's origin on; `None` where it misses the ball.
pub(super) fn ball_interval(
    origin: &Vector3<f64>,
    ray: &Vector3<f64>,
    ball_radius: f64,
) -> Option<[f64; 2]> {
    let middle = -origin.dot(ray);
    let squared_half = ball_radius * ball_radius - (origin + middle * ray).norm_squared();
    let half = (squared_half > 0.0).then(|| squared_half.sqrt())?;
    let far = middle + half;
    (far > 0.0).then(|| [(middle - half).max(0.0), far])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{camera_looking_at_origin, cube, views_of_edges};

    fn view_at(degrees: f64) -> PreparedView {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let camera = camera_looking_at_origin(&(2.5 * Vector3::new(sin, cos, 0.3)));
        let (junctions, edges) = cube();
        let observation = &views_of_edges(&[camera], &junctions, &edges)[0];
        PreparedView::new(observation, 1.0, 1.0)
    }

    #[test]
    fn views_under_a_useful_angle_are_neighbours_and_copies_are_not() {
        let views: Vec<_> = [0.0, 0.0, 20.0, 40.0, 180.0].map(view_at).into();
        let found = neighbours(&views, 1.0, 10);
        assert_eq!(found[0].len(), 2);
        assert!(found[0].contains(&2) && found[0].contains(&3));
        assert!(found[4].is_empty());
        assert!(
            neighbours(&views, 1.0, 1)
                .iter()
                .all(|list| list.len() <= 1)
        );
    }

    #[test]
    fn rays_cross_the_ball_where_they_should() {
        let origin = Vector3::new(-3.0, 0.0, 0.0);
        assert_eq!(ball_interval(&origin, &Vector3::x(), 1.0), Some([2.0, 4.0]));
        assert_eq!(ball_interval(&origin, &-Vector3::x(), 1.0), None);
        assert_eq!(ball_interval(&origin, &Vector3::y(), 1.0), None);
        assert_eq!(
            ball_interval(&Vector3::zeros(), &Vector3::y(), 1.0),
            Some([0.0, 1.0])
        );
    }
}
