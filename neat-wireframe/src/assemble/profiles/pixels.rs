//! Colours between the pixels of an image.

use super::profile::{PLACES, places};
use image::RgbImage;
use nalgebra::Vector2;

pub(super) struct Pixels<'a> {
    pub image: &'a RgbImage,
    /// Both coordinates of the centre of the first pixel.
    pub pixel_center: f64,
}

impl Pixels<'_> {
    /// Whether the colour at a point is known.
    pub(super) fn holds(&self, pixel: &Vector2<f64>) -> bool {
        let within = |x: f64, size: u32| {
            let x = x - self.pixel_center;
            x >= 1.0 && x < f64::from(size) - 2.0
        };
        within(pixel.x, self.image.width()) && within(pixel.y, self.image.height())
    }

    /// The medians over points along a curve, at each place on the way across it that each of them
    /// has with it.
    pub(super) fn medians(&self, rays: &[(Vector2<f64>, Vector2<f64>)]) -> [[f32; 3]; PLACES] {
        let mut values: [Vec<f32>; 3] = std::array::from_fn(|_| Vec::with_capacity(rays.len()));
        places().map(|across| {
            values.iter_mut().for_each(Vec::clear);
            for (pixel, unit) in rays {
                let colour = self.colour(&(pixel + unit * across));
                for (values, value) in values.iter_mut().zip(colour) {
                    values.push(value);
                }
            }
            std::array::from_fn(|c| {
                let middle = values[c].len() / 2;
                *values[c].select_nth_unstable_by(middle, f32::total_cmp).1
            })
        })
    }

    /// The colour at a point that the image [`holds`](Self::holds), by cubic convolution (Keys
    /// 1981): linear interpolation would blur.
    fn colour(&self, pixel: &Vector2<f64>) -> [f32; 3] {
        let place = pixel.add_scalar(-self.pixel_center);
        let (column, row) = (place.x.floor(), place.y.floor());
        let across = cubic_weights((place.x - column) as f32);
        let down = cubic_weights((place.y - row) as f32);
        let (width, values) = (self.image.width() as usize, self.image.as_raw());
        let mut colour = [0.0; 3];
        for (j, down) in down.into_iter().enumerate() {
            let first = (row as usize + j - 1) * width + column as usize - 1;
            for (i, across) in across.into_iter().enumerate() {
                for (c, sum) in colour.iter_mut().enumerate() {
                    *sum += down * across * f32::from(values[3 * (first + i) + c]);
                }
            }
        }
        colour
    }
}

/// Weights of the values at -1, 0, 1 and 2.
fn cubic_weights(at: f32) -> [f32; 4] {
    let (square, cube) = (at * at, at * at * at);
    [
        -0.5 * cube + square - 0.5 * at,
        1.5 * cube - 2.5 * square + 1.0,
        -1.5 * cube + 2.0 * square + 0.5 * at,
        0.5 * cube - 0.5 * square,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn colours_between_pixels_follow_a_slope() {
        let image = RgbImage::from_fn(12, 10, |x, y| Rgb([20 + 9 * x as u8, 30 + 4 * y as u8, 7]));
        let pixels = Pixels {
            image: &image,
            pixel_center: 0.5,
        };
        let pixel = Vector2::new(4.3, 5.9);
        assert!(pixels.holds(&pixel));
        let expected = [20.0 + 9.0 * 3.8, 30.0 + 4.0 * 5.4, 7.0];
        for (value, expected) in pixels.colour(&pixel).into_iter().zip(expected) {
            assert!((value - expected).abs() < 1e-4, "{value} {expected}");
        }
        assert!(!pixels.holds(&Vector2::new(1.4, 5.0)));
        assert!(!pixels.holds(&Vector2::new(5.0, 8.6)));
        assert!(!pixels.holds(&Vector2::new(f64::NAN, 5.0)));
    }
}
