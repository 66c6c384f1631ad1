//! Where the centre of a pixel lies in the coordinates of the intrinsics.

use crate::Camera;
use serde::{Deserialize, Serialize};

/// Which image coordinates the centre of the first pixel has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PixelCenter {
    /// Told by the principal point, where it is the middle of the image; else as
    /// in the published code.
    #[default]
    Auto,
    /// (0, 0): the intrinsics count pixel centres.
    Integer,
    /// (0.5, 0.5): the origin is the corner of the image.
    Half,
}

/// The published code uses integer pixel coordinates with every K.
pub(super) const PUBLISHED: f64 = 0.0;

/// How near the principal point must be to the middle of the image. Half a pixel
/// lies between the two conventions.
const TOLERANCE_IN_PIXELS: f64 = 0.05;

/// The pixel centre by which every principal point is the middle of its image:
/// W/2 if the origin is the corner, (W − 1)/2 if it is a pixel's centre. `None`
/// where they are neither, as those of calibrated cameras.
pub(super) fn infer<'a>(cameras: impl Iterator<Item = &'a Camera> + Clone) -> Option<f64> {
    [0.5, 0.0].into_iter().find(|pixel_center| {
        let middle = |pixels: u32| f64::from(pixels) / 2.0 - 0.5 + pixel_center;
        cameras.clone().all(|camera| {
            let off_x = camera.intrinsics.cx - middle(camera.width);
            let off_y = camera.intrinsics.cy - middle(camera.height);
            off_x.abs().max(off_y.abs()) <= TOLERANCE_IN_PIXELS
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Intrinsics;
    use nalgebra::Matrix4;

    fn camera(cx: f64, cy: f64) -> Camera {
        let intrinsics = Intrinsics {
            fx: 500.0,
            fy: 500.0,
            cx,
            cy,
            skew: 0.0,
        };
        Camera::from_matrices(intrinsics, &Matrix4::identity(), 640, 480)
    }

    #[test]
    fn principal_points_in_the_middle_tell_the_convention() {
        let corner = camera(320.0, 240.0);
        let integer = camera(319.5, 239.5);
        let calibrated = camera(311.2, 243.9);
        assert_eq!(infer([corner, corner].iter()), Some(0.5));
        assert_eq!(infer([integer].iter()), Some(0.0));
        assert_eq!(infer([calibrated].iter()), None);
        assert_eq!(infer([corner, integer].iter()), None);
    }
}
