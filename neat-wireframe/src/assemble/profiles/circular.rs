//! Profiles across arcs of circles.

use super::curve::{Curve, Step};
use super::profile::{MIN_SAMPLES, REACH, Sample};
use super::straight::{ENDS, MAX_LENGTH, PARTS, STEP, is_inside};
use crate::assemble::circle_fitting::FoundArc;
use crate::projection::{project_in_front, project_with_jacobian};
use nalgebra::{
    Matrix2x6, Matrix3x2, Matrix3x6, Matrix4, Matrix4x6, Matrix6, UnitQuaternion, Vector2, Vector3,
};
use neat_core::{Camera, CircularArc};
use std::f64::consts::TAU;

/// A circle is looked at in so many parts: along one of them, directions across it change by a
/// hundredth from the mean.
const PARTS_OF_CIRCLE: f64 = 16.0;

/// So far, in pixels, an arc may come to lie from where its Jacobian has it.
const MAX_OFF: f64 = 0.1;

/// An arc that shifts outward and along its axis, by a similarity about its centroid: three numbers
/// move that, one lets the radius grow, and two turn the arc around both axes (times the radius).
/// About the circle's centre, far from a short arc, they would be much the same. Places are angles.
pub(super) struct Circular {
    arc: CircularArc,
    centroid: Vector3<f64>,
    pixel: f64,
    sectors: Vec<Shown>,
}

/// The part of an arc up to some angle, and the views that show it.
struct Shown {
    until: f64,
    views: Vec<usize>,
}

impl Circular {
    pub(super) fn new(found: &FoundArc) -> Self {
        let arc = &found.arc;
        let half = 0.5 * arc.sweep();
        let middle = arc.toward(0.5 * (arc.angles[0] + arc.angles[1]));
        Self {
            arc: *arc,
            centroid: arc.center + middle * (arc.radius * half.sin() / half),
            pixel: found.pixel,
            sectors: (found.sectors.iter())
                .map(|sector| Shown {
                    until: sector.angles[1],
                    views: sector.evidence.views().collect(),
                })
                .collect(),
        }
    }

