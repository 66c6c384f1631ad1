//! Segments of an image by the LSD detector of von Gioi et al. (IPOL 2012).

use crate::smoothed_image::SmoothedImage;
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment2;

/// The gradient below which `lsdetect` ignores a pixel: its quantisation of two
/// grey levels over the sine of its angular tolerance.
const DETECTOR_MIN_GRADIENT: f64 = 5.226;
/// Brightness, and two directions of the colour space across it: edges between
/// colours of one brightness show only in these.
const OPPONENT_AXES: [[f32; 3]; 3] = [[1.0, 1.0, 1.0], [1.0, -1.0, 0.0], [1.0, 1.0, -2.0]];

/// Line segments of an image along which the edge's strength is at least
/// `min_gradient`; one edge may give several.
pub(crate) fn search(image: &SmoothedImage, min_gradient: f64) -> Vec<LineSegment2> {
    let [width, height] = image.size();
    // The strength is a mean over three channels, a projection has all of it.
    let gain = DETECTOR_MIN_GRADIENT / (min_gradient * 3f64.sqrt());
    let mut segments = Vec::new();
    for axis in OPPONENT_AXES {
        let plane = image.projected(&(Vector3::from(axis).normalize() * gain as f32));
        // At scale 1 nothing is filtered: the image is smooth already.
        let found =
            lsdetect::detect(&plane, width, height, 1.0).expect("a plane has one value per pixel");
        segments.extend(found.iter().map(|found| {
            LineSegment2::new(
                Vector2::new(found.x1, found.y1),
                Vector2::new(found.x2, found.y2),
            )
        }));
    }
    segments
}
