//! Segments of an image by the LSD detector of von Gioi et al. (IPOL 2012).

use crate::smoothed_image::SmoothedImage;
use nalgebra::Vector2;
use neat_core::LineSegment2;

/// The gradient below which `lsdetect` ignores a pixel: its quantisation of two
/// grey levels over the sine of its angular tolerance.
const DETECTOR_MIN_GRADIENT: f64 = 5.226;

/// Line segments of an image, longest first, where the gradient of the
/// luminance is at least `min_gradient`.
pub(crate) fn search(image: &SmoothedImage, min_gradient: f64) -> Vec<LineSegment2> {
    let [width, height] = image.size();
    let gain = DETECTOR_MIN_GRADIENT / min_gradient;
    let luminance: Vec<f64> = image.luminance().iter().map(|value| value * gain).collect();
    // At scale 1 it filters nothing: the image is smooth already.
    let segments = lsdetect::detect(&luminance, width, height, 1.0)
        .expect("one luminance value per pixel of the image");
    segments
        .iter()
        .map(|s| LineSegment2::new(Vector2::new(s.x1, s.y1), Vector2::new(s.x2, s.y2)))
        .collect()
}
