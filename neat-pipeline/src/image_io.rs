//! Rendered views beside photographs on disk. What makes images of colours,
//! depths and normals, and the PSNR, is in `neat-eval`.

use image::RgbImage;
pub use neat_core::file::write_png;

/// Every `step`-th pixel of a photograph along both axes, beginning with the
/// first one: those that [`crate::render::render_view`] renders.
pub fn every_nth_pixel(photo: &RgbImage, step: u32) -> RgbImage {
    let step = step.max(1);
    let (width, height) = (photo.width().div_ceil(step), photo.height().div_ceil(step));
    RgbImage::from_fn(width, height, |x, y| *photo.get_pixel(x * step, y * step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn every_nth_pixel_begins_with_the_first() {
        let photo = RgbImage::from_fn(5, 4, |x, y| Rgb([x as u8, y as u8, 7]));
        let third = every_nth_pixel(&photo, 3);
        assert_eq!(third.dimensions(), (2, 2));
        assert_eq!(third.get_pixel(0, 0).0, [0, 0, 7]);
        assert_eq!(third.get_pixel(1, 1).0, [3, 3, 7]);
        assert_eq!(every_nth_pixel(&photo, 1), photo);
    }
}
