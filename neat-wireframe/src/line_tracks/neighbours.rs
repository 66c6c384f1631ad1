//! For each view the other views that see the same part of the scene under a
//! useful angle.

use super::view_segments::TrackView;
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Settings of the choice of neighbours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NeighboursConfig {
    /// Neighbours of each view at most.
    pub count: usize,
    /// Rays that meet under a smaller angle say little about depth.
    pub min_angle_in_degrees: f64,
    /// Views from farther apart see other sides of things.
    pub max_angle_in_degrees: f64,
    /// Points per view at which shared sight is tested: segments …
    pub sampled_segments: usize,
    /// … times depths within the scene ball.
    pub sampled_depths: usize,
}

impl Default for NeighboursConfig {
    fn default() -> Self {
        Self {
            count: 10,
            min_angle_in_degrees: 2.0,
            max_angle_in_degrees: 60.0,
            sampled_segments: 64,
            sampled_depths: 6,
        }
    }
}

/// The neighbours of every view, best first.
///
/// Where structure lies is not known yet, so points on the rays of a view's
/// segments within the ball of radius `ball_radius` stand for it; a neighbour is
/// worth the number of these that it sees under a useful angle, small angles
/// less.
pub(super) fn neighbours(
    views: &[TrackView],
    ball_radius: f64,
    config: &NeighboursConfig,
) -> Vec<Vec<usize>> {
    views
        .par_iter()
        .enumerate()
        .map(|(i, view)| {
            let points = sample_points(view, ball_radius, config);
            let mut worths: Vec<(f64, usize)> = views
                .iter()
                .enumerate()
                .filter(|(j, other)| *j != i && !other.segments.is_empty())
                .map(|(j, other)| (worth(view, other, &points, config), j))
                .filter(|(worth, _)| *worth > 0.0)
                .collect();
            worths.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            worths.truncate(config.count);
            worths.into_iter().map(|(_, j)| j).collect()
        })
        .collect()
}

/// Points within the ball on the rays through the middles of some segments.
fn sample_points(
    view: &TrackView,
    ball_radius: f64,
    config: &NeighboursConfig,
) -> Vec<Vector3<f64>> {
    let step = view
        .segments
        .len()
        .div_ceil(config.sampled_segments.max(1))
        .max(1);
    let depths = config.sampled_depths.max(1);
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

fn worth(
    view: &TrackView,
    other: &TrackView,
    points: &[Vector3<f64>],
    config: &NeighboursConfig,
) -> f64 {
    let [min, max] =
        [config.min_angle_in_degrees, config.max_angle_in_degrees].map(f64::to_radians);
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

    fn view_at(degrees: f64) -> TrackView {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let camera = camera_looking_at_origin(&(2.5 * Vector3::new(sin, cos, 0.3)));
        let (junctions, edges) = cube();
        let observation = &views_of_edges(&[camera], &junctions, &edges)[0];
        TrackView::new(observation, 1.0, 1.0)
    }

    #[test]
    fn views_under_a_useful_angle_are_neighbours_and_copies_are_not() {
        let views: Vec<_> = [0.0, 0.0, 20.0, 40.0, 180.0].map(view_at).into();
        let config = NeighboursConfig::default();
        let found = neighbours(&views, 1.0, &config);
        assert_eq!(found[0].len(), 2);
        assert!(found[0].contains(&2) && found[0].contains(&3));
        assert!(found[4].is_empty());
        let one = NeighboursConfig { count: 1, ..config };
        assert!(
            neighbours(&views, 1.0, &one)
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
