//! Brightness of a photograph at halved and halved again resolution.

use image::RgbImage;

/// Brightness, 0 to 255, row by row.
#[derive(Clone, Debug)]
pub(crate) struct GrayImage {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

impl GrayImage {
    pub fn of(photo: &RgbImage) -> Self {
        let brightness = |rgb: &[u8]| rgb.iter().map(|&c| f32::from(c)).sum::<f32>() / 3.0;
        Self {
            width: photo.width() as usize,
            height: photo.height() as usize,
            values: photo.as_raw().chunks_exact(3).map(brightness).collect(),
        }
    }

    /// Means of squares of two by two pixels; `None` where nothing would be left.
    pub fn halved(&self) -> Option<Self> {
        let (width, height) = (self.width / 2, self.height / 2);
        let at = |x: usize, y: usize| self.values[y * self.width + x];
        let mean =
            |x: usize, y: usize| 0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1));
        (width > 0 && height > 0).then(|| Self {
            width,
            height,
            values: (0..height)
                .flat_map(|y| (0..width).map(move |x| mean(2 * x, 2 * y)))
                .collect(),
        })
    }
}

/// Level 0 is the image, each further one half as wide.
pub(crate) fn pyramid(photo: &RgbImage, levels: usize) -> Vec<GrayImage> {
    let first = GrayImage::of(photo);
    let next = |image: &GrayImage| image.halved();
    std::iter::successors(Some(first), next)
        .take(levels)
        .collect()
}
