//! Parts of spheres around an axis.

use crate::CircularArc;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A cap of a sphere, such as the round end of a pin: what is no farther from its pole than its rim.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dome {
    /// The sphere's centre.
    pub center: Vector3<f64>,
    /// From the centre to the pole, of length 1.
    pub axis: Vector3<f64>,
    /// The sphere's radius, above 0.
    pub radius: f64,
    /// The angle between the axis and the direction to the rim, in radians: between 0 and π.
    pub reach: f64,
}

impl Dome {
    /// The circle in which it ends, around its axis.
    pub fn rim(&self) -> CircularArc {
        let (sine, cosine) = self.reach.sin_cos();
        let center = self.center + self.radius * cosine * self.axis;
        CircularArc::around(center, &self.axis, self.radius * sine)
    }

    /// Where a camera sees the sphere end, as far as the dome goes: the same way to both sides of the
    /// place that is nearest to the pole. `None` within the sphere, and where the outline is none of
    /// the dome's.
    pub fn outline_from(&self, eye: &Vector3<f64>) -> Option<CircularArc> {
        let offset = eye - self.center;
        let sine = self.radius / offset.norm();
        if sine >= 1.0 {
            return None;
        }
        let cosine = (1.0 - sine * sine).sqrt();
        let toward = offset.try_normalize(0.0)?;
        let flat = self.axis - toward * toward.dot(&self.axis);
        let x = (flat.try_normalize(1e-9)).unwrap_or_else(|| across(&toward));
        // At angle t, cos(angle to the axis) = sine · toward·axis + cosine · |flat| · cos t.
        let ahead = self.reach.cos() - sine * toward.dot(&self.axis);
        let half = (ahead / (cosine * flat.norm())).max(-1.0).acos();
        (half > 0.0).then(|| CircularArc {
            center: self.center + self.radius * sine * toward,
            axes: [x, toward.cross(&x)],
            radius: self.radius * cosine,
            angles: [-half, half],
        })
    }

    /// Whether its numbers are those of a dome.
    pub fn is_valid(&self) -> bool {
        let mut numbers = self.center.iter().chain(&self.axis);
        numbers.all(|x| x.is_finite())
            && (self.axis.norm() - 1.0).abs() < 1e-6
            && self.radius.is_normal()
            && self.radius > 0.0
            && self.reach > 0.0
            && self.reach < PI
            && self.rim().is_valid()
    }

    /// The dome that a similarity makes of it, given by what it does with points.
    pub fn map(&self, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        let center = f(&self.center);
        let pole = f(&(self.center + self.radius * self.axis)) - center;
        Self {
            center,
            axis: pole.normalize(),
            radius: pole.norm(),
            reach: self.reach,
        }
    }
}

/// A unit vector perpendicular to another one.
fn across(axis: &Vector3<f64>) -> Vector3<f64> {
    axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rim_lies_on_the_sphere_under_its_angle() {
        let dome = Dome {
            center: Vector3::new(0.2, -0.1, 0.4),
            axis: Vector3::new(0.0, 0.6, -0.8),
            radius: 0.5,
            reach: 2.0,
        };
        for dome in [dome, dome.map(|point| Vector3::x() - 3.0 * point)] {
            assert!(dome.is_valid());
            for point in dome.rim().points(0.3) {
                let toward = (point - dome.center) / dome.radius;
                assert!((toward.norm() - 1.0).abs() < 1e-12);
                assert!((toward.dot(&dome.axis) - dome.reach.cos()).abs() < 1e-12);
            }
            assert!((dome.rim().normal() - dome.axis).norm() < 1e-12);
        }
        let whole = Dome { reach: PI, ..dome };
        assert!(!whole.is_valid());
    }

    #[test]
    fn outlines_are_on_the_dome_where_sight_touches_it() {
        let dome = Dome {
            center: Vector3::new(0.2, -0.1, 0.4),
            axis: Vector3::z(),
            radius: 0.5,
            reach: 1.2,
        };
        let from = |x: f64, z: f64| Vector3::new(x, 0.3, z);
        for eye in [from(2.0, 0.5), from(1.0, 2.0), from(1.5, -0.2)] {
            let outline = dome.outline_from(&eye).unwrap();
            assert!(outline.is_valid());
            for point in outline.points(0.1) {
                let normal = (point - dome.center) / dome.radius;
                assert!((normal.norm() - 1.0).abs() < 1e-12);
                assert!(normal.dot(&(eye - point)).abs() < 1e-12);
                assert!(normal.dot(&dome.axis) > dome.reach.cos() - 1e-12);
            }
            let end = (outline.point_at(outline.angles[1]) - dome.center) / dome.radius;
            assert!((end.dot(&dome.axis) - dome.reach.cos()).abs() < 1e-12);
        }
        // From above it ends at its rim; from within there is nothing, and from below.
        let lens = Dome { reach: 0.3, ..dome };
        for (dome, eye) in [
            (lens, from(0.2, 3.0)),
            (dome, dome.center),
            (dome, dome.center + Vector3::new(0.1, 0.2, -0.1)),
            (lens, from(2.0, -4.0)),
        ] {
            assert_eq!(dome.outline_from(&eye), None);
        }
        // All of it.
        let ball = Dome { reach: 3.0, ..dome };
        assert!(ball.outline_from(&from(2.0, 0.5)).unwrap().is_closed());
    }
}
