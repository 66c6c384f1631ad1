//! How near a rendered view is to its photograph: PSNR, and the mask ratio of the
//! paper's Table 3 and Figure 6.

use image::RgbImage;

/// Peak signal-to-noise ratio of colours from 0 to 1 against a photograph, in
/// decibels; infinite if they are equal.
///
/// With a `mask` only the pixels count where it is true: those inside of an
/// object, or those that were rays of the training. `None` if there is not one
/// colour and one mask value per pixel, or no pixel counts.
///
/// # Example
/// ```
/// use image::{Rgb, RgbImage};
/// use neat_eval::image_quality::psnr;
///
/// let photo = RgbImage::from_pixel(2, 1, Rgb([51, 102, 153])); // 0.2, 0.4, 0.6
/// let colors = [[0.3, 0.5, 0.7], [0.2, 0.4, 0.6]];
/// // A mean squared error of 0.005, or on the first pixel alone of 0.01.
/// assert!((psnr(&colors, &photo, None).unwrap() - 23.0103).abs() < 1e-4);
/// assert!((psnr(&colors, &photo, Some(&[true, false])).unwrap() - 20.0).abs() < 1e-4);
/// ```
pub fn psnr(colors: &[[f32; 3]], photo: &RgbImage, mask: Option<&[bool]>) -> Option<f64> {
    let pixels = photo.pixels();
    if colors.len() != pixels.len() || mask.is_some_and(|mask| mask.len() != colors.len()) {
        return None;
    }
    let (squared_error, counted) = colors
        .iter()
        .zip(pixels)
        .enumerate()
        .filter(|(index, _)| mask.is_none_or(|mask| mask[*index]))
        .map(|(_, (color, pixel))| {
            let channels = color.iter().zip(pixel.0);
            channels
                .map(|(c, p)| (f64::from(c.clamp(0.0, 1.0)) - f64::from(p) / 255.0).powi(2))
                .sum::<f64>()
        })
        .fold((0.0, 0_usize), |(sum, count), error| {
            (sum + error, count + 1)
        });
    (counted > 0).then(|| -10.0 * (squared_error / (3 * counted) as f64).log10())
}

/// Share of the pixels that are masked out, "MR" of the paper.
///
/// The caption of Figure 6 calls it the share of foreground pixels, but the
/// figures of Table 3 fall as attraction regions widen: it is the other share.
/// `None` without pixels.
pub fn mask_ratio(foreground: &[bool]) -> Option<f64> {
    let out = foreground.iter().filter(|is_in| !**is_in).count();
    (!foreground.is_empty()).then(|| out as f64 / foreground.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn psnr_of_a_known_error() {
        let photo = RgbImage::from_pixel(4, 2, Rgb([51, 102, 153]));
        let shifted = vec![[0.3, 0.5, 0.7]; 8];
        assert!((psnr(&shifted, &photo, None).unwrap() - 20.0).abs() < 1e-5);
        let black = RgbImage::new(2, 1);
        assert_eq!(psnr(&[[0.0; 3]; 2], &black, None), Some(f64::INFINITY));
    }

    #[test]
    fn what_does_not_fit_has_no_value() {
        let photo = RgbImage::new(2, 1);
        assert_eq!(psnr(&[[0.0; 3]], &photo, None), None);
        assert_eq!(psnr(&[[0.0; 3]; 2], &photo, Some(&[true])), None);
        assert_eq!(psnr(&[[0.0; 3]; 2], &photo, Some(&[false; 2])), None);
        assert_eq!(psnr(&[], &RgbImage::new(0, 0), None), None);
    }

    #[test]
    fn the_mask_ratio_is_the_share_left_out() {
        assert_eq!(mask_ratio(&[true, false, false, false]), Some(0.75));
        assert_eq!(mask_ratio(&[]), None);
    }
}