    /// The arc after a step, which ends where it has ended; `None` if the Jacobian does not hold so
    /// far: a bend within a pixel may turn to any side.
    pub(super) fn moved(&self, step: &Step<6>) -> Option<CircularArc> {
        let similar = self.similar(step);
        let off = |angle: f64| {
            let point = self.arc.point_at(angle);
            let expected = point + self.by_step(&point) * step;
            (similar.point_at(angle) - expected).norm()
        };
        let is_off = |end: &f64| off(*end) > MAX_OFF * self.pixel;
        if self.ends().iter().any(is_off) {
            return None;
        }
        if similar.is_closed() {
            return Some(similar);
        }
        let angles = self.arc.angles.map(|angle| {
            let beside = similar.angle_of(&self.arc.point_at(angle)) - angle;
            angle + (beside + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU
        });
        // Ends of nearly a whole circle may pass each other.
        let moved = CircularArc { angles, ..similar };
        let moved = if moved.is_valid() { moved } else { similar };
        moved.is_valid().then_some(moved)
    }

    /// The arc under the similarity of a step.
    fn similar(&self, step: &Step<6>) -> CircularArc {
        let Self { arc, centroid, .. } = self;
        let turn = (step[4] * arc.axes[0] + step[5] * arc.axes[1]) / arc.radius;
        let turn = UnitQuaternion::from_scaled_axis(turn);
        let growth = 1.0 + step[3] / arc.radius;
        let shift = centroid + Vector3::new(step[0], step[1], step[2]);
        arc.map(|point| shift + growth * (turn * (point - centroid)))
    }

    /// The covariance of centre and radius by that of a step.
    pub(super) fn covariance(&self, of_step: &Matrix6<f64>) -> Matrix4<f64> {
        let mut by_step = Matrix4x6::zeros();
        by_step
            .fixed_rows_mut::<3>(0)
            .copy_from(&self.by_step(&self.arc.center));
        by_step[(3, 3)] = 1.0;
        by_step * of_step * by_step.transpose()
    }

    /// How a point of the circle's plane moves by the parameters.
    fn by_step(&self, point: &Vector3<f64>) -> Matrix3x6<f64> {
        let arm = (point - self.centroid) / self.arc.radius;
        let [x, y] = self.arc.axes.map(|axis| axis.cross(&arm));
        Matrix3x6::from_columns(&[Vector3::x(), Vector3::y(), Vector3::z(), arm, x, y])
    }

    fn parts(&self) -> usize {
        let parts = (self.arc.sweep() * PARTS_OF_CIRCLE / TAU).ceil() as usize;
        parts.max(PARTS)
    }

    /// Whether a view shows the arc at an angle.
    fn is_shown(&self, view: usize, angle: f64) -> bool {
        let sector = self.sectors.partition_point(|sector| sector.until < angle);
        let sector = self.sectors.get(sector).or(self.sectors.last());
        sector.is_some_and(|sector| sector.views.contains(&view))
    }

    /// The samples of the part between two angles.
    fn samples_of_part(
        &self,
        view: usize,
        camera: &Camera,
        [low, high]: [f64; 2],
    ) -> Option<Vec<Sample>> {
        let project = |angle: f64| project_in_front(camera, &self.arc.point_at(angle));
        let [start, bend, end] = [project(low)?, project(0.5 * (low + high))?, project(high)?];
        let length = (bend - start).norm() + (end - bend).norm();
        if length >= MAX_LENGTH {
            return None;
        }
        let count = (length / STEP) as usize;
        let step = (high - low) / count as f64;
        let samples: Vec<Sample> = (0..count)
            .map(|k| low + step * (k as f64 + 0.5))
            .filter(|angle| self.is_shown(view, *angle))
            .filter_map(|angle| self.sample(camera, angle, step))
            .collect();
        (samples.len() >= MIN_SAMPLES).then_some(samples)
    }

    /// The sample at an angle, where the curve bends so little that its profile reaches to no other
    /// part of it.
    fn sample(&self, camera: &Camera, angle: f64, step: f64) -> Option<Sample> {
        let arc = &self.arc;
        let project = |angle: f64| project_in_front(camera, &arc.point_at(angle));
        let (pixel, by_point) = project_with_jacobian(camera, &arc.point_at(angle))?;
        let is_end = |end: &f64| project(*end).is_some_and(|end| (end - pixel).norm() < ENDS);
        if !is_inside(camera, &pixel) || (!arc.is_closed() && arc.angles.iter().any(is_end)) {
            return None;
        }
        let [before, after] = [project(angle - step)?, project(angle + step)?];
        let (along, bend) = (0.5 * (after - before), after - 2.0 * pixel + before);
        let speed = along.norm();
        if along.perp(&bend).abs() * REACH > speed.powi(3) {
            return None;
        }
        let normal = Vector2::new(-along.y, along.x) / speed;
        let across = by_point.tr_mul(&normal);
        Some(Sample {
            place: angle,
            pixel,
            normal,
            by_shift: Vector2::new(across.dot(&arc.toward(angle)), across.dot(&arc.normal())),
        })
    }
}

impl Curve<6> for Circular {
    fn shift_by_step(&self, angle: f64) -> Matrix2x6<f64> {
        let by_step = self.by_step(&self.arc.point_at(angle));
        let directions = [self.arc.toward(angle), self.arc.normal()];
        Matrix3x2::from_columns(&directions).tr_mul(&by_step)
    }

    fn step_of_shift(&self, shift: &Vector2<f64>) -> Step<6> {
        // As the radius grows, the centroid must move for the centre to stay.
        let arm = (self.centroid - self.arc.center) / self.arc.radius;
        let moved = arm * shift.x + self.arc.normal() * shift.y;
        Step::from([moved.x, moved.y, moved.z, shift.x, 0.0, 0.0])
    }

    fn along(&self, angle: f64) -> f64 {
        2.0 * (angle - self.middle()) / self.arc.sweep()
    }

    fn middle(&self) -> f64 {
        0.5 * (self.arc.angles[0] + self.arc.angles[1])
    }

    fn ends(&self) -> Vec<f64> {
        let parts = self.parts();
        let width = self.arc.sweep() / parts as f64;
        (0..=parts)
            .map(|k| self.arc.angles[0] + width * k as f64)
            .collect()
    }

