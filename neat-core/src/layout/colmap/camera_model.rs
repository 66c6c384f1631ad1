//! COLMAP's camera models: the meaning and order of their parameters.

use crate::distortion::filled;
use crate::{Distortion, Intrinsics};

/// A camera model, by the order and meaning of its parameters.
#[derive(Debug, PartialEq)]
pub(super) struct CameraModel {
    /// COLMAP's name.
    pub name: &'static str,
    /// How many parameters it has.
    pub parameters: usize,
    lens: Lens,
}

/// What the parameters start with, and what distortion follows.
#[derive(Debug, PartialEq)]
enum Lens {
    /// f, cx, cy, then [`Bend`].
    OneFocalLength(Bend),
    /// fx, fy, cx, cy, then [`Bend`].
    TwoFocalLengths(Bend),
    /// A panorama, which is no pinhole image with any distortion.
    NotRead,
}

/// The parameters that bend rays; models with fewer have the first ones.
#[derive(Debug, PartialEq)]
enum Bend {
    /// k1, k2, p1, p2, k3, k4, k5, k6.
    Brown,
    /// k1, k2, k3, k4.
    Fisheye,
    /// k1, k2, p1, p2, k3, k4, sx1, sy1.
    ThinPrismFisheye,
    /// k0 … k5, p0, p1, s0 … s3.
    RadTanThinPrismFisheye,
    /// ω.
    Fov,
    /// k.
    Division,
    /// α, β.
    ExtendedUnified,
}

use Bend::{
    Brown, Division, ExtendedUnified, Fisheye, Fov, RadTanThinPrismFisheye, ThinPrismFisheye,
};
use Lens::{NotRead, OneFocalLength, TwoFocalLengths};

/// The models by their numbers in binary files.
const MODELS: [CameraModel; 18] = [
    model("SIMPLE_PINHOLE", 3, OneFocalLength(Brown)),
    model("PINHOLE", 4, TwoFocalLengths(Brown)),
    model("SIMPLE_RADIAL", 4, OneFocalLength(Brown)),
    model("RADIAL", 5, OneFocalLength(Brown)),
    model("OPENCV", 8, TwoFocalLengths(Brown)),
    model("OPENCV_FISHEYE", 8, TwoFocalLengths(Fisheye)),
    model("FULL_OPENCV", 12, TwoFocalLengths(Brown)),
    model("FOV", 5, TwoFocalLengths(Fov)),
    model("SIMPLE_RADIAL_FISHEYE", 4, OneFocalLength(Fisheye)),
    model("RADIAL_FISHEYE", 5, OneFocalLength(Fisheye)),
    model("THIN_PRISM_FISHEYE", 12, TwoFocalLengths(ThinPrismFisheye)),
    model(
        "RAD_TAN_THIN_PRISM_FISHEYE",
        16,
        TwoFocalLengths(RadTanThinPrismFisheye),
    ),
    model("SIMPLE_DIVISION", 4, OneFocalLength(Division)),
    model("DIVISION", 5, TwoFocalLengths(Division)),
    model("SIMPLE_FISHEYE", 3, OneFocalLength(Fisheye)),
    model("FISHEYE", 4, TwoFocalLengths(Fisheye)),
    model("EUCM", 6, TwoFocalLengths(ExtendedUnified)),
    model("EQUIRECTANGULAR", 2, NotRead),
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

    /// Intrinsics and lens, or `None` for a model that [`Distortion`] cannot say.
    pub fn lens(&self, parameters: &[f64]) -> Option<(Intrinsics, Distortion)> {
        let (bend, fx, fy, cx, cy, rest) = match (&self.lens, parameters) {
            (OneFocalLength(bend), &[f, cx, cy, ref rest @ ..]) => (bend, f, f, cx, cy, rest),
            (TwoFocalLengths(bend), &[fx, fy, cx, cy, ref rest @ ..]) => {
                (bend, fx, fy, cx, cy, rest)
            }
            _ => return None,
        };
        Some((Intrinsics::new(fx, fy, cx, cy), bend.distortion(rest)))
    }
}

