//! Projection of world points that lie in front of a camera, with derivatives.

use nalgebra::{Matrix2x3, Vector2, Vector3};
use neat_core::{Camera, LineSegment2, LineSegment3};

/// Points nearer to the camera plane than this have no useful projection.
const MIN_DEPTH: f64 = 1e-6;

/// The image of a world point in pixels, or `None` unless it lies in front of
/// the camera.
pub fn project_in_front(camera: &Camera, point_in_world: &Vector3<f64>) -> Option<Vector2<f64>> {
    let projection = camera.project(point_in_world);
    (projection.depth > MIN_DEPTH).then_some(projection.pixel)
}

/// The projection of a segment, if both of its ends lie in front of the camera.
pub(crate) fn project_segment_in_front(
    camera: &Camera,
    segment: &LineSegment3,
) -> Option<LineSegment2> {
    let [start, end] = segment.ends().map(|end| project_in_front(camera, &end));
    Some(LineSegment2::new(start?, end?))
}

/// [`project_in_front`] with the derivative of the pixel by the world point,
/// `[2, 3]`.
pub fn project_with_jacobian(
    camera: &Camera,
    point_in_world: &Vector3<f64>,
) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
    let projection = camera.project(point_in_world);
    (projection.depth > MIN_DEPTH).then(|| {
        let k = &camera.intrinsics;
        let (x, y) = (projection.calibrated.x, projection.calibrated.y);
        let pixel_by_camera_point =
            Matrix2x3::new(k.fx, k.skew, -(k.fx * x + k.skew * y), 0.0, k.fy, -k.fy * y)
                / projection.depth;
        (
            projection.pixel,
            pixel_by_camera_point * camera.world_from_camera.transpose(),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::camera_looking_at_origin;

    #[test]
    fn jacobian_agrees_with_finite_differences() {
        let mut camera = camera_looking_at_origin(&Vector3::new(1.2, -1.7, 0.9));
        camera.intrinsics.skew = 3.5;
        camera.intrinsics.fy = 571.0;
        let point = Vector3::new(0.2, 0.1, -0.3);
        let (pixel, jacobian) = project_with_jacobian(&camera, &point).unwrap();
        assert_eq!(Some(pixel), project_in_front(&camera, &point));
        let step = 1e-5;
        for axis in 0..3 {
            let offset = Vector3::ith(axis, step);
            let numeric = (camera.project(&(point + offset)).pixel
                - camera.project(&(point - offset)).pixel)
                / (2.0 * step);
            assert!((numeric - jacobian.column(axis)).norm() < 1e-5 * jacobian.norm());
        }
    }

    #[test]
    fn points_behind_the_camera_or_not_finite_have_no_projection() {
        let camera = camera_looking_at_origin(&Vector3::new(0.0, 0.0, 2.0));
        for z in [3.0, 2.0, f64::NAN] {
            let point = Vector3::new(0.1, 0.0, z);
            assert_eq!(project_in_front(&camera, &point), None);
            assert_eq!(project_with_jacobian(&camera, &point), None);
        }
    }
}
