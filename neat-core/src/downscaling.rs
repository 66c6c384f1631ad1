//! Downscaling: images of fewer pixels, and what is said in their coordinates.

use crate::Intrinsics;
use image::RgbImage;
use nalgebra::Vector2;
use rayon::prelude::*;

/// From an image to a smaller one of the same picture.
///
/// The corners of the two images are the same points, so that coordinates that
/// count from the corner are multiplied by the ratio of the sizes. The two axes
/// have ratios of their own, as the smaller size is rounded to whole pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Downscaling {
    from: (u32, u32),
    to: (u32, u32),
    /// Image coordinates of the centre of the first pixel, in both images.
    pixel_center: f64,
}

impl Downscaling {
    /// For an image of `size` (width, height) whose longer side is to have at
    /// most `max_image_size` pixels; `None` where it has not more, or where there
    /// are no pixels. Each side keeps at least one pixel.
    pub fn new(size: (u32, u32), max_image_size: u32, pixel_center: f64) -> Option<Self> {
        let longer = size.0.max(size.1);
        let scaled = |pixels: u32| {
            let (pixels, longer) = (u64::from(pixels), u64::from(longer));
            let rounded = (pixels * u64::from(max_image_size) + longer / 2) / longer;
            // At most `max_image_size`.
            rounded.max(1) as u32
        };
        let shrinks = longer > max_image_size.max(1) && size.0.min(size.1) > 0;
        shrinks.then(|| Self {
            from: size,
            to: (scaled(size.0), scaled(size.1)),
            pixel_center,
        })
    }

    /// Width and height of the smaller image.
    pub fn size(&self) -> (u32, u32) {
        self.to
    }

    /// Image coordinates in the larger image → in the smaller one.
    pub fn scale(&self, pixel: &Vector2<f64>) -> Vector2<f64> {
        let corner_to_center = 0.5 - self.pixel_center;
        let from_corner = pixel.add_scalar(corner_to_center);
        from_corner
            .component_mul(&self.ratio())
            .add_scalar(-corner_to_center)
    }

    /// The intrinsics of the larger image → of the smaller one.
    pub fn scale_intrinsics(&self, intrinsics: &Intrinsics) -> Intrinsics {
        let ratio = self.ratio();
        let principal_point = self.scale(&Vector2::new(intrinsics.cx, intrinsics.cy));
        Intrinsics {
            fx: intrinsics.fx * ratio.x,
            fy: intrinsics.fy * ratio.y,
            cx: principal_point.x,
            cy: principal_point.y,
            skew: intrinsics.skew * ratio.x,
        }
    }

    /// The smaller image: each of its pixels is the mean of the area that it
    /// covers in the larger one.
    ///
    /// # Panics
    /// If `image` has another size than this was made for.
    pub fn resample(&self, image: &RgbImage) -> RgbImage {
        assert_eq!(
            image.dimensions(),
            self.from,
            "Downscaling::resample: size of the image"
        );
        let columns = cover(self.from.0, self.to.0);
        let rows = cover(self.from.1, self.to.1);
        let row_bytes = 3 * self.from.0 as usize;
        let mut scaled = RgbImage::new(self.to.0, self.to.1);
        let out = scaled.par_chunks_exact_mut(3 * self.to.0 as usize);
        out.zip(rows).for_each(|(pixels, row)| {
            let source = &image.as_raw()[row.first * row_bytes..];
            let mut mean = vec![0.0; row_bytes];
            for (bytes, weight) in source.chunks_exact(row_bytes).zip(&row.weights) {
                for (sum, &byte) in mean.iter_mut().zip(bytes) {
                    *sum += weight * f32::from(byte);
                }
            }
            let (mean, _) = mean.as_chunks::<3>();
            let (pixels, _) = pixels.as_chunks_mut::<3>();
            for (rgb, column) in pixels.iter_mut().zip(&columns) {
                let mut sum = [0.5; 3];
                for (color, weight) in mean[column.first..].iter().zip(&column.weights) {
                    for (sum, value) in sum.iter_mut().zip(color) {
                        *sum += weight * value;
                    }
                }
                // A mean of bytes, rounded.
                *rgb = sum.map(|value: f32| value as u8);
            }
        });
        scaled
    }

    /// Smaller size by larger size, of each axis.
    fn ratio(&self) -> Vector2<f64> {
        Vector2::new(
            f64::from(self.to.0) / f64::from(self.from.0),
            f64::from(self.to.1) / f64::from(self.from.1),
        )
    }
}

/// The pixels of the larger image that one of the smaller covers along an axis.
struct Cover {
    first: usize,
    /// Of the first and those after it; they sum to one.
    weights: Vec<f32>,
}

