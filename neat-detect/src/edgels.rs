//! Points where colours change fastest, to a fraction of a pixel.

use crate::config::DetectorConfig;
use crate::detection::PreparedImage;
use image::RgbImage;
use nalgebra::{Matrix2, Vector2};
use neat_core::{Edgel, EdgelMap};

/// The edgels of `image`: local maxima of the gradient of colours (di Zenzo 1986) across the
/// edge, at least as strong as the weakest edge of a segment may be. The centre of the first
/// pixel is at (`pixel_center`, `pixel_center`).
///
/// Runs on the calling thread.
///
/// ```
/// use image::{Rgb, RgbImage};
/// use nalgebra::Vector2;
/// use neat_detect::{DetectorConfig, edgel_map};
///
/// // A step between the columns 29 and 30.
/// let image = RgbImage::from_fn(64, 64, |x, _| Rgb([if x < 30 { 20 } else { 200 }; 3]));
/// let map = edgel_map(&image, &DetectorConfig::default(), 0.0);
/// let found = map.nearest(&Vector2::new(29.0, 20.0), &Vector2::x(), 1.0, 0.9, |_| true);
/// assert!((found.unwrap().0 - 0.5).abs() < 0.05);
/// ```
pub fn edgel_map(image: &RgbImage, config: &DetectorConfig, pixel_center: f64) -> EdgelMap {
    let mut edgels = edgels(image, config);
    for edgel in &mut edgels {
        edgel.position = edgel.position.add_scalar(pixel_center as f32);
    }
    EdgelMap::new(&edgels, image.width(), image.height())
}

/// The edgels with pixel centres at integers.
fn edgels(image: &RgbImage, config: &DetectorConfig) -> Vec<Edgel> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    if width < 5 || height < 5 {
        return Vec::new();
    }
    let prepared = PreparedImage::new(image, config);
    let strengths = strengths(&prepared, width, height);
    let min_strength = prepared.min_gradient as f32;
    let mut found = Vec::new();
    for row in 2..height - 2 {
        for column in 2..width - 2 {
            let strength = strengths[row * width + column];
            if strength < min_strength {
                continue;
            }
            let normal = Gradient::at(&prepared, column, row).direction();
            let at = |side: f32| {
                let place = Vector2::new(column as f32, row as f32) + side * normal;
                interpolated(&strengths, width, &place)
            };
            let (before, after) = (at(-1.0), at(1.0));
            if strength < before || strength <= after {
                continue;
            }
            // The vertex of the parabola through the three.
            let curvature = before - 2.0 * strength + after;
            let shift = if curvature < 0.0 {
                (0.5 * (before - after) / curvature).clamp(-0.5, 0.5)
            } else {
                0.0
            };
            found.push(Edgel {
                position: Vector2::new(column as f32, row as f32) + shift * normal,
                normal,
            });
        }
    }
    found
}

/// How fast the colours around a pixel change: the structure tensor, as the mean of its
/// diagonal, half of the difference there, and the other element.
struct Gradient {
    mean: f32,
    half_difference: f32,
    mixed: f32,
}

impl Gradient {
    /// That of an inner pixel.
    fn at(prepared: &PreparedImage, column: usize, row: usize) -> Self {
        let mut tensor = Matrix2::<f32>::zeros();
        for [x, y] in prepared.smoothed.differences(column, row) {
            tensor += Matrix2::new(x * x, x * y, x * y, y * y);
        }
        let tensor = tensor / 3.0;
        Self {
            mean: 0.5 * tensor.trace(),
            half_difference: 0.5 * (tensor[(0, 0)] - tensor[(1, 1)]),
            mixed: tensor[(0, 1)],
        }
    }

    /// The fastest change, in grey levels per pixel.
    fn strength(&self) -> f32 {
        let [x, y] = [self.half_difference, self.mixed].map(f64::from);
        (self.mean + (x * x + y * y).sqrt() as f32).sqrt()
    }

    /// The direction of the fastest change.
    fn direction(&self) -> Vector2<f32> {
        let angle = 0.5 * self.mixed.atan2(self.half_difference);
        Vector2::new(angle.cos(), angle.sin())
    }
}

/// Strength of the gradient at each pixel; zero at the border.
fn strengths(prepared: &PreparedImage, width: usize, height: usize) -> Vec<f32> {
    let mut strengths = vec![0.0; width * height];
    for row in 1..height - 1 {
        for column in 1..width - 1 {
            strengths[row * width + column] = Gradient::at(prepared, column, row).strength();
        }
    }
    strengths
}

/// Strength between pixels, linearly.
fn interpolated(strengths: &[f32], width: usize, place: &Vector2<f32>) -> f32 {
    let (column, row) = (place.x as usize, place.y as usize);
    let (u, v) = (place.x - column as f32, place.y - row as f32);
    let first = row * width + column;
    let at = |offset: usize| strengths[first + offset];
    (1.0 - v) * ((1.0 - u) * at(0) + u * at(1)) + v * ((1.0 - u) * at(width) + u * at(width + 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    /// A bright disc, each pixel by the share of it that the disc covers.
    fn disc(center: [f64; 2], radius: f64) -> RgbImage {
        const PARTS: u32 = 8;
        RgbImage::from_fn(80, 64, |x, y| {
            let covered = (0..PARTS * PARTS).filter(|part| {
                let at = |pixel: u32, part: u32| {
                    f64::from(pixel) + (f64::from(part) + 0.5) / f64::from(PARTS) - 0.5
                };
                let [dx, dy] = [
                    at(x, part % PARTS) - center[0],
                    at(y, part / PARTS) - center[1],
                ];
                dx.hypot(dy) < radius
            });
            let share = covered.count() as f64 / f64::from(PARTS * PARTS);
            Rgb([(20.0 + 200.0 * share) as u8; 3])
        })
    }

    #[test]
    fn edgels_lie_on_the_rim_of_a_disc_and_point_across_it() {
        let (center, radius) = ([38.3, 30.6], 20.0);
        let found = edgels(&disc(center, radius), &DetectorConfig::default());
        // One for most pixels of the rim, and no other.
        assert!((80..160).contains(&found.len()), "{}", found.len());
        let mut sum = 0.0;
        for edgel in &found {
            let offset = edgel.position.cast::<f64>() - Vector2::from(center);
            let off = (offset.norm() - radius).abs();
            // Strengths between pixels are linear, which draws maxima towards pixels.
            assert!(off < 0.2, "{off}");
            sum += off;
            let cosine = edgel.normal.cast::<f64>().dot(&offset.normalize());
            assert!(cosine.abs() > 0.99, "{cosine}");
        }
        let mean = sum / found.len() as f64;
        assert!(mean < 0.08, "{mean}");
    }

    #[test]
    fn images_without_room_or_contrast_have_none() {
        for (width, height) in [(0, 0), (4, 40), (40, 4), (40, 40)] {
            let flat = RgbImage::from_pixel(width, height, Rgb([90; 3]));
            assert!(edgels(&flat, &DetectorConfig::default()).is_empty());
        }
    }
}
