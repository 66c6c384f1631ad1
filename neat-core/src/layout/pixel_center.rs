//! Where the centre of a pixel lies in the coordinates of the intrinsics.

use super::SceneWarning;
use super::poses::Poses;
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
const PUBLISHED: f64 = 0.0;

/// How near the principal point must be to the middle of the image. Half a pixel
/// lies between the two conventions.
const TOLERANCE_IN_PIXELS: f64 = 0.05;

/// The pixel centre that is asked for, or else that the file of the poses names, or else
/// that the cameras tell, or else that of the published code.
pub(super) fn choose(
    asked: PixelCenter,
    poses: &Poses,
    cameras: &[Camera],
    warnings: &mut Vec<SceneWarning>,
) -> f64 {
    let told = match asked {
        PixelCenter::Integer => Some(0.0),
        PixelCenter::Half => Some(0.5),
        PixelCenter::Auto => poses.pixel_center.or_else(|| infer(cameras)),
    };
    told.unwrap_or_else(|| {
        let pixel_center = PUBLISHED;
        warnings.push(SceneWarning::PixelCenterAssumed { pixel_center });
        pixel_center
    })
}

/// The pixel centre by which every principal point is the middle of its image:
/// W/2 if the origin is the corner, (W − 1)/2 if it is a pixel's centre. `None`
/// where they are neither, as those of calibrated cameras.
fn infer(cameras: &[Camera]) -> Option<f64> {
    [0.5, 0.0].into_iter().find(|pixel_center| {
        let middle = |pixels: u32| f64::from(pixels) / 2.0 - 0.5 + pixel_center;
        cameras.iter().all(|camera| {
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
        assert_eq!(infer(&[corner, corner]), Some(0.5));
        assert_eq!(infer(&[integer]), Some(0.0));
        assert_eq!(infer(&[calibrated]), None);
        assert_eq!(infer(&[corner, integer]), None);
    }
}