impl Bend {
    fn distortion(&self, parameters: &[f64]) -> Distortion {
        match self {
            Brown => {
                let [k1, k2, p1, p2, k3, k4, k5, k6] = filled(parameters);
                Distortion::brown(&[k1, k2, k3, k4, k5, k6], [p1, p2])
            }
            Fisheye => Distortion::fisheye(parameters),
            ThinPrismFisheye => {
                let [k1, k2, p1, p2, k3, k4, s1, s2] = filled(parameters);
                Distortion::ThinPrismFisheye {
                    radial: [k1, k2, k3, k4],
                    tangential: [p1, p2],
                    thin_prism: [s1, s2],
                }
            }
            RadTanThinPrismFisheye => {
                let [k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3] = filled(parameters);
                Distortion::Fisheye {
                    radial: [k0, k1, k2, k3, k4, k5],
                    // Here p0 belongs to x², and p1 to y²: the other way round
                    // than in OpenCV.
                    tangential: [p1, p0],
                    thin_prism: [s0, s1, s2, s3],
                }
            }
            Fov => {
                let [omega] = filled(parameters);
                Distortion::Fov { omega }
            }
            Division => {
                let [k] = filled(parameters);
                Distortion::Division { k }
            }
            ExtendedUnified => {
                let [alpha, beta] = filled(parameters);
                Distortion::ExtendedUnified { alpha, beta }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(name: &str, parameters: &[f64]) -> (Intrinsics, Distortion) {
        let model = CameraModel::by_name(name).unwrap();
        assert_eq!(model.parameters, parameters.len(), "{name}");
        model.lens(parameters).unwrap()
    }

    /// The parameters after focal lengths and principal point are 0.1, 0.2, …
    fn distortion(name: &str) -> Distortion {
        let model = CameraModel::by_name(name).unwrap();
        let shared: &[f64] = match model.lens {
            OneFocalLength(_) => &[9.0, 6.0, 4.0],
            _ => &[9.0, 8.0, 6.0, 4.0],
        };
        let rest = (1..).map(|i| f64::from(i) / 10.0);
        let parameters: Vec<_> = (shared.iter().copied().chain(rest))
            .take(model.parameters)
            .collect();
        let (intrinsics, distortion) = lens(name, &parameters);
        let found = [intrinsics.fx, intrinsics.cx, intrinsics.cy, intrinsics.skew];
        assert_eq!(found, [9.0, 6.0, 4.0, 0.0], "{name}");
        let fy = if shared.len() == 3 { 9.0 } else { 8.0 };
        assert_eq!(intrinsics.fy, fy, "{name}");
        distortion
    }

    /// By the formulas of COLMAP's `sensor/models.h`.
    #[test]
    fn parameters_have_the_order_of_colmap() {
        for name in ["SIMPLE_PINHOLE", "PINHOLE"] {
            assert!(distortion(name).is_none());
        }
        let brown = |radial, tangential| Distortion::Brown { radial, tangential };
        let simple = brown([0.1, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2]);
        assert_eq!(distortion("SIMPLE_RADIAL"), simple);
        let radial = brown([0.1, 0.2, 0.0, 0.0, 0.0, 0.0], [0.0; 2]);
        assert_eq!(distortion("RADIAL"), radial);
        let opencv = brown([0.1, 0.2, 0.0, 0.0, 0.0, 0.0], [0.3, 0.4]);
        assert_eq!(distortion("OPENCV"), opencv);
        let full = brown([0.1, 0.2, 0.5, 0.6, 0.7, 0.8], [0.3, 0.4]);
        assert_eq!(distortion("FULL_OPENCV"), full);
        assert_eq!(distortion("FOV"), Distortion::Fov { omega: 0.1 });

        let fisheye = |radial| Distortion::Fisheye {
            radial,
            tangential: [0.0; 2],
            thin_prism: [0.0; 4],
        };
        for name in ["SIMPLE_FISHEYE", "FISHEYE"] {
            assert_eq!(distortion(name), fisheye([0.0; 6]));
        }
        let simple = fisheye([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(distortion("SIMPLE_RADIAL_FISHEYE"), simple);
        let radial = fisheye([0.1, 0.2, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(distortion("RADIAL_FISHEYE"), radial);
        let opencv = fisheye([0.1, 0.2, 0.3, 0.4, 0.0, 0.0]);
        assert_eq!(distortion("OPENCV_FISHEYE"), opencv);
        let thin_prism = Distortion::ThinPrismFisheye {
            radial: [0.1, 0.2, 0.5, 0.6],
            tangential: [0.3, 0.4],
            thin_prism: [0.7, 0.8],
        };
        assert_eq!(distortion("THIN_PRISM_FISHEYE"), thin_prism);
        let rad_tan = Distortion::Fisheye {
            radial: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
            tangential: [0.8, 0.7],
            thin_prism: [0.9, 1.0, 1.1, 1.2],
        };
        assert_eq!(distortion("RAD_TAN_THIN_PRISM_FISHEYE"), rad_tan);
        for name in ["SIMPLE_DIVISION", "DIVISION"] {
            assert_eq!(distortion(name), Distortion::Division { k: 0.1 });
        }
        let unified = Distortion::ExtendedUnified {
            alpha: 0.1,
            beta: 0.2,
        };
        assert_eq!(distortion("EUCM"), unified);
    }

    #[test]
    fn models_are_found_by_number_and_name() {
        for (id, model) in (0..).zip(&MODELS) {
            assert_eq!(CameraModel::by_id(id), Some(model));
            assert_eq!(CameraModel::by_name(model.name), Some(model));
            let parameters = vec![1.0; model.parameters];
            let read = model.lens(&parameters).is_some();
            assert_eq!(read, model.lens != NotRead, "{}", model.name);
        }
        assert_eq!(CameraModel::by_id(18), None);
        assert_eq!(CameraModel::by_id(-1), None);
        assert_eq!(CameraModel::by_name("pinhole"), None);
    }
}
