//! What a person can change about the detector.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The side of the square image that the lengths of [`DetectorConfig`] are for.
const REFERENCE_SIDE: f64 = 512.0;
/// The smallest number of pixels in a reference pixel.
const SMALLEST_SCALE: f64 = 0.5;

/// What finds line segments in an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LineDetector {
    /// The built-in detector alone.
    #[default]
    Own,
    /// The built-in detector, advised by M-LSD ([`crate::detect_with_hints`]), in programs with
    /// the feature `onnx`.
    Mlsd,
}

/// Settings of [`crate::detect`] and of [`crate::wireframe_from_segments`]: those that a
/// scene can ask for. All others are constants with their reasons, in the files of the
/// steps.
///
/// Lengths are in *reference pixels*: pixels of a 512×512 image. They are scaled
/// to the image by the square root of its area, so that one configuration suits
/// a preview and the full photograph.
///
/// Settings may be added: write `..DetectorConfig::default()`.
///
/// ```
/// use neat_detect::DetectorConfig;
///
/// let config = DetectorConfig { min_length: 12.0, ..DetectorConfig::default() };
/// assert!(config.validate().is_ok());
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DetectorConfig {
    /// What finds the segments.
    pub detector: LineDetector,
    /// The smallest colour change that is an edge, in grey levels of 255 per
    /// pixel of the smoothed image. Raised by itself where an image is noisier.
    /// Less for faint edges.
    pub min_gradient: f64,
    /// How many times stronger than the image's median gradient an edge must be:
    /// the texture of photographs is no edge. More for textured scenes.
    pub texture_factor: f64,
    /// Segments shorter than this are dropped. More for large things only.
    pub min_length: f64,
    /// Segments with a lower score are dropped. More for fewer and surer ones.
    pub min_score: f64,
    /// Images with a longer side than this are searched for segments at a
    /// reduced size, in pixels; lines are still fitted to the full image. More for
    /// finer things, which takes longer.
    pub max_search_side: u32,
}

impl Default for DetectorConfig {
    fn default() -> Self {
        Self {
            detector: LineDetector::Own,
            min_gradient: 1.0,
            texture_factor: 2.0,
            min_length: 6.0,
            min_score: 0.06,
            max_search_side: 1024,
        }
    }
}

/// Why a configuration cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum DetectorConfigError {
    /// A number is out of its range.
    #[error("detector: {field} is {value}; choose a value from {min} to {max}")]
    OutOfRange {
        /// The field of [`DetectorConfig`].
        field: &'static str,
        /// Its value.
        value: f64,
        /// Smallest possible value.
        min: f64,
        /// Largest possible value.
        max: f64,
    },
    /// The program has no inference runtime.
    #[error(
        "detector: this program was built without M-LSD; build it with --features onnx, or choose detector = own"
    )]
    NotBuilt,
}

impl DetectorConfig {
    /// Checks every field. [`crate::detect`] takes it for granted.
    ///
    /// # Errors
    /// The first field outside its range, or not a number; a detector that is not built in.
    pub fn validate(&self) -> Result<(), DetectorConfigError> {
        if self.detector == LineDetector::Mlsd && !cfg!(feature = "onnx") {
            return Err(DetectorConfigError::NotBuilt);
        }
        let side = f64::from(self.max_search_side);
        let ranges = [
            ("min_gradient", self.min_gradient, 0.1, 255.0),
            ("texture_factor", self.texture_factor, 0.0, 100.0),
            ("min_length", self.min_length, 1.0, REFERENCE_SIDE),
            ("min_score", self.min_score, 0.0, 1.0),
            ("max_search_side", side, 64.0, 16384.0),
        ];
        let wrong = (ranges.into_iter()).find(|(_, value, min, max)| !(min..=max).contains(&value));
        wrong.map_or(Ok(()), |(field, value, min, max)| {
            Err(DetectorConfigError::OutOfRange {
                field,
                value,
                min,
                max,
            })
        })
    }
}

/// How many pixels of a `width`×`height` image a reference pixel is.
/// At least a half: corners do not get rounder in small images.
pub(crate) fn pixels_per_reference_pixel(width: u32, height: u32) -> f64 {
    ((f64::from(width) * f64::from(height)).sqrt() / REFERENCE_SIDE).max(SMALLEST_SCALE)
}
