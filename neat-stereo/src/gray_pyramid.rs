//! Brightness of a photograph at halved and halved again resolution.

use image::RgbImage;
use std::ops::RangeInclusive;

/// One step of an eight-bit image: means of several pixels need finer ones.
pub(crate) const STEP: f32 = 192.0;

/// Brightness in [`STEP`]ths of a step, row by row.
#[derive(Clone, Debug)]
pub(crate) struct GrayImage {
    pub width: usize,
    pub height: usize,
    pub values: Vec<u16>,
}

impl GrayImage {
    fn of(photo: &RgbImage) -> Self {
        let brightness = |rgb: &[u8]| {
            let sum: u16 = rgb.iter().map(|&c| u16::from(c)).sum();
            sum * (STEP as u16 / 3)
        };
        Self {
            width: photo.width() as usize,
            height: photo.height() as usize,
            values: photo.as_raw().chunks_exact(3).map(brightness).collect(),
        }
    }

    /// Means of squares of two by two pixels; `None` where nothing would be left.
    fn halved(&self) -> Option<Self> {
        let (width, height) = (self.width / 2, self.height / 2);
        let at = |x: usize, y: usize| u32::from(self.values[y * self.width + x]);
        let mean = |x: usize, y: usize| {
            let sum = at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1);
            ((sum + 2) / 4) as u16
        };
        (width > 0 && height > 0).then(|| Self {
            width,
            height,
            values: (0..height)
                .flat_map(|y| (0..width).map(move |x| mean(2 * x, 2 * y)))
                .collect(),
        })
    }

    /// The value at a point within the image, linear between pixels.
    #[inline]
    pub fn sample(&self, x: f32, y: f32) -> f32 {
        let (column, row) = (x as usize, y as usize);
        let (s, t) = (x - column as f32, y - row as f32);
        let start = row * self.width + column;
        let pair = |start: usize| {
            let pair = &self.values[start..start + 2];
            let [left, right] = [pair[0], pair[1]].map(f32::from);
            left + s * (right - left)
        };
        let (above, below) = (pair(start), pair(start + self.width));
        above + t * (below - above)
    }
}

/// The image at `levels`, as far as it can be halved; level 0 is the image itself.
pub(crate) fn pyramid(photo: &RgbImage, levels: RangeInclusive<usize>) -> Vec<GrayImage> {
    let (first, count) = (*levels.start(), levels.count());
    let next = |image: &GrayImage| image.halved();
    let all = std::iter::successors(Some(GrayImage::of(photo)), next);
    all.skip(first).take(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn levels_halve_and_samples_lie_between_pixels() {
        let photo = RgbImage::from_fn(5, 4, |x, y| Rgb([(10 * x + 40 * y) as u8; 3]));
        let levels = pyramid(&photo, 0..=9);
        let sizes: Vec<_> = levels.iter().map(|l| (l.width, l.height)).collect();
        assert_eq!(sizes, [(5, 4), (2, 2), (1, 1)]);
        assert_eq!(pyramid(&photo, 1..=1)[0].values, levels[1].values);
        assert_eq!(levels[1].values, [25, 45, 105, 125].map(|v| 192 * v));
        assert_eq!(levels[0].sample(1.5, 2.25), 105.0 * STEP);
    }
}
