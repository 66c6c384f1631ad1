//! For each view the other views that see the same part of the scene under a
//! useful angle.

use super::view_segments::PreparedView;
use neat_core::{Ray, points_in_ball};
use rayon::prelude::*;

/// Rays that meet under a smaller angle say little about depth, and views from farther apart
/// see other sides of things.
const ANGLES_IN_DEGREES: [f64; 2] = [2.0, 60.0];
/// Segments per view at whose middles shared sight is tested.
const SAMPLED_SEGMENTS: usize = 64;

/// The neighbours of every view, at most `count`, best first.
///
/// Where structure lies is not known yet, so points on the rays of a view's
/// segments within the ball of radius `ball_radius` stand for it.
pub(super) fn neighbours(
    views: &[PreparedView],
    ball_radius: f64,
    count: usize,
) -> Vec<Vec<usize>> {
    let of_view = |(index, view): (usize, &PreparedView)| {
        let others = (views.iter().enumerate())
            .filter(|(other, prepared)| *other != index && !prepared.segments.is_empty())
            .map(|(other, prepared)| (other, &prepared.camera));
        let points = points_in_ball(sampled_rays(view), ball_radius);
        neat_core::neighbours(&view.camera, others, &points, ANGLES_IN_DEGREES, count)
    };
    views.par_iter().enumerate().map(of_view).collect()
}

/// The rays through the middles of some segments.
fn sampled_rays(view: &PreparedView) -> impl Iterator<Item = Ray> {
    let step = view.segments.len().div_ceil(SAMPLED_SEGMENTS).max(1);
    view.segments.iter().step_by(step).map(|segment| Ray {
        origin: view.camera.center_in_world,
        direction: (segment.rays[0] + segment.rays[1]).normalize(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{camera_looking_at_origin, cube, views_of_edges};
    use nalgebra::Vector3;

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
}
