//! What a person can change about the detector.

use serde::{Deserialize, Serialize};

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
    pub merge_distance: f64,
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
            merge_distance: 1.5,
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

impl DetectorConfig {
    /// How many pixels of a `width`×`height` image a reference pixel is.
    /// At least a half: corners do not get rounder in small images.
    pub fn pixels_per_reference_pixel(width: u32, height: u32) -> f64 {
        ((f64::from(width) * f64::from(height)).sqrt() / REFERENCE_SIDE).max(SMALLEST_SCALE)
    }
}
