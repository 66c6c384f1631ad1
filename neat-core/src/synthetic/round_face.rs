//! Faces on cylinders and cones.

use crate::{CircularArc, LineSegment3, Ray};
use nalgebra::Vector3;

/// A part of a cylinder, or a whole ring of a cone: the lines that join the points of two arcs around one
/// axis at the same angles.
#[derive(Clone, Debug, PartialEq)]
pub struct RoundFace {
    /// The arcs that bound it, of the same axes and angles; the second lies where the normal of the
    /// first points.
    pub rims: [CircularArc; 2],
    /// Whether its outer side looks away from the axis.
    pub convex: bool,
}

impl RoundFace {
    /// The unit axis, from the first rim to the second.
    pub fn axis(&self) -> Vector3<f64> {
        self.rims[0].normal()
    }

    /// The distance of the rims.
    pub fn height(&self) -> f64 {
        (self.rims[1].center - self.rims[0].center).norm()
    }

    /// By how much the radius grows along the axis; 0 for a cylinder.
    pub fn slope(&self) -> f64 {
        (self.rims[1].radius - self.rims[0].radius) / self.height()
    }

    /// The straight line of the face at an angle.
    pub fn ruling(&self, angle: f64) -> LineSegment3 {
        let [start, end] = self.rims.map(|rim| rim.point_at(angle));
        LineSegment3::new(start, end)
    }

    /// The unit normal at an angle, away from the solid.
    pub fn normal_at(&self, angle: f64) -> Vector3<f64> {
        let outward = self.rims[0].toward(angle) - self.slope() * self.axis();
        outward.normalize() * if self.convex { 1.0 } else { -1.0 }
    }

    /// The normal at the angle of a point.
    pub fn normal_beside(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.normal_at(self.rims[0].angle_of(point))
    }

    /// The point of the face nearest to `point`.
    pub fn closest_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let rim = &self.rims[0];
        let angle = rim.angle_of(point);
        let on_ruling = |angle: f64| {
            let ruling = self.ruling(angle);
            ruling.point_at(ruling.line_parameter(point).clamp(0.0, 1.0))
        };
        if rim.contains(angle, 0.0) {
            return on_ruling(angle);
        }
        let [start, end] = rim.angles.map(on_ruling);
        if (start - point).norm_squared() < (end - point).norm_squared() {
            start
        } else {
            end
        }
    }

    /// The nearest distance along `ray` at which it crosses the face, from either side.
    pub fn intersect(&self, ray: &Ray) -> Option<f64> {
        let (rim, axis, slope, height) = (&self.rims[0], self.axis(), self.slope(), self.height());
        let from_center = ray.origin - rim.center;
        let [rise, rise_along] = [from_center, ray.direction].map(|vector| vector.dot(&axis));
        let [across, across_along] = [from_center - rise * axis, ray.direction - rise_along * axis];
        // The squared distance from the axis is that of the radius.
        let [radius, radius_along] = [rim.radius + slope * rise, slope * rise_along];
        let a = across_along.norm_squared() - radius_along * radius_along;
        let b = across.dot(&across_along) - radius * radius_along;
        let c = across.norm_squared() - radius * radius;
        real_roots(a, b, c)
            .into_iter()
            .filter(|distance| {
                let rise = rise + distance * rise_along;
                let point = ray.origin + ray.direction * *distance;
                *distance > 0.0
                    && (0.0..=height).contains(&rise)
                    && rim.contains(rim.angle_of(&point), 0.0)
            })
            .min_by(f64::total_cmp)
    }

    /// The planes through an eye that touch the surface along a ruling, by their normals: there the face
    /// turns away.
    pub(super) fn tangent_planes(&self, eye: &Vector3<f64>) -> Vec<Vector3<f64>> {
        let rim = &self.rims[0];
        let from_center = eye - rim.center;
        // The plane of the ruling at an angle holds the eye.
        let [x, y] = rim.axes.map(|axis| from_center.dot(&axis));
        let reach = (rim.radius + self.slope() * from_center.dot(&self.axis())) / x.hypot(y);
        if reach.abs() > 1.0 {
            return Vec::new();
        }
        let (toward, beside) = (y.atan2(x), reach.acos());
        [toward - beside, toward + beside]
            .map(|angle| self.normal_at(angle))
            .to_vec()
    }

    /// Its area.
    pub fn area(&self) -> f64 {
        let [lower, upper] = self.rims.map(|rim| rim.length());
        (lower + upper) / 2.0 * self.height() * self.slope().hypot(1.0)
    }

    /// Points whose convex hull holds the face.
    pub(super) fn hull(&self) -> Vec<Vector3<f64>> {
        let square = |rim: &CircularArc| {
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            corners.map(|(x, y)| rim.center + rim.radius * (x * rim.axes[0] + y * rim.axes[1]))
        };
        self.rims.iter().flat_map(square).collect()
    }
}

/// The real t with a t² + 2 b t + c = 0.
pub(super) fn real_roots(a: f64, b: f64, c: f64) -> Vec<f64> {
    let discriminant = b * b - a * c;
    if discriminant < 0.0 {
        return Vec::new();
    }
    // The root whose terms do not cancel, and the other by their product.
    let q = -(b + discriminant.sqrt().copysign(b));
    [q / a, c / q]
        .into_iter()
        .filter(|root| root.is_finite())
        .collect()
}
