//! How noisy an image is, and what that asks of its smoothing.

use crate::robust_line::DEVIATION_FROM_MEDIAN;
use image::RgbImage;
use std::f64::consts::PI;

/// Images with less noise than this, in grey levels, are smoothed no further.
const LITTLE_NOISE: f64 = 2.0;
/// Standard deviation of the Gaussian that images are smoothed with before gradients are
/// taken, in pixels: it follows the blur of cameras, not the scene.
const SMOOTHING: f64 = 0.8;
/// No image is smoothed more than this, in pixels: neighbouring edges would merge.
const MAX_SMOOTHING: f64 = 2.0;

/// Standard deviation of an image's noise in each channel, in grey levels.
///
/// The median response of a mask that is blind to edges that are straight over
/// three pixels (Immerkær, "Fast noise variance estimation", 1996); flat and
/// saturated images have none.
pub(crate) fn estimate(image: &RgbImage) -> f64 {
    let (width, height) = (image.width() as usize, image.height() as usize);
    // Green: raw converters interpolate it least.
    let green: Vec<i32> = image
        .as_raw()
        .iter()
        .skip(1)
        .step_by(3)
        .map(|&v| i32::from(v))
        .collect();
    // Responses are from 0 to 8 · 255: counted, not sorted.
    let mut histogram = [0usize; 8 * 255 + 1];
    let mut count = 0;
    for rows in 1..height.saturating_sub(1) {
        let [above, row, below] = [rows - 1, rows, rows + 1].map(|y| &green[y * width..][..width]);
        for x in 1..width.saturating_sub(1) {
            let second = |row: &[i32]| row[x - 1] - 2 * row[x] + row[x + 1];
            let response = second(above) - 2 * second(row) + second(below);
            histogram[response.unsigned_abs() as usize] += 1;
            count += 1;
        }
    }
    let mut below = 0;
    let median = histogram.iter().position(|bin| {
        below += bin;
        2 * below >= count
    });
    // White noise of deviation 1 has the response √(1 + 4 + … ) = 6.
    median.unwrap_or(0) as f64 * DEVIATION_FROM_MEDIAN / 6.0
}

/// The smoothing that keeps the noise of gradients in bounds, in pixels.
pub(crate) fn smoothing(noise: f64) -> f64 {
    let factor = (noise / LITTLE_NOISE).sqrt().max(1.0);
    (SMOOTHING * factor).min(MAX_SMOOTHING)
}

/// Standard deviation of each component of the gradient of white noise that was
/// smoothed by a Gaussian, per pixel.
pub(crate) fn gradient_noise(smoothing: f64, noise: f64) -> f64 {
    noise / (smoothing * smoothing * (8.0 * PI).sqrt())
}
