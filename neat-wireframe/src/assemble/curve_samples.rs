//! Places along the projection of a curve in space.

use super::edge_samples::{Images, Sample, are_enough};
use super::projected_line::ProjectedLine;
use crate::projection::project_in_front;
use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, LineSegment3};

/// Distance between samples in pixels: as for lines.
pub(super) const SPACING: f64 = 3.0;
/// How many a part of a curve has.
const COUNTS: [usize; 2] = [6, 40];
/// A step that projects to less, in pixels, has no direction that an edgel could agree with.
const MIN_STEP: f64 = 0.2;
/// Half the tangent of which edgels are beside, as a share of the curve's size: its ends alone
/// matter to nothing.
const HALF_TANGENT: f64 = 0.01;

impl Images<'_> {
    /// Samples of the part of a curve between two parameters in a view; `None` where it does not
    /// see enough of it.
    pub(super) fn samples_of_curve(
        &self,
        view: usize,
        [low, high]: [f64; 2],
        spacing: f64,
        at: impl Fn(f64) -> Option<Vector3<f64>>,
    ) -> Option<Vec<Sample>> {
        let camera = &self.views[view].camera;
        let project = |place: f64| project_in_front(camera, &at(place)?);
        let [start, bend, end] = [project(low)?, project(0.5 * (low + high))?, project(high)?];
        let length = (bend - start).norm() + (end - bend).norm();
        let count = ((length / spacing) as usize).clamp(COUNTS[0], COUNTS[1]);
        let step = (high - low) / count as f64;
        let samples: Vec<Sample> = (0..count)
            .filter_map(|k| self.sample_of_curve(view, low + step * (k as f64 + 0.5), step, &at))
            .collect();
        are_enough(&samples, count).then_some(samples)
    }

    /// The sample at a place of a curve, by a `step` of the parameter.
    pub(super) fn sample_of_curve(
        &self,
        view: usize,
        place: f64,
        step: f64,
        at: impl Fn(f64) -> Option<Vector3<f64>>,
    ) -> Option<Sample> {
        let camera = &self.views[view].camera;
        let project = |place: f64| project_in_front(camera, &at(place)?);
        let pixel = project(place)?;
        let along = project(place + 0.5 * step)? - project(place - 0.5 * step)?;
        let direction = along.try_normalize(MIN_STEP)?;
        self.is_inside(view, &pixel).then_some(Sample {
            place,
            pixel,
            normal: Vector2::new(-direction.y, direction.x),
        })
    }
}

/// The signed distance in pixels of an edgel from a curve that runs along `tangent` at `point`,
/// and its derivative by the point.
pub(super) fn distance_of_curve(
    camera: &Camera,
    point: &Vector3<f64>,
    tangent: &Vector3<f64>,
    pixel: &Vector2<f64>,
) -> Option<(f64, Vector3<f64>)> {
    let half = HALF_TANGENT * tangent;
    let line = ProjectedLine::new(camera, &LineSegment3::new(point - half, point + half))?;
    let found = line.distance_with_gradient(camera, pixel);
    Some((found.distance, found.by_points[0] + found.by_points[1]))
}
