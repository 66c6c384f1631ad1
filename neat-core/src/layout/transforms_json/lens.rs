//! Intrinsics and lens of a frame.

use super::{FrameContext, Lens};
use crate::layout::images::read_size;
use crate::{Distortion, Intrinsics, SceneError};
use std::f64::consts::PI;
use std::path::Path;

/// Camera models that differ in which of `k1 k2 k3 p1 p2` they have.
const PERSPECTIVE_MODELS: [&str; 7] = [
    "PINHOLE",
    "SIMPLE_PINHOLE",
    "PERSPECTIVE",
    "OPENCV",
    "FULL_OPENCV",
    "RADIAL",
    "SIMPLE_RADIAL",
];

const FISHEYE_MODEL: &str = "OPENCV_FISHEYE";

impl FrameContext<'_> {
    /// The lens, by the model and the coefficients.
    pub(super) fn distortion(&self) -> Result<Distortion, SceneError> {
        let model = self.first(|lens| lens.camera_model.clone());
        let model = model.map(|model| model.to_uppercase());
        let is_fisheye = match model.as_deref() {
            Some(FISHEYE_MODEL) => true,
            Some(model) if !PERSPECTIVE_MODELS.contains(&model) => {
                return Err(self.error(format_args!(
                    "has the camera model `{model}`, which is not read: \
                     undistort the images to pinhole cameras first"
                )));
            }
            _ => self.first(|lens| lens.is_fisheye) == Some(true),
        };
        let [k1, k2, k3, k4, p1, p2] = self.coefficients()?;
        let (unread, meaning) = if is_fisheye {
            ([p1, p2], "tangential terms of a fisheye lens")
        } else {
            ([k4, 0.0], "a fourth radial term of a perspective lens")
        };
        if unread != [0.0; 2] {
            return Err(self.error(format_args!(
                "has {meaning} ({unread:?}), which are not read: \
                 undistort the images to pinhole cameras first"
            )));
        }
        Ok(if is_fisheye {
            Distortion::fisheye(&[k1, k2, k3, k4])
        } else {
            Distortion::brown(&[k1, k2, k3], [p1, p2])
        })
    }

    /// k1 k2 k3 k4 p1 p2. What a frame says itself stands before what the file says
    /// for all.
    fn coefficients(&self) -> Result<[f64; 6], SceneError> {
        let Some(listed) = self.first(|lens| lens.distortion_params.clone()) else {
            let numbers: [fn(&Lens) -> Option<f64>; 6] = [
                |lens| lens.k1,
                |lens| lens.k2,
                |lens| lens.k3,
                |lens| lens.k4,
                |lens| lens.p1,
                |lens| lens.p2,
            ];
            return Ok(numbers.map(|number| self.first(number).unwrap_or(0.0)));
        };
        listed.as_slice().try_into().map_err(|_| {
            self.error(format_args!(
                "has {} `distortion_params`, expected k1 k2 k3 k4 p1 p2",
                listed.len()
            ))
        })
    }

    pub(super) fn intrinsics(
        &self,
        size: Option<(u32, u32)>,
        image: &Path,
    ) -> Result<Intrinsics, SceneError> {
        let focal_x = self.first(|lens| Focal::of(lens.fl_x, lens.camera_angle_x));
        let focal_y = self.first(|lens| Focal::of(lens.fl_y, lens.camera_angle_y));
        let (cx, cy) = (self.first(|lens| lens.cx), self.first(|lens| lens.cy));
        let Some(focal_x) = focal_x else {
            return Err(self.error("has no focal length: give `camera_angle_x` or `fl_x`"));
        };
        // The image is only looked at where the numbers need its size.
        let needs_size = cx.is_none()
            || cy.is_none()
            || [Some(focal_x), focal_y]
                .iter()
                .flatten()
                .any(Focal::is_angle);
        let (width, height) = match size {
            Some(size) => size,
            None if needs_size => read_size(image)?,
            None => (0, 0),
        };
        let (width, height) = (f64::from(width), f64::from(height));
        let fx = self.pixels_of_focal("camera_angle_x", focal_x, width)?;
        let fy = focal_y.map_or(Ok(fx), |focal| {
            self.pixels_of_focal("camera_angle_y", focal, height)
        })?;
        let (cx, cy) = (cx.unwrap_or(width / 2.0), cy.unwrap_or(height / 2.0));
        Ok(Intrinsics::new(fx, fy, cx, cy))
    }

    fn pixels_of_focal(&self, key: &str, focal: Focal, extent: f64) -> Result<f64, SceneError> {
        match focal {
            Focal::Pixels(pixels) => Ok(pixels),
            Focal::Angle(angle) if angle > 0.0 && angle < PI => {
                Ok(0.5 * extent / (angle / 2.0).tan())
            }
            Focal::Angle(angle) => Err(self.error(format_args!(
                "has `{key}` = {angle}, expected radians between 0 and π"
            ))),
        }
    }
}

