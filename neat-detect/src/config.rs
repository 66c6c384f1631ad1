//! What a person can change about the detector.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The side of the square image that the lengths of [`DetectorConfig`] are for.
const REFERENCE_SIDE: f64 = 512.0;
/// The smallest number of pixels in a reference pixel.
const SMALLEST_SCALE: f64 = 0.5;

/// Settings of [`crate::detect`] and of [`crate::wireframe_from_segments`].
///
/// Lengths are in *reference pixels*: pixels of a 512×512 image. They are scaled
/// to the image by the square root of its area, so that one configuration suits
/// a preview and the full photograph. Fields that end in `_in_pixels` are in
/// pixels of the image itself: they follow the camera's blur, not the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DetectorConfig {
    /// Standard deviation of the Gaussian that images are smoothed with before
    /// gradients are taken.
    pub smoothing_in_pixels: f64,
    /// The smallest colour change that is an edge, in grey levels of 255 per
    /// pixel of the smoothed image. Raised by itself where an image is noisier.
    pub min_gradient: f64,
    /// How many standard deviations of the image's noise a gradient must have.
    pub noise_factor: f64,
    /// How many times stronger than the image's median gradient an edge must be:
    /// the texture of photographs is no edge.
    pub texture_factor: f64,
    /// Images with a longer side than this are searched for segments at a
    /// reduced size, in pixels; lines are still fitted to the full image.
    pub max_search_side: u32,
    /// Segments shorter than this are dropped.
    pub min_length: f64,
    /// Stretches without an edge along a line up to this length are bridged.
    pub max_gap: f64,
    /// Collinear segments whose lines are no farther apart become one.
    pub merge_distance_in_pixels: f64,
    /// Collinear segments differ in direction by no more than this, in degrees.
    pub merge_angle: f64,
    /// A segment's end moves at most so far outwards to meet another.
    pub max_extension: f64,
    /// A segment's end moves at most so far inwards to meet another.
    pub max_retreat: f64,
    /// As `max_extension`, towards a junction of other segments, where colours
    /// change all the way: a weak edge cannot be seen beside a stronger one.
    pub max_attraction: f64,
    /// A junction lies no farther from the line of each of its segments.
    pub junction_distance: f64,
    /// Segments that meet under a smaller angle than this, in degrees, do not
    /// determine a junction.
    pub min_junction_angle: f64,
    /// A free end this near to the inside of another segment is put on it.
    pub t_junction_distance: f64,
    /// Junctions no farther apart are joined by an edge where the image shows one
    /// between them, however short.
    pub max_completion: f64,
    /// Edges that bend more are curves and are dropped: the height of the arc as
    /// a share of its length.
    pub max_sagitta: f64,
    /// Radius of the neighbourhood in which `clutter_count` is counted.
    pub clutter_radius: f64,
    /// Segments that meet no other are texture if so many others like them are
    /// near and they are shorter than `clutter_length`.
    pub clutter_count: usize,
    /// See `clutter_count`.
    pub clutter_length: f64,
    /// Segments with a lower score are dropped.
    pub min_score: f64,
}

impl Default for DetectorConfig {
    fn default() -> Self {
        Self {
            smoothing_in_pixels: 0.8,
            min_gradient: 1.0,
            noise_factor: 3.0,
            texture_factor: 2.0,
            max_search_side: 1024,
            min_length: 6.0,
            max_gap: 4.0,
            merge_distance_in_pixels: 1.5,
            merge_angle: 8.0,
            max_extension: 8.0,
            max_retreat: 5.0,
            max_attraction: 25.0,
            junction_distance: 1.2,
            min_junction_angle: 2.5,
            max_completion: 25.0,
            max_sagitta: 0.012,
            t_junction_distance: 4.0,
            clutter_radius: 16.0,
            clutter_count: 3,
            clutter_length: 24.0,
            min_score: 0.06,
        }
    }
}

/// Why a configuration cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("detector: {field} is {value}; choose a value from {min} to {max}")]
pub struct DetectorConfigError {
    /// The field of [`DetectorConfig`].
    pub field: &'static str,
    /// Its value.
    pub value: f64,
    /// Smallest possible value.
    pub min: f64,
    /// Largest possible value.
    pub max: f64,
}

impl DetectorConfig {
    /// Checks every field against its range. [`crate::detect`] takes it for granted.
    ///
    /// # Errors
    /// The first field outside its range, or not a number.
    pub fn validate(&self) -> Result<(), DetectorConfigError> {
        const SIDE: f64 = REFERENCE_SIDE;
        let ranges = [
            ("smoothing_in_pixels", self.smoothing_in_pixels, 0.3, 10.0),
            ("min_gradient", self.min_gradient, 0.1, 255.0),
            ("noise_factor", self.noise_factor, 0.0, 100.0),
            ("texture_factor", self.texture_factor, 0.0, 100.0),
            (
                "max_search_side",
                f64::from(self.max_search_side),
                64.0,
                16384.0,
            ),
            ("min_length", self.min_length, 1.0, SIDE),
            ("max_gap", self.max_gap, 0.0, SIDE),
            (
                "merge_distance_in_pixels",
                self.merge_distance_in_pixels,
                0.0,
                10.0,
            ),
            ("merge_angle", self.merge_angle, 0.0, 45.0),
            ("max_extension", self.max_extension, 0.0, SIDE),
            ("max_retreat", self.max_retreat, 0.0, SIDE),
            ("max_attraction", self.max_attraction, 0.0, SIDE),
            ("junction_distance", self.junction_distance, 0.0, SIDE),
            ("min_junction_angle", self.min_junction_angle, 0.1, 90.0),
            ("t_junction_distance", self.t_junction_distance, 0.0, SIDE),
            ("max_completion", self.max_completion, 0.0, SIDE),
            ("max_sagitta", self.max_sagitta, 0.0, 1.0),
            ("clutter_radius", self.clutter_radius, 0.0, SIDE),
            ("clutter_length", self.clutter_length, 0.0, SIDE),
            ("min_score", self.min_score, 0.0, 1.0),
        ];
        ranges
            .into_iter()
            .find(|(_, value, min, max)| !(min..=max).contains(&value))
            .map_or(Ok(()), |(field, value, min, max)| {
                Err(DetectorConfigError {
                    field,
                    value,
                    min,
                    max,
                })
            })
    }

    /// How many pixels of a `width`×`height` image a reference pixel is.
    /// At least a half: corners do not get rounder in small images.
    pub fn pixels_per_reference_pixel(width: u32, height: u32) -> f64 {
        ((f64::from(width) * f64::from(height)).sqrt() / REFERENCE_SIDE).max(SMALLEST_SCALE)
    }
}