    fn samples(&self, view: usize, camera: &Camera) -> Vec<Vec<Sample>> {
        let ends = self.ends();
        (ends.windows(2))
            .filter_map(|part| self.samples_of_part(view, camera, [part[0], part[1]]))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::camera_looking_at_origin;

    fn arc(sweep: f64) -> CircularArc {
        CircularArc {
            center: Vector3::new(0.05, -0.1, 0.1),
            axes: [Vector3::new(0.6, 0.8, 0.0), Vector3::z()],
            radius: 0.3,
            angles: [0.4, 0.4 + sweep],
        }
    }

    fn circular(sweep: f64) -> Circular {
        Circular::new(&FoundArc {
            arc: arc(sweep),
            gain: 1.0,
            pixel: 0.004,
            sectors: Vec::new(),
            covariance: None,
        })
    }

    #[test]
    fn offsets_change_by_their_jacobian() {
        let camera = camera_looking_at_origin(&Vector3::new(1.2, -1.7, 0.9));
        for sweep in [0.5, 3.0, TAU] {
            let circular = circular(sweep);
            for share in [0.1, 0.4, 0.8] {
                let angle = 0.4 + share * sweep;
                let sample = circular.sample(&camera, angle, 0.01).unwrap();
                let by_step = circular.shift_by_step(angle).tr_mul(&sample.by_shift);
                for k in 0..6 {
                    let offset = |change: f64| {
                        let moved = circular.similar(&Step::ith(k, change));
                        let pixel = camera.project(&moved.point_at(angle)).pixel;
                        sample.normal.dot(&(pixel - sample.pixel))
                    };
                    let difference = (offset(1e-5) - offset(-1e-5)) / 2e-5;
                    // The normal is that of a chord.
                    let off = (by_step[k] - difference).abs();
                    assert!(off < 1e-3 * sample.by_shift.norm(), "{k}: {off}");
                }
            }
        }
    }

    #[test]
    fn centre_and_radius_change_by_their_jacobian() {
        let circular = circular(0.7);
        for k in 0..6 {
            let mut of_step = Matrix6::zeros();
            of_step[(k, k)] = 1.0;
            let of_arc = circular.covariance(&of_step);
            let [low, high] = [-1e-5, 1e-5].map(|change| circular.similar(&Step::ith(k, change)));
            let center = (high.center - low.center) / 2e-5;
            let radius = (high.radius - low.radius) / 2e-5;
            let expected = center.push(radius);
            let off = (of_arc - expected * expected.transpose()).norm();
            assert!(off < 1e-6, "{k}: {of_arc} {expected}");
        }
    }

    #[test]
    fn a_moved_arc_ends_where_it_did() {
        let circular = circular(0.7);
        let step = Step::from([0.001, -0.002, 0.001, 0.03, 0.002, -0.001]);
        let moved = circular.moved(&step).unwrap();
        assert!((moved.radius - 0.33).abs() < 1e-12);
        for (new, old) in moved.angles.iter().zip(circular.arc.angles) {
            let apart = moved.point_at(*new) - circular.arc.point_at(old);
            assert!(apart.dot(&moved.tangent_at(*new)).abs() < 1e-9, "{apart}");
        }
    }

    #[test]
    fn an_arc_does_not_turn_to_another_side() {
        let circular = circular(0.5);
        assert!(circular.moved(&Step::ith(4, 0.01)).is_some());
        assert!(circular.moved(&Step::ith(4, 0.3)).is_none());
    }

    #[test]
    fn an_arc_of_nearly_a_circle_stays_an_arc() {
        let circular = circular(TAU - 1e-4);
        for shift in [-0.002, 0.002] {
            let middle = circular.arc.tangent_at(circular.arc.angles[0]);
            let step = shift * middle;
            let step = Step::from([step.x, step.y, step.z, 0.01, 0.0, 0.0]);
            let moved = circular.moved(&step).unwrap();
            assert!(moved.is_valid(), "{moved:?}");
        }
    }

    #[test]
    fn a_shift_moves_an_arc_outward_and_along_its_axis() {
        let circular = circular(2.0);
        let shift = Vector2::new(0.003, -0.002);
        for angle in circular.ends() {
            let moved = circular.shift_by_step(angle) * circular.step_of_shift(&shift);
            assert!((moved - shift).norm() < 1e-12, "{moved}");
        }
    }
}
