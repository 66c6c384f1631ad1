//! What to write, and how.

use crate::{EdgeFilter, ExportError, ViewDirection};
use nalgebra::Matrix3;

/// What to write, and how. There may be more of it one day: write
/// `..ExportOptions::default()`.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportOptions {
    /// Which edges.
    pub filter: EdgeFilter,
    /// From where SVG and PNG look.
    pub direction: ViewDirection,
    /// Width of SVG and PNG in pixels, 16 to [`ExportOptions::MAX_WIDTH`].
    pub width: u32,
    /// The unit that STEP states.
    pub unit: LengthUnit,
    /// What is up, which CityJSON turns to +z.
    pub up: UpAxis,
}

impl ExportOptions {
    /// The widest picture: 200 MB in memory.
    pub const MAX_WIDTH: u32 = 8192;
    /// The narrowest picture that can show something.
    pub const MIN_WIDTH: u32 = 16;

    /// Checks the numbers.
    ///
    /// # Errors
    /// If one is outside its range.
    pub fn check(&self) -> Result<(), ExportError> {
        if !(Self::MIN_WIDTH..=Self::MAX_WIDTH).contains(&self.width) {
            return Err(ExportError::BadOption {
                option: "the width",
                value: self.width.to_string(),
                expected: "16 to 8192 pixels",
            });
        }
        self.filter.check()
    }
}

impl Default for ExportOptions {
    fn default() -> Self {
        Self {
            filter: EdgeFilter::default(),
            direction: ViewDirection::Isometric,
            width: 1600,
            unit: LengthUnit::Millimetre,
            up: UpAxis::Z,
        }
    }
}

/// A unit of length.
///
/// STEP cannot leave it open, and most CAD programs work in millimetres: with the
/// default, their numbers are those of the document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LengthUnit {
    /// 0.001 m.
    #[default]
    Millimetre,
    /// 0.01 m.
    Centimetre,
    /// The metre.
    Metre,
}

/// The axis of the document that points upward.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// +x.
    X,
    /// +y, as in computer graphics.
    Y,
    /// +z, as in maps.
    #[default]
    Z,
    /// −x.
    MinusX,
    /// −y, as of images and of a first camera that stands upright.
    MinusY,
    /// −z.
    MinusZ,
}

impl UpAxis {
    /// The six, with the names that they have on command lines.
    pub const NAMED: [(&str, Self); 6] = [
        ("x", Self::X),
        ("y", Self::Y),
        ("z", Self::Z),
        ("-x", Self::MinusX),
        ("-y", Self::MinusY),
        ("-z", Self::MinusZ),
    ];

    /// The axis of this name.
    ///
    /// # Errors
    /// If none of [`Self::NAMED`] has it.
    pub fn from_name(name: &str) -> Result<Self, ExportError> {
        let found = Self::NAMED.into_iter().find(|(known, _)| *known == name);
        found
            .map(|(_, axis)| axis)
            .ok_or_else(|| ExportError::BadOption {
                option: "the axis that is up",
                value: format!("`{name}`"),
                expected: "x, y, z, -x, -y or -z",
            })
    }

    /// The rotation by right angles that turns it to +z.
    #[rustfmt::skip] // Matrices by rows.
    pub(crate) fn to_z(self) -> Matrix3<f64> {
        match self {
            Self::X => Matrix3::new(
                0.0, 1.0, 0.0,
                0.0, 0.0, 1.0,
                1.0, 0.0, 0.0),
            Self::Y => Matrix3::new(
                1.0, 0.0, 0.0,
                0.0, 0.0, -1.0,
                0.0, 1.0, 0.0),
            Self::Z => Matrix3::identity(),
            Self::MinusX => Matrix3::new(
                0.0, 0.0, 1.0,
                0.0, 1.0, 0.0,
                -1.0, 0.0, 0.0),
            Self::MinusY => Matrix3::new(
                1.0, 0.0, 0.0,
                0.0, 0.0, 1.0,
                0.0, -1.0, 0.0),
            Self::MinusZ => Matrix3::new(
                1.0, 0.0, 0.0,
                0.0, -1.0, 0.0,
                0.0, 0.0, -1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn what_is_up_is_turned_to_z_and_not_mirrored() {
        let ups = [Vector3::x(), Vector3::y(), Vector3::z()];
        let ups = ups.into_iter().chain(ups.map(|axis| -axis));
        for ((name, axis), up) in UpAxis::NAMED.into_iter().zip(ups) {
            let turn = axis.to_z();
            assert_eq!(turn * up, Vector3::z(), "{name}");
            assert!((turn.determinant() - 1.0).abs() < 1e-12, "{name}");
            assert_eq!(UpAxis::from_name(name).unwrap(), axis);
        }
        let error = UpAxis::from_name("north").unwrap_err().to_string();
        assert!(error.contains("`north`: give x, y, z"), "{error}");
    }
}
