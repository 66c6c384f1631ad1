//! What to write, and how.

use crate::{EdgeFilter, ExportError, ViewDirection};

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
