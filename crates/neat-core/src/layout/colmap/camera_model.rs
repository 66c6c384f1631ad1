//! COLMAP's camera models, and which of them are pinholes.

use crate::Intrinsics;

/// A camera model, by the order and meaning of its parameters.
#[derive(Debug, PartialEq)]
pub(super) struct CameraModel {
    /// COLMAP's name.
    pub name: &'static str,
    /// How many parameters it has.
    pub parameters: usize,
    lens: Lens,
}

/// What the parameters start with, and what all others at zero leave.
#[derive(Debug, PartialEq)]
enum Lens {
    /// f, cx, cy, then distortion of a pinhole.
    OneFocalLength,
    /// fx, fy, cx, cy, then distortion of a pinhole.
    TwoFocalLengths,
    /// Equidistant: no pinhole even where every distortion is zero.
    Fisheye,
}

use Lens::{Fisheye, OneFocalLength, TwoFocalLengths};

/// The models by their numbers in binary files.
const MODELS: [CameraModel; 12] = [
    model("SIMPLE_PINHOLE", 3, OneFocalLength),
    model("PINHOLE", 4, TwoFocalLengths),
    model("SIMPLE_RADIAL", 4, OneFocalLength),
    model("RADIAL", 5, OneFocalLength),
    model("OPENCV", 8, TwoFocalLengths),
    model("OPENCV_FISHEYE", 8, Fisheye),
    model("FULL_OPENCV", 12, TwoFocalLengths),
    model("FOV", 5, TwoFocalLengths),
    model("SIMPLE_RADIAL_FISHEYE", 4, Fisheye),
    model("RADIAL_FISHEYE", 5, Fisheye),
    model("THIN_PRISM_FISHEYE", 12, Fisheye),
    model("RAD_TAN_THIN_PRISM_FISHEYE", 16, Fisheye),
];

const fn model(name: &'static str, parameters: usize, lens: Lens) -> CameraModel {
    CameraModel {
        name,
        parameters,
        lens,
    }
}

impl CameraModel {
    /// The model of a number, as binary files have it.
    pub fn by_id(id: i32) -> Option<&'static Self> {
        static MODELS_BY_ID: &[CameraModel] = &MODELS;
        MODELS_BY_ID.get(usize::try_from(id).ok()?)
    }

    /// The model of a name, as text files have it.
    pub fn by_name(name: &str) -> Option<&'static Self> {
        (0..)
            .map_while(Self::by_id)
            .find(|model| model.name == name)
    }

    /// The intrinsics, if `parameters` make the model a pinhole: every distortion
    /// is zero.
    pub fn pinhole(&self, parameters: &[f64]) -> Option<Intrinsics> {
        let (fx, fy, cx, cy, distortion) = match (&self.lens, parameters) {
            (OneFocalLength, &[f, cx, cy, ref rest @ ..]) => (f, f, cx, cy, rest),
            (TwoFocalLengths, &[fx, fy, cx, cy, ref rest @ ..]) => (fx, fy, cx, cy, rest),
            _ => return None,
        };
        let skew = 0.0;
        distortion.iter().all(|&x| x == 0.0).then_some(Intrinsics {
            fx,
            fy,
            cx,
            cy,
            skew,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_models_without_distortion_are_pinholes() {
        for (id, model) in (0..).zip(&MODELS) {
            assert_eq!(CameraModel::by_id(id), Some(model));
            assert_eq!(CameraModel::by_name(model.name), Some(model));
            let shared = if model.lens == OneFocalLength { 3 } else { 4 };
            let mut parameters = vec![0.0; model.parameters];
            for (index, parameter) in parameters[..shared].iter_mut().enumerate() {
                *parameter = 1.0 + index as f64;
            }
            let pinhole = model.pinhole(&parameters);
            assert_eq!(pinhole.is_some(), model.lens != Fisheye, "{}", model.name);
            if let Some(found) = pinhole {
                let found = [found.fx, found.fy, found.cx, found.cy];
                let expected = match shared {
                    3 => [1.0, 1.0, 2.0, 3.0],
                    _ => [1.0, 2.0, 3.0, 4.0],
                };
                assert_eq!(found, expected, "{}", model.name);
            }
            for distorted in shared..model.parameters {
                let mut parameters = parameters.clone();
                parameters[distorted] = 1e-3;
                assert_eq!(model.pinhole(&parameters), None, "{}", model.name);
            }
        }
        assert_eq!(CameraModel::by_id(12), None);
        assert_eq!(CameraModel::by_id(-1), None);
        assert_eq!(CameraModel::by_name("pinhole"), None);
    }
}
