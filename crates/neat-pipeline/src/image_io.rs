//! Rendered views as images on disk, and how near they are to the photograph.

use image::{Rgb, RgbImage};
pub use neat_core::file::write_png;

/// Colours from 0 to 1, row by row, as an image.
pub fn color_image(width: u32, height: u32, colors: &[[f32; 3]]) -> RgbImage {
    image_of(width, height, |i| colors[i])
}

/// Depths, row by row, as grey levels: white is near, and black is far or none.
///
/// Depths that are not finite, or less than half of the median of the positive
/// ones, are none: a ray that only grazes something has little weight, and with
/// it a depth in front of everything. For the same reason the nearest tenth does
/// not count for the range.
pub fn depth_image(width: u32, height: u32, depths: &[f32]) -> RgbImage {
    let is_positive = |depth: &f32| *depth > 0.0 && depth.is_finite();
    let mut sorted: Vec<f32> = depths.iter().copied().filter(is_positive).collect();
    sorted.sort_by(f32::total_cmp);
    let least = sorted
        .get(sorted.len() / 2)
        .map_or(0.0, |median| median / 2.0);
    sorted.retain(|depth| *depth >= least);
    let (near, far) = match (sorted.get(sorted.len() / 10), sorted.last()) {
        (Some(near), Some(far)) => (*near, *far),
        _ => (0.0, 0.0),
    };
    // All at one depth: all white.
    let range = if far > near {
        far - near
    } else {
        f32::INFINITY
    };
    image_of(width, height, |i| {
        let depth = depths[i];
        [if is_positive(&depth) && depth >= least {
            1.0 - (depth - near) / range
        } else {
            0.0
        }; 3]
    })
}

/// Normals, row by row, with x, y and z from −1 to 1 as red, green and blue from
/// 0 to 1.
pub fn normal_image(width: u32, height: u32, normals: &[[f32; 3]]) -> RgbImage {
    image_of(width, height, |i| normals[i].map(|x| (x + 1.0) / 2.0))
}

fn image_of(width: u32, height: u32, color: impl Fn(usize) -> [f32; 3]) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let index = y as usize * width as usize + x as usize;
        Rgb(color(index).map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8))
    })
}

/// Every `step`-th pixel of a photograph along both axes, beginning with the
/// first one: those that [`crate::render::render_view`] renders.
pub fn every_nth_pixel(photo: &RgbImage, step: u32) -> RgbImage {
    let step = step.max(1);
    let (width, height) = (photo.width().div_ceil(step), photo.height().div_ceil(step));
    RgbImage::from_fn(width, height, |x, y| *photo.get_pixel(x * step, y * step))
}

/// Peak signal-to-noise ratio of colours from 0 to 1 against a photograph, in
/// decibels; infinite if they are equal. `None` if there is not one colour per
/// pixel, or no pixel.
pub fn psnr(colors: &[[f32; 3]], photo: &RgbImage) -> Option<f64> {
    let pixels = photo.pixels();
    if colors.is_empty() || colors.len() != pixels.len() {
        return None;
    }
    let squared_error: f64 = colors
        .iter()
        .zip(pixels)
        .flat_map(|(color, pixel)| color.iter().zip(pixel.0))
        .map(|(c, p)| (f64::from(c.clamp(0.0, 1.0)) - f64::from(p) / 255.0).powi(2))
        .sum();
    Some(-10.0 * (squared_error / (3 * colors.len()) as f64).log10())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn psnr_of_a_known_error() {
        let photo = RgbImage::from_pixel(4, 2, Rgb([51, 102, 153]));
        let shifted = vec![[0.3, 0.5, 0.7]; 8];
        assert!((psnr(&shifted, &photo).unwrap() - 20.0).abs() < 1e-5);
        let black = RgbImage::new(2, 1);
        assert_eq!(psnr(&[[0.0; 3]; 2], &black), Some(f64::INFINITY));
        assert_eq!(psnr(&shifted[1..], &photo), None);
    }

    #[test]
    fn every_nth_pixel_begins_with_the_first() {
        let photo = RgbImage::from_fn(5, 4, |x, y| Rgb([x as u8, y as u8, 7]));
        let third = every_nth_pixel(&photo, 3);
        assert_eq!(third.dimensions(), (2, 2));
        assert_eq!(third.get_pixel(0, 0).0, [0, 0, 7]);
        assert_eq!(third.get_pixel(1, 1).0, [3, 3, 7]);
        assert_eq!(every_nth_pixel(&photo, 1), photo);
    }

    #[test]
    fn depths_are_bright_where_near() {
        let depths = [2.0, 3.0, 4.0, 0.0, f32::INFINITY, f32::NAN, 0.5, -1.0];
        let image = depth_image(4, 2, &depths);
        let levels: Vec<u8> = image.pixels().map(|p| p.0[0]).collect();
        assert_eq!(levels, [255, 128, 0, 0, 0, 0, 0, 0]);
        let flat = depth_image(2, 1, &[2.0, 2.0]);
        assert!(flat.pixels().all(|p| p.0 == [255; 3]));
        let nothing = depth_image(2, 1, &[0.0, f32::NAN]);
        assert!(nothing.pixels().all(|p| p.0 == [0; 3]));
    }

    #[test]
    fn a_png_reads_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let image = normal_image(2, 1, &[[0.0, 1.0, -1.0], [1.0, 0.0, 0.0]]);
        write_png(&path, &image).unwrap();
        assert_eq!(image::open(&path).unwrap().into_rgb8(), image);
        assert_eq!(image.get_pixel(0, 0).0, [128, 255, 0]);
    }
}