/// The cover of each of `to` pixels by `from` pixels. In units of 1/`to` of a
/// larger pixel all borders are whole numbers.
fn cover(from: u32, to: u32) -> Vec<Cover> {
    let (from, to) = (u64::from(from), u64::from(to));
    let cover_of = |pixel: u64| {
        let (start, end) = (pixel * from, (pixel + 1) * from);
        let covered = start / to..end.div_ceil(to);
        let weight = |source: u64| {
            let overlap = end.min((source + 1) * to) - start.max(source * to);
            overlap as f32 / from as f32
        };
        Cover {
            first: covered.start as usize,
            weights: covered.map(weight).collect(),
        }
    };
    (0..to).map(cover_of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;
    use proptest::prelude::*;

    #[test]
    fn the_longer_side_decides_and_nothing_is_enlarged() {
        let size = |size, max| Downscaling::new(size, max, 0.5).map(|scaling| scaling.size());
        assert_eq!(size((3072, 2048), 1600), Some((1600, 1067)));
        assert_eq!(size((2048, 3072), 1600), Some((1067, 1600)));
        assert_eq!(size((800, 600), 800), None);
        assert_eq!(size((800, 600), 10_000), None);
        assert_eq!(size((10_000, 3), 100), Some((100, 1)));
        assert_eq!(size((7, 5), 0), Some((1, 1)));
        assert_eq!(size((1, 1), 0), None);
        assert_eq!(size((0, 9), 3), None);
        assert_eq!(size((u32::MAX, 1), u32::MAX - 1), Some((u32::MAX - 1, 1)));
    }

    #[test]
    fn pixels_are_means_of_what_they_cover() {
        // Halves: each pixel is the mean of four.
        let picture = RgbImage::from_fn(4, 2, |x, y| Rgb([(x * 10 + y * 100) as u8, 0, 255]));
        let halved = Downscaling::new((4, 2), 2, 0.5).unwrap().resample(&picture);
        assert_eq!(halved.dimensions(), (2, 1));
        assert_eq!(halved.into_raw(), [55, 0, 255, 75, 0, 255]);
        // Three pixels to two: thirds of a pixel are shared.
        let row = RgbImage::from_fn(3, 1, |x, _| Rgb([[30, 60, 240][x as usize]; 3]));
        let two = Downscaling::new((3, 1), 2, 0.5).unwrap().resample(&row);
        assert_eq!(two.into_raw(), [40, 40, 40, 180, 180, 180]);
    }

    proptest! {
        #[test]
        fn a_ramp_stays_where_the_coordinates_say(
            width in 20u32..60, height in 20u32..60, max in 5u32..30, half: bool,
        ) {
            let pixel_center = if half { 0.5 } else { 0.0 };
            let Some(scaling) = Downscaling::new((width, height), max, pixel_center) else {
                return Ok(());
            };
            let ramp = RgbImage::from_fn(width, height, |x, y| Rgb([(4 * x) as u8, (4 * y) as u8, 99]));
            let scaled = scaling.resample(&ramp);
            let mut sum = Vector2::zeros();
            for (x, y, rgb) in scaled.enumerate_pixels() {
                // Where the pixel's centre is in the larger image.
                let center = Vector2::new(f64::from(x), f64::from(y)).add_scalar(pixel_center);
                let at = |a: f64, b: f64| {
                    scaling.scale(&Vector2::new(a, b).add_scalar(pixel_center)) - center
                };
                let source = [f64::from(rgb[0]) / 4.0, f64::from(rgb[1]) / 4.0];
                // Colours are rounded to a quarter of a pixel's step, and a pixel
                // that is partly covered counts with the colour of its middle.
                let off = at(source[0], source[1]);
                prop_assert!(off.amax() < 0.25);
                sum += off;
                prop_assert_eq!(rgb[2], 99);
            }
            // Only rounding can be on one side more than on the other: half a level
            // of four per pixel. Half a pixel at the wrong place would be more.
            let pixels = f64::from(scaled.width() * scaled.height());
            prop_assert!((sum / pixels).amax() < 0.1, "{}", sum / pixels);
        }

        #[test]
        fn scaled_intrinsics_project_to_scaled_points(
            fx in 100.0..900.0, fy in 100.0..900.0, cx in 0.0..640.0, cy in 0.0..480.0,
            skew in -3.0..3.0, x in -1.0..1.0, y in -1.0..1.0, half: bool, max in 3u32..600,
        ) {
            let pixel_center = if half { 0.5 } else { 0.0 };
            let scaling = Downscaling::new((640, 480), max, pixel_center).unwrap();
            let intrinsics = Intrinsics { fx, fy, cx, cy, skew };
            let calibrated = Vector2::new(x, y);
            let direct = scaling.scale_intrinsics(&intrinsics).decalibrate(&calibrated);
            let scaled = scaling.scale(&intrinsics.decalibrate(&calibrated));
            prop_assert!((direct - scaled).norm() < 1e-9);
            // The corners of the images are the same.
            let corner = Vector2::repeat(pixel_center - 0.5);
            prop_assert!((scaling.scale(&corner) - corner).norm() < 1e-12);
        }
    }
}