/// A focal length along one axis, as a file may give it.
#[derive(Clone, Copy)]
enum Focal {
    Pixels(f64),
    /// The field of view, in radians.
    Angle(f64),
}

impl Focal {
    /// Pixels, else the angle: files with both have rounded the angle.
    fn of(pixels: Option<f64>, angle: Option<f64>) -> Option<Self> {
        pixels.map(Self::Pixels).or(angle.map(Self::Angle))
    }

    fn is_angle(&self) -> bool {
        matches!(self, Self::Angle(_))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{ONE_FRAME, parse_text};
    use super::*;
    use serde_json::json;

    /// The lens of the frame with these members added.
    fn lens(members: serde_json::Value) -> Result<Distortion, String> {
        let mut json: serde_json::Value = serde_json::from_str(ONE_FRAME).unwrap();
        for (key, value) in members.as_object().unwrap() {
            json[key] = value.clone();
        }
        let poses = parse_text(json.to_string().as_bytes());
        poses
            .map(|poses| poses.views[0].distortion)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn lenses_have_the_coefficients_of_nerfstudio() {
        let brown = Distortion::Brown {
            radial: [0.1, 0.2, 0.3, 0.0, 0.0, 0.0],
            tangential: [0.5, 0.6],
        };
        let named = json!({"k1": 0.1, "k2": 0.2, "k3": 0.3, "p1": 0.5, "p2": 0.6});
        assert_eq!(lens(named), Ok(brown));
        let listed = json!({"distortion_params": [0.1, 0.2, 0.3, 0, 0.5, 0.6], "k1": 9});
        assert_eq!(lens(listed), Ok(brown));
        assert_eq!(lens(json!({"k4": 0})), Ok(Distortion::None));

        let fisheye = Distortion::Fisheye {
            radial: [0.1, 0.2, 0.3, 0.4, 0.0, 0.0],
            tangential: [0.0; 2],
            thin_prism: [0.0; 4],
        };
        let coefficients = json!({"k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4});
        for (key, value) in [
            ("camera_model", json!("opencv_fisheye")),
            ("is_fisheye", json!(true)),
        ] {
            let mut members = coefficients.clone();
            members[key] = value;
            assert_eq!(lens(members.clone()), Ok(fisheye));
            members["p2"] = json!(1e-6);
            assert!(lens(members).unwrap_err().contains("tangential terms"));
        }
        // Frames win.
        let mut json: serde_json::Value = serde_json::from_str(ONE_FRAME).unwrap();
        json["frames"][0]["k1"] = 0.1.into();
        json["k1"] = 0.2.into();
        let poses = parse_text(json.to_string().as_bytes()).unwrap();
        assert!(
            matches!(poses.views[0].distortion, Distortion::Brown { radial, .. } if radial[0] == 0.1)
        );
    }

    #[test]
    fn lenses_that_are_not_read_are_named() {
        for (members, expected) in [
            (
                json!({"camera_model": "EQUIRECTANGULAR"}),
                "`EQUIRECTANGULAR`, which is not read",
            ),
            (json!({"k4": 0.1}), "fourth radial term"),
            (
                json!({"distortion_params": [0, 0.25]}),
                "2 `distortion_params`",
            ),
            (json!({"is_fisheye": true, "p1": 0.1}), "tangential terms"),
        ] {
            let message = lens(members).unwrap_err();
            assert!(message.contains("frame `./images/a.png`"), "{message}");
            assert!(message.contains(expected), "{message}");
        }
    }
}
