//! Brightness images at the resolution that the examination works in.

use image::RgbImage;

/// Longer sides are halved, thirded, … until they fit: beyond this, corners cost
/// time and say nothing more about poses.
const MAX_SIDE: u32 = 1024;

/// Brightness in [0, 1], row by row.
#[derive(Clone, Debug)]
pub(crate) struct GrayImage {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

impl GrayImage {
    /// The brightness of a photograph, averaged over squares of `factor` pixels,
    /// with that factor.
    pub fn working_copy(photo: &RgbImage) -> (Self, u32) {
        let factor = photo.width().max(photo.height()).div_ceil(MAX_SIDE).max(1);
        let width = (photo.width() / factor).max(1) as usize;
        let height = (photo.height() / factor).max(1) as usize;
        let mut values = vec![0.0f32; width * height];
        let factor_pixels = factor as usize;
        let stride = 3 * photo.width() as usize;
        let scale = 1.0 / (3.0 * 255.0 * (factor * factor) as f32);
        for (y, row) in values.chunks_exact_mut(width).enumerate() {
            for inner in 0..factor_pixels {
                let start = (y * factor_pixels + inner) * stride;
                let Some(source) = photo.as_raw().get(start..start + stride) else {
                    continue;
                };
                for (value, square) in row.iter_mut().zip(source.chunks_exact(3 * factor_pixels)) {
                    *value += square.iter().map(|&x| f32::from(x)).sum::<f32>() * scale;
                }
            }
        }
        let image = Self {
            width,
            height,
            values,
        };
        (image, factor)
    }

    /// An image of the same size.
    pub fn with_values(&self, values: Vec<f32>) -> Self {
        let (width, height) = (self.width, self.height);
        Self {
            width,
            height,
            values,
        }
    }

    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// The value at a point, clamped to the border, linear in between.
    pub fn sample(&self, x: f32, y: f32) -> f32 {
        let x = x.clamp(0.0, (self.width - 1) as f32);
        let y = y.clamp(0.0, (self.height - 1) as f32);
        let (column, row) = (x as usize, y as usize);
        let (next_column, next_row) = (
            (column + 1).min(self.width - 1),
            (row + 1).min(self.height - 1),
        );
        let (u, v) = (x - column as f32, y - row as f32);
        let upper = self.at(column, row) * (1.0 - u) + self.at(next_column, row) * u;
        let lower = self.at(column, next_row) * (1.0 - u) + self.at(next_column, next_row) * u;
        upper * (1.0 - v) + lower * v
    }

    /// Blurred by the binomial filter `passes` times: a standard deviation of
    /// √(passes / 2) pixels.
    pub fn blurred(&self, passes: usize) -> Self {
        let mut image = self.clone();
        let (width, height) = (self.width, self.height);
        let mut other = vec![0.0; width * height];
        for _ in 0..passes {
            for (from, to) in image
                .values
                .chunks_exact(width)
                .zip(other.chunks_exact_mut(width))
            {
                for x in 0..width {
                    let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
                    to[x] = 0.25 * (from[left] + from[right]) + 0.5 * from[x];
                }
            }
            for y in 0..height {
                let above = y.saturating_sub(1) * width;
                let below = (y + 1).min(height - 1) * width;
                for x in 0..width {
                    image.values[y * width + x] =
                        0.25 * (other[above + x] + other[below + x]) + 0.5 * other[y * width + x];
                }
            }
        }
        image
    }

    /// Scaled down by `scale` > 1.
    pub fn shrunk(&self, scale: f32) -> Self {
        let width = ((self.width as f32 / scale) as usize).max(1);
        let height = ((self.height as f32 / scale) as usize).max(1);
        let smooth = self.blurred(1);
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                // Pixel centres onto pixel centres.
                let source = |i: usize| (i as f32 + 0.5) * scale - 0.5;
                values.push(smooth.sample(source(x), source(y)));
            }
        }
        Self {
            width,
            height,
            values,
        }
    }

    /// Derivatives along x and y by central differences; zero on the border.
    pub fn gradients(&self) -> [Self; 2] {
        let mut along_x = vec![0.0; self.values.len()];
        let mut along_y = vec![0.0; self.values.len()];
        for y in 1..self.height.saturating_sub(1) {
            for x in 1..self.width.saturating_sub(1) {
                let index = y * self.width + x;
                along_x[index] = 0.5 * (self.values[index + 1] - self.values[index - 1]);
                along_y[index] =
                    0.5 * (self.values[index + self.width] - self.values[index - self.width]);
            }
        }
        [along_x, along_y].map(|values| self.with_values(values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_photographs_are_averaged_over_squares() {
        let photo = RgbImage::from_fn(2000, 10, |x, _| image::Rgb([(x % 2) as u8 * 255; 3]));
        let (gray, factor) = GrayImage::working_copy(&photo);
        assert_eq!((gray.width, gray.height, factor), (1000, 5, 2));
        assert!(gray.values.iter().all(|value| (value - 0.5).abs() < 1e-5));
    }

    #[test]
    fn a_ramp_keeps_its_slope_and_place_when_shrunk() {
        let ramp = GrayImage {
            width: 60,
            height: 4,
            values: (0..240).map(|i| (i % 60) as f32).collect(),
        };
        let shrunk = ramp.shrunk(1.5);
        assert!((shrunk.at(10, 1) - ((10.0 + 0.5) * 1.5 - 0.5)).abs() < 1e-4);
        let [along_x, along_y] = ramp.gradients();
        assert_eq!((along_x.at(7, 2), along_y.at(7, 2)), (1.0, 0.0));
    }
}
