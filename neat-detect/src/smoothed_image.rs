//! Colour images as smoothed planes of floats that can be sampled anywhere.

use image::RgbImage;
use nalgebra::{Vector2, Vector3};

/// An image after a Gaussian filter, in grey levels from 0 to 255. The centre of
/// the first pixel is (0, 0).
pub(crate) struct SmoothedImage {
    width: usize,
    height: usize,
    /// Red, green, blue, and a zero that makes a pixel one vector register.
    pixels: Vec<[f32; 4]>,
}

impl SmoothedImage {
    /// Smooths `image` by a Gaussian of standard deviation `sigma` in pixels;
    /// beyond the border the nearest pixel counts.
    pub(crate) fn new(image: &RgbImage, sigma: f64) -> Self {
        let (width, height) = (image.width() as usize, image.height() as usize);
        let kernel = gaussian_kernel(sigma);
        let mut pixels = vec![[0.0; 4]; width * height];
        for channel in 0..3 {
            let values = image.as_raw().iter().skip(channel).step_by(3);
            let plane: Vec<f32> = values.map(|&value| f32::from(value)).collect();
            let smoothed = smooth(&plane, width, height, &kernel);
            for (pixel, value) in pixels.iter_mut().zip(smoothed) {
                pixel[channel] = value;
            }
        }
        Self {
            width,
            height,
            pixels,
        }
    }

    /// Width and height in pixels.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Whether the cubic interpolation at `point` needs no pixel beyond the border.
    pub(crate) fn contains(&self, point: &Vector2<f64>) -> bool {
        point.x >= 1.0
            && point.y >= 1.0
            && point.x < self.width as f64 - 2.0
            && point.y < self.height as f64 - 2.0
    }

    /// The colour at `point` by cubic (Catmull-Rom) interpolation, which unlike
    /// the linear one does not draw the maxima of gradients towards pixel centres.
    ///
    /// `point` must be one that [`Self::contains`].
    pub(crate) fn sample(&self, point: &Vector2<f64>) -> Vector3<f32> {
        let (column, row) = (point.x as usize, point.y as usize);
        let x_weights = catmull_rom((point.x - column as f64) as f32);
        let y_weights = catmull_rom((point.y - row as f64) as f32);
        let first = (row - 1) * self.width + column - 1;
        let mut sum = [0.0; 4];
        for (i, y_weight) in y_weights.iter().enumerate() {
            let taps = &self.pixels[first + i * self.width..][..4];
            for (tap, x_weight) in taps.iter().zip(&x_weights) {
                let weight = x_weight * y_weight;
                for channel in 0..4 {
                    sum[channel] += tap[channel] * weight;
                }
            }
        }
        Vector3::new(sum[0], sum[1], sum[2])
    }

    /// Change of each channel per pixel to the right and downwards at an inner pixel, by
    /// central differences.
    pub(crate) fn differences(&self, column: usize, row: usize) -> [[f32; 2]; 3] {
        let at = row * self.width + column;
        let change = |next: usize, last: usize, channel: usize| {
            0.5 * (self.pixels[next][channel] - self.pixels[last][channel])
        };
        std::array::from_fn(|channel| {
            [
                change(at + 1, at - 1, channel),
                change(at + self.width, at - self.width, channel),
            ]
        })
    }

    /// The components of all colours along a direction of the colour space, in
    /// row order.
    pub(crate) fn projected(&self, direction: &Vector3<f32>) -> Vec<f64> {
        (self.pixels.iter())
            .map(|[r, g, b, _]| f64::from(direction.x * r + direction.y * g + direction.z * b))
            .collect()
    }

    /// The median over a grid of pixels of the change of colour to the next pixel
    /// to the right and below, root mean square over the channels.
    pub(crate) fn median_gradient(&self) -> f64 {
        const STEP: usize = 4;
        let mut gradients: Vec<f32> = Vec::new();
        for row in (0..self.height.saturating_sub(1)).step_by(STEP) {
            for column in (0..self.width.saturating_sub(1)).step_by(STEP) {
                let at = row * self.width + column;
                let squares = (0..3).map(|channel| {
                    let change =
                        |other: usize| self.pixels[other][channel] - self.pixels[at][channel];
                    change(at + 1).powi(2) + change(at + self.width).powi(2)
                });
                gradients.push((squares.sum::<f32>() / 3.0).sqrt());
            }
        }
        let middle = gradients.len() / 2;
        if gradients.is_empty() {
            return 0.0;
        }
        f64::from(*gradients.select_nth_unstable_by(middle, f32::total_cmp).1)
    }
}

/// Weights of a Gaussian cut off at three standard deviations; their sum is 1.
fn gaussian_kernel(sigma: f64) -> Vec<f32> {
    let radius = (3.0 * sigma).ceil() as i32;
    let weights: Vec<f64> = (-radius..=radius)
        .map(|i| (-0.5 * (f64::from(i) / sigma.max(1e-6)).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|weight| (weight / sum) as f32).collect()
}

/// Filters a plane by `kernel` along both axes.
fn smooth(plane: &[f32], width: usize, height: usize, kernel: &[f32]) -> Vec<f32> {
    let radius = kernel.len() / 2;
    let mut along_rows = vec![0.0; plane.len()];
    let mut padded = vec![0.0; width + 2 * radius];
    for (row, out) in (plane.chunks_exact(width)).zip(along_rows.chunks_exact_mut(width)) {
        padded[..radius].fill(row[0]);
        padded[radius..radius + width].copy_from_slice(row);
        padded[radius + width..].fill(row[width - 1]);
        for (tap, weight) in kernel.iter().enumerate() {
            for (value, input) in out.iter_mut().zip(&padded[tap..]) {
                *value += input * weight;
            }
        }
    }
    let mut smoothed = vec![0.0; plane.len()];
    for (row, out) in smoothed.chunks_exact_mut(width).enumerate() {
        for (tap, weight) in kernel.iter().enumerate() {
            let source = (row + tap).saturating_sub(radius).min(height - 1);
            let input = &along_rows[source * width..][..width];
            for (value, input) in out.iter_mut().zip(input) {
                *value += input * weight;
            }
        }
    }
    smoothed
}

/// Weights of the four nearest samples at the fraction `t` between the middle two.
fn catmull_rom(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t + 2.0 * t2 - t3),
        0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
        0.5 * (t + 4.0 * t2 - 3.0 * t3),
        0.5 * (t3 - t2),
    ]
}
