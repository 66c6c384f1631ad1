//! The views from which the surface leaves an edge visible.

use crate::projection::project_in_front;
use crate::{SignedDistance, ViewObservation};
use nalgebra::Vector3;
use neat_core::{Camera, LineSegment3};

/// Points of an edge whose sight lines are followed, evenly between these shares of it.
const POINTS: usize = 7;
const FIRST_POINT: f64 = 0.1;
const LAST_POINT: f64 = 0.9;
/// Samples of each sight line, followed in so many rounds of interleaved samples: what the
/// first decide is asked no further.
const SAMPLES: usize = 40;
const ROUNDS: usize = 8;
/// Where on the sight line they begin and end, in radii of the scene.
const START: f64 = 0.05;
const END: f64 = 1.2;
/// They begin at most this share of the edge's length away: small parts of a large scene are
/// thinner than [`START`].
const MAX_RELATIVE_START: f64 = 0.25;
/// So deep below the surface a sample hides the point, in radii of the scene …
const DEPTH: f64 = 0.015;
/// … and at most this share of the edge's length.
const MAX_RELATIVE_DEPTH: f64 = 0.05;
/// Share of its points that must be visible for an edge to count as visible. Nearly all: only
/// a view that shows both ends can support an edge.
const MIN_VISIBLE_SHARE: f64 = 0.85;

/// A surface that hides edges, in the ball of radius `scene_radius` around the origin;
/// outside it means nothing.
pub(super) struct Occluder<'a> {
    pub surface: &'a dyn SignedDistance,
    pub scene_radius: f64,
}

/// The line from a point of an edge to a camera.
struct SightLine {
    view: usize,
    point: Vector3<f64>,
    direction: Vector3<f64>,
    camera_distance: f64,
    /// Where its samples of this round end.
    end: usize,
}

impl Occluder<'_> {
    /// Whether each view sees the edge: most of its points project into the image and have a
    /// free sight line to the camera.
    pub(super) fn views_that_see(
        &self,
        views: &[ViewObservation],
        edge: &LineSegment3,
    ) -> Vec<bool> {
        let start = (START * self.scene_radius).min(MAX_RELATIVE_START * edge.length());
        let min_sdf = -(DEPTH * self.scene_radius).min(MAX_RELATIVE_DEPTH * edge.length());
        let mut lines = sight_lines(views, edge);
        // Points of the edge seen so far, by view.
        let mut seen = vec![0; views.len()];
        lines.iter().for_each(|line| seen[line.view] += 1);
        let enough = MIN_VISIBLE_SHARE * POINTS as f64;
        let mut samples = Vec::new();
        for round in 0..ROUNDS {
            lines.retain(|line| f64::from(seen[line.view]) >= enough);
            samples.clear();
            for line in &mut lines {
                let distances = linspace(start, END * self.scene_radius, SAMPLES);
                samples.extend(
                    (distances.skip(round).step_by(ROUNDS))
                        .filter(|distance| *distance < line.camera_distance)
                        .map(|distance| line.point + line.direction * distance)
                        .filter(|sample| sample.norm() < self.scene_radius),
                );
                line.end = samples.len();
            }
            let sdf = self.surface.sdf(&samples);
            let mut begin = 0;
            lines.retain(|line| {
                // A surface that answers too few points hides the rest.
                let of_line = sdf.get(begin..line.end);
                let free = of_line.is_some_and(|sdf| sdf.iter().all(|d| *d > min_sdf));
                begin = line.end;
                seen[line.view] -= u8::from(!free);
                free
            });
        }
        (seen.into_iter())
            .map(|seen| f64::from(seen) >= enough)
            .collect()
    }
}

/// From the points of the edge that project into an image to its camera.
fn sight_lines(views: &[ViewObservation], edge: &LineSegment3) -> Vec<SightLine> {
    let of_view = |(view, observation): (usize, &ViewObservation)| {
        let camera = observation.camera;
        linspace(FIRST_POINT, LAST_POINT, POINTS)
            .map(|share| edge.point_at(share))
            .filter(move |point| is_in_image(&camera, point))
            .map(move |point| {
                let to_camera = camera.center_in_world - point;
                let camera_distance = to_camera.norm();
                SightLine {
                    view,
                    point,
                    direction: to_camera / camera_distance,
                    camera_distance,
                    end: 0,
                }
            })
    };
    views.iter().enumerate().flat_map(of_view).collect()
}

fn is_in_image(camera: &Camera, point: &Vector3<f64>) -> bool {
    project_in_front(camera, point).is_some_and(|pixel| {
        (0.0..f64::from(camera.width)).contains(&pixel.x)
            && (0.0..f64::from(camera.height)).contains(&pixel.y)
    })
}

