//! Distances of image points from the projection of a 3D line.
//!
//! The line is given by two of its points; neither needs to lie in front of the
//! camera, since only the plane that the line and the camera's centre span
//! matters.

use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, LineSegment2, LineSegment3};

/// A 3D line in one image.
#[derive(Clone, Copy, Debug)]
pub(super) struct ProjectedLine {
    /// The line's two points in the camera frame.
    points_in_camera: [Vector3<f64>; 2],
    /// `n · (u, v, 1)` is the signed distance in pixels.
    pub normal_form: Vector3<f64>,
    /// Length of the line's coefficients before they were normalised.
    scale: f64,
}

/// A signed distance in pixels with its derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineDistance {
    /// Of the image point from the projected line.
    pub distance: f64,
    /// Derivatives by the line's two points in the world.
    pub by_points: [Vector3<f64>; 2],
}

impl ProjectedLine {
    /// `None` where the line passes through the camera's centre.
    pub(super) fn new(camera: &Camera, line: &LineSegment3) -> Option<Self> {
        let points_in_camera = line.ends().map(|point| camera.to_camera(&point));
        let [p, q] = points_in_camera;
        let l = p.cross(&q);
        let k = &camera.intrinsics;
        // K⁻ᵀ l: from the calibrated plane to pixels.
        let x = l.x / k.fx;
        let y = (l.y - k.skew * x) / k.fy;
        let z = l.z - k.cx * x - k.cy * y;
        let scale = x.hypot(y);
        (scale.is_normal()).then(|| Self {
            points_in_camera,
            normal_form: Vector3::new(x, y, z) / scale,
            scale,
        })
    }

    /// Signed distance of an image point in pixels.
    pub(super) fn distance(&self, pixel: &Vector2<f64>) -> f64 {
        self.normal_form.xy().dot(pixel) + self.normal_form.z
    }

    /// Larger distance of a 2D segment's two ends in pixels.
    pub(super) fn segment_distance(&self, segment: &LineSegment2) -> f64 {
        let [a, b] = segment.ends().map(|end| self.distance(&end).abs());
        a.max(b)
    }

    /// [`Self::distance`] with its derivatives.
    pub(super) fn distance_with_gradient(
        &self,
        camera: &Camera,
        pixel: &Vector2<f64>,
    ) -> LineDistance {
        let distance = self.distance(pixel);
        let n = self.normal_form.xy();
        let by_xy = (pixel - distance * n) / self.scale;
        let by_z = 1.0 / self.scale;
        // K⁻¹ of the derivative by the coefficients in pixels.
        let k = &camera.intrinsics;
        let y = (by_xy.y - k.cy * by_z) / k.fy;
        let by_line = Vector3::new((by_xy.x - k.skew * y - k.cx * by_z) / k.fx, y, by_z);
        let [p, q] = self.points_in_camera;
        LineDistance {
            distance,
            by_points: [
                camera.world_from_camera * q.cross(&by_line),
                camera.world_from_camera * by_line.cross(&p),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::camera_looking_at_origin;

    fn camera() -> Camera {
        let mut camera = camera_looking_at_origin(&Vector3::new(1.2, -1.7, 0.9));
        camera.intrinsics.skew = 3.5;
        camera.intrinsics.fy = 571.0;
        camera
    }

    #[test]
    fn distances_are_those_from_the_line_through_the_projections() {
        let camera = camera();
        let line = LineSegment3::new(Vector3::new(0.2, 0.1, -0.3), Vector3::new(-0.4, 0.3, 0.2));
        let projected = line.map(|end| camera.project(end).pixel);
        let pixel = Vector2::new(140.0, 222.0);
        let direction = (projected.end - projected.start).normalize();
        let expected = (pixel - projected.start).perp(&direction).abs();
        let line = ProjectedLine::new(&camera, &line).unwrap();
        assert!((line.distance(&pixel).abs() - expected).abs() < 1e-9);
        assert!(line.segment_distance(&projected) < 1e-9);
    }

    #[test]
    fn gradient_agrees_with_finite_differences() {
        let camera = camera();
        let line = LineSegment3::new(Vector3::new(0.2, 0.1, -0.3), Vector3::new(-0.4, 0.3, 0.2));
        let pixel = Vector2::new(140.0, 222.0);
        let at = |line: &LineSegment3| ProjectedLine::new(&camera, line).unwrap();
        let gradient = at(&line).distance_with_gradient(&camera, &pixel).by_points;
        let step = 1e-6;
        for side in 0..2 {
            for axis in 0..3 {
                let moved = |sign: f64| {
                    let mut ends = line.ends();
                    ends[side][axis] += sign * step;
                    at(&LineSegment3::new(ends[0], ends[1])).distance(&pixel)
                };
                let numeric = (moved(1.0) - moved(-1.0)) / (2.0 * step);
                assert!((numeric - gradient[side][axis]).abs() < 1e-5 * (1.0 + numeric.abs()));
            }
        }
    }
}
