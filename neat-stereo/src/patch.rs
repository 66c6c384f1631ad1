//! How alike a patch of one image is to what other images show, if it lies in a plane.

use crate::gray_pyramid::{GrayImage, STEP};
use nalgebra::Matrix3;

/// Pixels from the middle of a patch to its border.
const HALF: usize = 3;
const SIDE: usize = 2 * HALF + 1;
/// Pixels of a patch.
const PIXELS: usize = SIDE * SIDE;

/// A patch around a pixel, without its mean, of length 1.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    values: [f32; PIXELS],
}

impl Patch {
    /// Around pixel (`x`, `y`); `None` at the border, and where the contrast is
    /// less than an eight-bit image can tell.
    pub fn around(image: &GrayImage, x: usize, y: usize) -> Option<Self> {
        /// Twelve times the variance of rounding.
        const MIN_VARIANCE: f32 = STEP * STEP;
        let inside = |at: usize, size: usize| at >= HALF && at + HALF < size;
        if !inside(x, image.width) || !inside(y, image.height) {
            return None;
        }
        let mut values = [0.0; PIXELS];
        for (row, line) in values.chunks_exact_mut(SIDE).enumerate() {
            let start = (y + row - HALF) * image.width + x - HALF;
            let pixels = &image.values[start..start + SIDE];
            for (value, &pixel) in line.iter_mut().zip(pixels) {
                *value = f32::from(pixel);
            }
        }
        let mean = values.iter().sum::<f32>() / PIXELS as f32;
        values.iter_mut().for_each(|value| *value -= mean);
        let squares = values.iter().map(|value| value * value).sum::<f32>();
        (squares > PIXELS as f32 * MIN_VARIANCE).then(|| {
            let scale = 1.0 / squares.sqrt();
            Self {
                values: values.map(|value| value * scale),
            }
        })
    }

    /// Normalised cross-correlation with what `image` shows where `homography` leads from
    /// the pixels around (`x`, `y`); `None` where that leaves the image or is behind it.
    pub fn correlation(
        &self,
        image: &GrayImage,
        homography: &Matrix3<f32>,
        [x, y]: [f32; 2],
    ) -> Option<f32> {
        let h = homography;
        let w = h[(2, 0)] * x + h[(2, 1)] * y + h[(2, 2)];
        if w <= 0.0 {
            return None;
        }
        let scale = 1.0 / w;
        let u = (h[(0, 0)] * x + h[(0, 1)] * y + h[(0, 2)]) * scale;
        let v = (h[(1, 0)] * x + h[(1, 1)] * y + h[(1, 2)]) * scale;
        // Over a patch a homography is affine.
        let [ux, uy] = [0, 1].map(|i| (h[(0, i)] - u * h[(2, i)]) * scale);
        let [vx, vy] = [0, 1].map(|i| (h[(1, i)] - v * h[(2, i)]) * scale);
        let half = HALF as f32;
        let (reach_u, reach_v) = (half * (ux.abs() + uy.abs()), half * (vx.abs() + vy.abs()));
        let within = |at: f32, reach: f32, size: usize| {
            // a pixel from the border, as sums round
            at - reach >= 1.0 && at + reach + 2.0 < size as f32
        };
        if !within(u, reach_u, image.width) || !within(v, reach_v, image.height) {
            return None;
        }
        let (mut sum, mut squares, mut product) = (0.0f32, 0.0f32, 0.0f32);
        for row in 0..SIDE {
            let dy = row as f32 - half;
            let (u, v) = (u + uy * dy, v + vy * dy);
            for column in 0..SIDE {
                let dx = column as f32 - half;
                let value = image.sample(u + ux * dx, v + vx * dx);
                sum += value;
                squares += value * value;
                product += value * self.values[row * SIDE + column];
            }
        }
        let variance = squares - sum * sum / PIXELS as f32;
        Some(if variance > 0.0 {
            product / variance.sqrt()
        } else {
            0.0
        })
    }
}