/// `count` evenly spaced numbers from `first` to `last`, two at least.
fn linspace(first: f64, last: f64, count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |i| first + (last - first) * i as f64 / (count - 1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{CubeSurface, Noise, camera_looking_at_origin, cube};

    const CUBE: Occluder = Occluder {
        surface: &CubeSurface(0.5),
        scene_radius: 1.0,
    };

    fn view_from(center: Vector3<f64>) -> ViewObservation {
        ViewObservation {
            camera: camera_looking_at_origin(&center),
            segments: Vec::new(),
            junctions: Vec::new(),
        }
    }

    #[test]
    fn the_object_hides_its_far_edges_and_the_chords_through_it() {
        let (junctions, _) = cube();
        let centers = [[1.5, 1.6, 1.7], [1.5, -1.6, 1.7], [-1.5, -1.6, -1.7]];
        let views = centers.map(|center| view_from(Vector3::from(center)));
        let sees = |a: usize, b: usize| {
            CUBE.views_that_see(&views, &LineSegment3::new(junctions[a], junctions[b]))
        };
        // The edge x = y = +0.5 along z, its opposite, and the space diagonal.
        assert_eq!(sees(3, 7), [true, true, false]);
        assert_eq!(sees(0, 4), [false, true, true]);
        assert_eq!(sees(0, 7), [false; 3]);
    }

    #[test]
    fn an_edge_outside_the_image_is_not_visible() {
        let (junctions, _) = cube();
        let edge = LineSegment3::new(junctions[3], junctions[7]);
        let mut view = view_from(Vector3::new(1.5, 1.6, 1.7));
        assert_eq!(CUBE.views_that_see(&[view.clone()], &edge), [true]);
        view.camera.intrinsics.cx = -400.0;
        assert_eq!(CUBE.views_that_see(&[view], &edge), [false]);
    }

    /// The definition: every sample of every sight line is asked for.
    fn sees_by_scan(view: &ViewObservation, edge: &LineSegment3) -> bool {
        let start = START.min(MAX_RELATIVE_START * edge.length());
        let min_sdf = -DEPTH.min(MAX_RELATIVE_DEPTH * edge.length());
        let is_visible = |point: &Vector3<f64>| {
            let to_camera = view.camera.center_in_world - point;
            is_in_image(&view.camera, point)
                && linspace(start, END, SAMPLES)
                    .filter(|distance| *distance < to_camera.norm())
                    .map(|distance| point + to_camera.normalize() * distance)
                    .filter(|sample| sample.norm() < 1.0)
                    .all(|sample| CubeSurface(0.5).sdf(&[sample])[0] > min_sdf)
        };
        let points = linspace(FIRST_POINT, LAST_POINT, POINTS).map(|t| edge.point_at(t));
        points.filter(is_visible).count() as f64 >= MIN_VISIBLE_SHARE * POINTS as f64
    }

    #[test]
    fn rounds_change_nothing() {
        let mut noise = Noise(19);
        let mut views: Vec<_> = (0..7)
            .map(|_| view_from(2.0 * noise.vector().normalize()))
            .collect();
        views[0].camera.intrinsics.cx = 60.0;
        let mut seen = 0;
        for _ in 0..200 {
            let edge = LineSegment3::new(0.8 * noise.vector(), 0.8 * noise.vector());
            let sees = CUBE.views_that_see(&views, &edge);
            let scanned: Vec<_> = views.iter().map(|view| sees_by_scan(view, &edge)).collect();
            assert_eq!(sees, scanned);
            seen += sees.iter().filter(|sees| **sees).count();
        }
        assert!((50..1000).contains(&seen), "{seen}");
    }

    #[test]
    fn lengths_are_relative_and_points_outside_the_ball_hide_nothing() {
        /// Solid everywhere.
        struct Solid;
        impl SignedDistance for Solid {
            fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
                vec![-1.0; points.len()]
            }
            fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
                vec![(-1.0, Vector3::zeros()); points.len()]
            }
        }
        let views = [view_from(Vector3::repeat(2.0))];
        let edge = LineSegment3::new(Vector3::new(0.6, 0.5, 0.5), Vector3::new(0.5, 0.6, 0.5));
        let sees = |scene_radius: f64| {
            let surface = &Solid;
            Occluder {
                surface,
                scene_radius,
            }
            .views_that_see(&views, &edge)
        };
        assert_eq!(sees(0.9), [true]);
        assert_eq!(sees(1.0), [false]);
    }
}
