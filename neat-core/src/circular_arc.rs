//! Arcs of circles in space.

use crate::LineSegment3;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// An arc covers more, in radians, and one that lacks no more is a whole circle.
const MIN_SWEEP: f64 = 1e-9;

/// An arc of a circle, or a whole one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CircularArc {
    /// The circle's centre.
    pub center: Vector3<f64>,
    /// Toward angle 0 and toward a right angle: of length 1 and perpendicular to each other.
    pub axes: [Vector3<f64>; 2],
    /// The circle's radius, above 0.
    pub radius: f64,
    /// Where it begins and ends, in radians: ascending, at most 2π apart.
    pub angles: [f64; 2],
}

impl CircularArc {
    /// The whole circle around a centre, whose plane has a normal of length 1.
    pub fn around(center: Vector3<f64>, normal: &Vector3<f64>, radius: f64) -> Self {
        let x = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
        Self {
            center,
            axes: [x, normal.cross(&x)],
            radius,
            angles: [0.0, TAU],
        }
    }

    /// The arc from the first of three points through the second to the third; `None` if they
    /// lie on a line, as well as numbers tell.
    pub fn through([start, middle, end]: [Vector3<f64>; 3]) -> Option<Self> {
        let (a, b) = (start - middle, end - middle);
        let normal = b.cross(&a);
        let squared = normal.norm_squared();
        // Toward the centre from the middle, by the formula of the circumscribed circle.
        let offset = (b.norm_squared() * a.cross(&normal) - a.norm_squared() * b.cross(&normal))
            / (2.0 * squared);
        let radius = offset.norm();
        if !radius.is_normal() {
            return None;
        }
        let center = middle + offset;
        let x = (start - center) / radius;
        let y = normal.normalize().cross(&x);
        let circle = Self {
            center,
            axes: [x, y],
            radius,
            angles: [0.0, TAU],
        };
        // Around this normal the three come one after the other.
        Some(Self {
            angles: [0.0, circle.angle_of(&end)],
            ..circle
        })
    }

    /// The point of the circle at an angle.
    pub fn point_at(&self, angle: f64) -> Vector3<f64> {
        self.center + self.radius * self.toward(angle)
    }

    /// The direction from the centre at an angle.
    pub fn toward(&self, angle: f64) -> Vector3<f64> {
        let (sine, cosine) = angle.sin_cos();
        cosine * self.axes[0] + sine * self.axes[1]
    }

    /// The direction along the circle at an angle, toward larger ones.
    pub fn tangent_at(&self, angle: f64) -> Vector3<f64> {
        self.toward(angle + 0.25 * TAU)
    }

    /// The axis of the circle, of length 1.
    pub fn normal(&self) -> Vector3<f64> {
        self.axes[0].cross(&self.axes[1])
    }

    /// The angle, from 0 to 2π, at which the circle comes nearest to a point.
    pub fn angle_of(&self, point: &Vector3<f64>) -> f64 {
        let offset = point - self.center;
        (offset.dot(&self.axes[1]))
            .atan2(offset.dot(&self.axes[0]))
            .rem_euclid(TAU)
    }

    /// The distance of a point from the circle.
    pub fn distance_to_circle(&self, point: &Vector3<f64>) -> f64 {
        (point - self.point_at(self.angle_of(point))).norm()
    }

