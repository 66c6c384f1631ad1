//! Profiles across straight lines.

use super::curve::{Curve, Step};
use super::profile::{MIN_SAMPLES, Sample};
use crate::assemble::line_fitting::directions_across;
use crate::projection::{project_in_front, project_with_jacobian};
use nalgebra::{Matrix2x4, Matrix3x2, Vector2};
use neat_core::{Camera, LineSegment3};

/// A line is looked at in so many parts of the same length: what hides one in a view does not
/// spoil the others.
pub(super) const PARTS: usize = 4;
/// Pixels between samples along a curve.
pub(super) const STEP: f64 = 1.5;
/// So many pixels at the ends are not looked at: other edges begin there.
pub(super) const ENDS: f64 = 3.0;
/// A view counts if it holds at least this share of the line.
const MIN_INSIDE: f64 = 1.0 / 3.0;
/// No image is larger, in pixels.
pub(super) const MAX_LENGTH: f64 = 1e5;

/// A line that shifts by two numbers in its middle, and by two more from end to end. Places along
/// it are -½ at its start and ½ at its end.
pub(super) struct Straight {
    line: LineSegment3,
    /// Two unit vectors perpendicular to the line and each other.
    across: Matrix3x2<f64>,
}

impl Straight {
    /// `None` for a line without a direction.
    pub(super) fn new(line: &LineSegment3) -> Option<Self> {
        Some(Self {
            line: *line,
            across: directions_across(line)?,
        })
    }

    /// The line after a step.
    pub(super) fn moved(&self, step: &Step<4>) -> LineSegment3 {
        let shift = |place| self.across * (self.shift_by_step(place) * step);
        LineSegment3::new(self.line.start + shift(-0.5), self.line.end + shift(0.5))
    }
}

impl Curve<4> for Straight {
    fn shift_by_step(&self, place: f64) -> Matrix2x4<f64> {
        Matrix2x4::new(1.0, 0.0, place, 0.0, 0.0, 1.0, 0.0, place)
    }

    fn step_of_shift(&self, shift: &Vector2<f64>) -> Step<4> {
        Step::from([shift.x, shift.y, 0.0, 0.0])
    }

    fn along(&self, place: f64) -> f64 {
        2.0 * place
    }

    fn middle(&self) -> f64 {
        0.0
    }

    fn ends(&self) -> Vec<f64> {
        vec![-0.5, 0.5]
    }

    fn samples(&self, _view: usize, camera: &Camera) -> Vec<Vec<Sample>> {
        self.samples_in_view(camera)
            .map_or_else(Vec::new, Vec::from)
    }
}

impl Straight {
    fn samples_in_view(&self, camera: &Camera) -> Option<[Vec<Sample>; PARTS]> {
        let Self { line, across } = self;
        let start = project_in_front(camera, &line.start)?;
        let offset = project_in_front(camera, &line.end)? - start;
        let length = offset.norm();
        if !(2.0 * ENDS + STEP * MIN_SAMPLES as f64..MAX_LENGTH).contains(&length) {
            return None;
        }
        let normal = Vector2::new(-offset.y, offset.x) / length;
        let depths = line.ends().map(|end| camera.to_camera(&end).z);
        let count = ((length - 2.0 * ENDS) / STEP) as usize;
        let mut parts: [Vec<Sample>; PARTS] = Default::default();
        let mut inside = 0;
        for k in 0..count {
            let share = (ENDS + (k as f64 + 0.5) / count as f64 * (length - 2.0 * ENDS)) / length;
            let pixel = start + offset * share;
            if !is_inside(camera, &pixel) {
                continue;
            }
            // Even steps in the image are uneven ones in space.
            let (end, start) = (share / depths[1], (1.0 - share) / depths[0]);
            let place = end / (end + start);
            let Some((pixel, by_point)) = project_with_jacobian(camera, &line.point_at(place))
            else {
                continue;
            };
            inside += 1;
            parts[((place * PARTS as f64) as usize).min(PARTS - 1)].push(Sample {
                place: place - 0.5,
                pixel,
                normal,
                by_shift: (by_point * across).tr_mul(&normal),
            });
        }
        parts.iter_mut().for_each(|part| {
            if part.len() < MIN_SAMPLES {
                part.clear();
            }
        });
        (f64::from(inside) >= MIN_INSIDE * count as f64).then_some(parts)
    }
}

/// Whether a pixel lies in the image.
pub(super) fn is_inside(camera: &Camera, pixel: &Vector2<f64>) -> bool {
    let within = |x: f64, size: u32| x >= 0.0 && x <= f64::from(size);
    within(pixel.x, camera.width) && within(pixel.y, camera.height)
}