    /// Whether an angle lies on the arc or at most `margin` beyond its ends.
    pub fn contains(&self, angle: f64, margin: f64) -> bool {
        let [start, end] = self.angles;
        let middle = 0.5 * (start + end);
        let beside = (angle - middle + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
        beside.abs() <= 0.5 * (end - start) + margin
    }

    /// The angle that it covers, in radians.
    pub fn sweep(&self) -> f64 {
        self.angles[1] - self.angles[0]
    }

    /// Its length.
    pub fn length(&self) -> f64 {
        self.radius * self.sweep()
    }

    /// Whether it is a whole circle.
    pub fn is_closed(&self) -> bool {
        self.sweep() > TAU - MIN_SWEEP
    }

    /// Points along it, from end to end, that turn by at most `most` radians from one to the next.
    /// The first and the last of a whole circle are the same.
    pub fn points(&self, most: f64) -> Vec<Vector3<f64>> {
        let count = (self.sweep() / most).ceil().max(1.0);
        let last = if self.is_closed() { 0.0 } else { count };
        let angle = |k: f64| self.angles[0] + self.sweep() * k / count;
        (0..count as usize)
            .map(|k| self.point_at(angle(k as f64)))
            .chain([self.point_at(angle(last))])
            .collect()
    }

    /// Whether its numbers are those of an arc.
    pub fn is_valid(&self) -> bool {
        let points = [self.center, self.axes[0], self.axes[1]];
        let finite = points
            .iter()
            .flat_map(|point| point.iter())
            .all(|x| x.is_finite());
        let [x, y] = self.axes;
        let square = (x.norm() - 1.0)
            .abs()
            .max((y.norm() - 1.0).abs())
            .max(x.dot(&y).abs());
        finite
            && square < 1e-6
            && self.radius.is_normal()
            && self.radius > 0.0
            && self.angles[0].is_finite()
            && (MIN_SWEEP..TAU + MIN_SWEEP).contains(&self.sweep())
    }

    /// Chords along it, from end to end, that turn by at most `most` radians from one to the next.
    pub fn chords(&self, most: f64) -> Vec<LineSegment3> {
        let points = self.points(most);
        (points.windows(2))
            .map(|ends| LineSegment3::new(ends[0], ends[1]))
            .collect()
    }

    /// The arc that a similarity makes of it, given by what it does with points.
    pub fn map(&self, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        let center = f(&self.center);
        let [x, y] = [0.0, 0.25 * TAU].map(|angle| f(&self.point_at(angle)) - center);
        let radius = x.norm();
        Self {
            center,
            axes: [x / radius, y / radius],
            radius,
            angles: self.angles,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arc_through_three_points_runs_through_them_in_order() {
        let circle = CircularArc {
            center: Vector3::new(0.3, -0.2, 0.5),
            axes: [Vector3::new(0.6, 0.8, 0.0), Vector3::new(0.0, 0.0, 1.0)],
            radius: 0.4,
            angles: [0.0, TAU],
        };
        for angles in [
            [0.1, 0.3, 0.6],
            [0.6, 0.3, 0.1],
            [1.0, 3.0, 6.0],
            [6.0, 1.0, 0.5],
        ] {
            let points = angles.map(|angle| circle.point_at(angle));
            let arc = CircularArc::through(points).unwrap();
            assert!((arc.center - circle.center).norm() < 1e-12);
            assert!((arc.radius - 0.4).abs() < 1e-12);
            assert!((arc.point_at(arc.angles[0]) - points[0]).norm() < 1e-12);
            assert!((arc.point_at(arc.angles[1]) - points[2]).norm() < 1e-12);
            assert!(arc.contains(arc.angle_of(&points[1]), 0.0));
            let beyond = circle.point_at(angles[2] + 0.01 * (angles[2] - angles[1]).signum());
            if angles != [6.0, 1.0, 0.5] {
                assert!(!arc.contains(arc.angle_of(&beyond), 0.0));
            }
        }
        assert!(
            CircularArc::through([Vector3::zeros(), Vector3::x(), 2.0 * Vector3::x()]).is_none()
        );
    }

    #[test]
    fn similarities_keep_lengths_in_proportion() {
        let arc = CircularArc::through([Vector3::x(), Vector3::y(), -Vector3::x()]).unwrap();
        let moved = arc.map(|point| 3.0 * point + Vector3::z());
        assert!((moved.length() - 3.0 * arc.length()).abs() < 1e-12);
        assert!((moved.point_at(1.0) - (3.0 * arc.point_at(1.0) + Vector3::z())).norm() < 1e-12);
        let points = moved.points(0.1);
        assert_eq!(points.len(), 33);
        let whole = CircularArc {
            angles: [0.3, 0.3 + TAU],
            ..arc
        };
        let around = whole.points(0.1);
        assert!(whole.is_closed() && !arc.is_closed());
        assert_eq!((around.len(), around[0]), (64, around[63]));
        assert!(
            whole.is_valid()
                && !CircularArc {
                    angles: [1.0; 2],
                    ..arc
                }
                .is_valid()
        );
        assert!((points[32] - Vector3::new(-3.0, 0.0, 1.0)).norm() < 1e-12);
    }
}
