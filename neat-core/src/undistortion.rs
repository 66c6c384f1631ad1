//! Undistortion: from a photograph taken through a lens to the image that a
//! pinhole camera at the same place would have taken.

use crate::{CameraError, Distortion, Intrinsics, ViewError};
use image::RgbImage;
use nalgebra::Vector2;
use rayon::prelude::*;

/// The pinhole camera that a lens is replaced by, and the way between the two
/// images. Both have the same size.
///
/// The pinhole's principal point is that of the lens, and its focal lengths and
/// skew are those of the lens times one factor: the smallest that leaves no pixel
/// of the image outside the photograph (COLMAP's `blank_pixels = 0`), but not below a half:
/// the view of a fisheye lens is cut where its middle would have to shrink more.
///
/// # Example
/// ```
/// use image::RgbImage;
/// use neat_core::{Distortion, Intrinsics, Undistortion};
/// let intrinsics = Intrinsics { fx: 90.0, fy: 90.0, cx: 60.0, cy: 40.0, skew: 0.0 };
/// let barrel = Distortion::Brown { radial: [-0.2, 0.0, 0.0, 0.0, 0.0, 0.0], tangential: [0.0; 2] };
/// let undistortion = Undistortion::new(&intrinsics, &barrel, (120, 80), 0.5)?;
/// let image = undistortion.resample(&RgbImage::new(120, 80));
/// assert_eq!(image.dimensions(), (120, 80));
/// // The pinhole sees less than the photograph shows at the corners, and all at
/// // the middle of its longer sides.
/// assert!(undistortion.pinhole().fx < 90.0);
/// # Ok::<(), neat_core::ViewError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Undistortion {
    lens: Intrinsics,
    distortion: Distortion,
    pinhole: Intrinsics,
    size: (u32, u32),
    pixel_center: f64,
}

/// The least and the greatest factor between the focal lengths of the two
/// cameras. Nothing that is a photograph needs the greatest.
const FOCAL_FACTORS: (f64, f64) = (0.5, 4.0);
/// Halvings of the interval between them: to less than 1e-12.
const BISECTIONS: usize = 42;
/// Points along each border of the pinhole's image whose place in the photograph
/// is looked up. Between two of them the border bends by 1/64² of what it bends
/// in all: no lens moves it by a hundredth of a pixel there.
const BORDER_SAMPLES: u32 = 64;
/// Distances between nodes in a row, from the cheapest.
const NODE_SPACINGS: [u32; 4] = [16, 8, 4, 2];
/// In pixels: what interpolation between nodes may move a pixel.
const MAX_NODE_ERROR: f64 = 0.005;
/// Rows in which that is looked up.
const ROWS_TRIED: u32 = 16;

impl Undistortion {
    /// For photographs of `size` (width, height) taken with `intrinsics` through
    /// the lens `distortion`, whose first pixel has its centre at `pixel_center`
    /// on both axes.
    ///
    /// # Errors
    /// If no such pinhole image lies within the photograph, as with coefficients
    /// in a wrong order or with a principal point outside the photograph, or if
    /// that has no pixels.
    pub fn new(
        intrinsics: &Intrinsics,
        distortion: &Distortion,
        size: (u32, u32),
        pixel_center: f64,
    ) -> Result<Self, ViewError> {
        let mut undistortion = Self {
            lens: *intrinsics,
            distortion: *distortion,
            pinhole: *intrinsics,
            size,
            pixel_center,
        };
        if size.0 == 0 || size.1 == 0 {
            return Err(CameraError::NoPixels.into());
        }
        let border = undistortion.border();
        let corners = undistortion.corners();
        let mut fits = |factor: f64| {
            undistortion.pinhole = intrinsics.with_focal_factor(factor);
            // The corners are farthest from the axis: folds reach them first.
            corners
                .iter()
                .all(|pixel| undistortion.is_before_fold(pixel))
                && border.iter().all(|pixel| undistortion.is_shown(pixel))
        };
        let no_factor = ViewError::Lens {
            lens: distortion.name(),
        };
        let (mut below, mut factor) = FOCAL_FACTORS;
        if fits(below) {
            factor = below;
        } else if !fits(factor) {
            return Err(no_factor);
        }
        for _ in 0..BISECTIONS {
            let middle = (below + factor) / 2.0;
            if fits(middle) {
                factor = middle;
            } else {
                below = middle;
            }
        }
        undistortion.pinhole = intrinsics.with_focal_factor(factor);
        let one_to_one = (border.iter()).all(|pixel| undistortion.is_before_fold(pixel));
        one_to_one.then_some(undistortion).ok_or(no_factor)
    }

    /// Intrinsics of the undistorted image.
    pub fn pinhole(&self) -> &Intrinsics {
        &self.pinhole
    }

    /// Image coordinates in the undistorted image → in the photograph.
    pub fn photograph_from_pinhole(&self, pixel: &Vector2<f64>) -> Vector2<f64> {
        let calibrated = self.pinhole.calibrate(pixel);
        self.lens.decalibrate(&self.distortion.distort(&calibrated))
    }

    /// Image coordinates in the photograph → in the undistorted image, where they
    /// may lie outside. `None` where the lens has no inverse.
    pub fn pinhole_from_photograph(&self, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let calibrated = self.distortion.undistort(&self.lens.calibrate(pixel))?;
        Some(self.pinhole.decalibrate(&calibrated))
    }

    /// The undistorted image: bilinear interpolation of the photograph.
    ///
    /// # Panics
    /// If `photograph` has another size than this was made for.
    pub fn resample(&self, photograph: &RgbImage) -> RgbImage {
        assert_eq!(
            photograph.dimensions(),
            self.size,
            "Undistortion::resample: size of the photograph"
        );
        let (width, height) = self.size;
        let spacing = self.node_spacing();
        let mut image = RgbImage::new(width, height);
        let rows = image.par_chunks_exact_mut(3 * width as usize);
        rows.zip(0..height).for_each(|(pixels, row)| {
            let (pixels, _) = pixels.as_chunks_mut::<3>();
            for (rgb, source) in pixels.iter_mut().zip(self.row_of_sources(row, spacing)) {
                *rgb = bilinear(photograph, source);
            }
        });
        image
    }

    /// [`Self::source`] of every pixel of a row, exact in every `spacing`-th.
    fn row_of_sources(&self, row: u32, spacing: u32) -> Vec<Vector2<f64>> {
        let last = self.size.0 - 1;
        let mut sources = Vec::with_capacity(self.size.0 as usize);
        let mut start = self.source(0, row);
        for column in (0..last).step_by(spacing as usize) {
            // The last node lies on the last pixel: a lens may end there.
            let next = (column + spacing).min(last);
            let end = self.source(next, row);
            let step = (end - start) / f64::from(next - column);
            sources.extend((0..next - column).map(|offset| start + step * f64::from(offset)));
            start = end;
        }
        sources.push(start);
        sources
    }

    /// Where in the photograph the undistorted image's pixel is, counted in
    /// centres of pixels.
    fn source(&self, column: u32, row: u32) -> Vector2<f64> {
        let pixel = Vector2::new(f64::from(column), f64::from(row));
        let source = self.photograph_from_pinhole(&pixel.add_scalar(self.pixel_center));
        source.add_scalar(-self.pixel_center)
    }

    /// Every how many pixels of a row the lens is evaluated: as seldom as a line
    /// between two of these nodes stays within [`MAX_NODE_ERROR`] of the lens.
    fn node_spacing(&self) -> u32 {
        let (width, height) = self.size;
        let rows = || (0..=ROWS_TRIED).map(|row| (height - 1) * row / ROWS_TRIED);
        let is_near = |spacing: u32| {
            rows().all(|row| {
                let columns = (0..width).step_by(spacing as usize);
                let nodes: Vec<_> = columns.map(|column| self.source(column, row)).collect();
                nodes.windows(3).all(|node| {
                    // A parabola leaves its chord by an eighth of this.
                    let second_difference = node[0] - 2.0 * node[1] + node[2];
                    second_difference.norm() / 8.0 <= MAX_NODE_ERROR
                })
            })
        };
        let mut spacings = NODE_SPACINGS
            .into_iter()
            .filter(|&spacing| 2 * spacing < width);
        spacings.find(|&spacing| is_near(spacing)).unwrap_or(1)
    }

    /// Centres of the pixels in the corners, around the image.
    fn corners(&self) -> [Vector2<f64>; 4] {
        let first = self.pixel_center;
        let last = self.last_centers();
        [
            Vector2::new(first, first),
            Vector2::new(last.x, first),
            Vector2::new(last.x, last.y),
            Vector2::new(first, last.y),
        ]
    }

    /// Points between them, along the centres of the outermost pixels.
    fn border(&self) -> Vec<Vector2<f64>> {
        let corners = self.corners();
        let sides = (0..4).map(|side| (corners[side], corners[(side + 1) % 4]));
        let points_along = |(start, end): (Vector2<f64>, Vector2<f64>)| {
            (0..BORDER_SAMPLES)
                .map(move |sample| start.lerp(&end, f64::from(sample) / f64::from(BORDER_SAMPLES)))
        };
        sides.flat_map(points_along).collect()
    }

    /// Whether the photograph shows what the pinhole sees at `pixel`, between the
    /// centres of its pixels.
    fn is_shown(&self, pixel: &Vector2<f64>) -> bool {
        let last = self.last_centers();
        let shown = self.photograph_from_pinhole(pixel);
        let within = |x: f64, last: f64| {
            // A lens that does not bend keeps every pixel, to the rounding.
            (self.pixel_center - ROUNDING..=last + ROUNDING).contains(&x)
        };
        within(shown.x, last.x) && within(shown.y, last.y)
    }

    fn is_before_fold(&self, pixel: &Vector2<f64>) -> bool {
        (self.distortion).is_one_to_one_to(&self.pinhole.calibrate(pixel))
    }

    /// Image coordinates of the centre of the last pixel.
    fn last_centers(&self) -> Vector2<f64> {
        let (width, height) = self.size;
        Vector2::new(f64::from(width), f64::from(height)).add_scalar(self.pixel_center - 1.0)
    }
}

/// In pixels: above the rounding of coordinates, below what can be seen.
const ROUNDING: f64 = 1e-9;

/// Parts of a pixel in which [`bilinear`] counts: integers are twice as fast as
/// floats here, and this is finer than [`MAX_NODE_ERROR`].
const PARTS: u32 = 256;

/// The colour at `index`, which counts pixel centres; beyond the outermost ones
/// it is theirs.
fn bilinear(image: &RgbImage, index: Vector2<f64>) -> [u8; 3] {
    let width = image.width() as usize;
    let (colors, _) = image.as_raw().as_chunks::<3>();
    // The pixels before and after along an axis, and the second one's weight.
    let along = |x: f64, last: u32| {
        let parts = x.clamp(0.0, f64::from(last)) * f64::from(PARTS) + 0.5;
        // Not negative and below 2⁴⁰, as just clamped.
        let parts = parts as u64;
        let before = (parts / u64::from(PARTS)) as usize;
        let weight = (parts % u64::from(PARTS)) as u32;
        (before, (before + 1).min(last as usize), weight)
    };
    let (left, right, to_right) = along(index.x, image.width() - 1);
    let (top, bottom, to_bottom) = along(index.y, image.height() - 1);
    let corners = [
        (top, left, (PARTS - to_bottom) * (PARTS - to_right)),
        (top, right, (PARTS - to_bottom) * to_right),
        (bottom, left, to_bottom * (PARTS - to_right)),
        (bottom, right, to_bottom * to_right),
    ];
    let mut sum = [PARTS * PARTS / 2; 3];
    for (row, column, weight) in corners {
        let color = colors[row * width + column];
        for (sum, value) in sum.iter_mut().zip(color) {
            *sum += weight * u32::from(value);
        }
    }
    // A mean of bytes, rounded.
    sum.map(|sum| (sum / (PARTS * PARTS)) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;
    use proptest::prelude::*;

    const SIZE: (u32, u32) = (120, 80);
    const INTRINSICS: Intrinsics = Intrinsics {
        fx: 95.0,
        fy: 100.0,
        cx: 63.0,
        cy: 38.0,
        skew: 0.4,
    };

    fn brown(k1: f64, k2: f64) -> Distortion {
        Distortion::Brown {
            radial: [k1, k2, 0.0, 0.0, 0.0, 0.0],
            tangential: [1e-3, -5e-4],
        }
    }

    fn lenses() -> [Distortion; 5] {
        [
            brown(-0.25, 0.05),
            brown(0.15, 0.0),
            Distortion::Fisheye {
                radial: [0.02, 0.0, 0.0, 0.0, 0.0, 0.0],
                tangential: [0.0; 2],
                thin_prism: [0.0; 4],
            },
            Distortion::Fov { omega: 0.8 },
            Distortion::ReverseRadial { k: 0.1 },
        ]
    }

    /// A smooth picture over directions: what is seen at calibrated coordinates.
    fn color_of_ray(calibrated: &Vector2<f64>) -> [f64; 3] {
        let (x, y) = (calibrated.x, calibrated.y);
        [(7.0 * x).sin(), (6.0 * y + 1.0).cos(), (4.0 * x * y).sin()].map(|v| 128.0 + 120.0 * v)
    }

    fn photograph(undistortion: &Undistortion) -> RgbImage {
        RgbImage::from_fn(SIZE.0, SIZE.1, |column, row| {
            let pixel = Vector2::new(f64::from(column), f64::from(row));
            let distorted =
                (undistortion.lens).calibrate(&pixel.add_scalar(undistortion.pixel_center));
            let ray = undistortion.distortion.undistort(&distorted);
            Rgb(ray
                .map_or([0.0; 3], |ray| color_of_ray(&ray))
                .map(|v| v.round() as u8))
        })
    }

    #[test]
    fn the_image_is_what_a_pinhole_sees() {
        for pixel_center in [0.0, 0.5] {
            for lens in lenses() {
                let undistortion =
                    Undistortion::new(&INTRINSICS, &lens, SIZE, pixel_center).unwrap();
                let image = undistortion.resample(&photograph(&undistortion));
                for (column, row, rgb) in image.enumerate_pixels() {
                    let pixel = Vector2::new(f64::from(column), f64::from(row));
                    let ray = undistortion
                        .pinhole()
                        .calibrate(&pixel.add_scalar(pixel_center));
                    for (found, expected) in rgb.0.into_iter().zip(color_of_ray(&ray)) {
                        // Rounding to bytes twice, and the curvature between pixels.
                        let error = (f64::from(found) - expected).abs();
                        assert!(error < 2.0, "{lens:?} ({column}, {row}): {error}");
                    }
                }
            }
        }
    }

    #[test]
    fn sources_between_nodes_are_exact_to_a_hundredth_of_a_pixel() {
        for lens in lenses() {
            let undistortion = Undistortion::new(&INTRINSICS, &lens, SIZE, 0.5).unwrap();
            for row in 0..SIZE.1 {
                let sources = undistortion.row_of_sources(row, undistortion.node_spacing());
                assert_eq!(sources.len(), SIZE.0 as usize);
                for (column, source) in (0..).zip(sources) {
                    let error = (source - undistortion.source(column, row)).norm();
                    assert!(error < 0.01, "{lens:?} ({column}, {row}): {error}");
                }
            }
            let coarse = undistortion.row_of_sources(7, 16);
            let error = (0..)
                .zip(coarse)
                .map(|(x, at)| (at - undistortion.source(x, 7)).norm());
            assert!(
                error.fold(0.0, f64::max) > 0.01,
                "the test can fail: {lens:?}"
            );
        }
    }

    #[test]
    fn images_of_one_row_or_column_are_resampled() {
        for size in [(1, 1), (1, 5), (5, 1), (2, 2)] {
            let intrinsics = Intrinsics {
                cx: f64::from(size.0) / 2.0,
                cy: f64::from(size.1) / 2.0,
                ..INTRINSICS
            };
            let undistortion = Undistortion::new(&intrinsics, &lenses()[3], size, 0.5).unwrap();
            let gray = RgbImage::from_pixel(size.0, size.1, Rgb([7, 8, 9]));
            assert_eq!(undistortion.resample(&gray), gray);
        }
    }

    #[test]
    fn the_focal_length_is_the_smallest_without_blank_pixels() {
        for lens in lenses() {
            let undistortion = Undistortion::new(&INTRINSICS, &lens, SIZE, 0.5).unwrap();
            let factor = undistortion.pinhole().fx / INTRINSICS.fx;
            let (k, l) = (undistortion.pinhole(), &INTRINSICS);
            assert!((k.fy / l.fy - factor).abs() < 1e-12);
            assert_eq!((k.cx, k.cy), (l.cx, l.cy));
            let outside = |undistortion: &Undistortion, margin: f64| {
                let mut pixels = (0..SIZE.0).flat_map(|x| (0..SIZE.1).map(move |y| (x, y)));
                pixels.any(|(x, y)| {
                    let pixel = Vector2::new(f64::from(x), f64::from(y)).add_scalar(0.5);
                    let shown = undistortion.photograph_from_pinhole(&pixel);
                    let least = shown
                        .min()
                        .min((f64::from(SIZE.0) - shown.x).min(f64::from(SIZE.1) - shown.y));
                    least < 0.5 - margin
                })
            };
            assert!(!outside(&undistortion, 0.01), "{lens:?}");
            let mut smaller = undistortion.clone();
            smaller.pinhole = INTRINSICS.with_focal_factor(factor * 0.999);
            assert!(
                outside(&smaller, 0.0) || factor == FOCAL_FACTORS.0,
                "{lens:?}"
            );
        }
    }

    #[test]
    fn nothing_moves_without_distortion() {
        let still = Distortion::Fov { omega: 0.0 };
        let undistortion = Undistortion::new(&INTRINSICS, &still, SIZE, 0.5).unwrap();
        assert!((undistortion.pinhole().matrix() - INTRINSICS.matrix()).amax() < 1e-7);
        let noise = |x: u32, y: u32| Rgb([(x * 37 + y * 91) as u8, (x * y) as u8, x as u8]);
        let picture = RgbImage::from_fn(SIZE.0, SIZE.1, noise);
        assert_eq!(undistortion.resample(&picture), picture);
    }

    #[test]
    fn lenses_that_show_no_whole_image_are_errors() {
        // Folds at r = 0.26, far within the photograph; the pinhole would need
        // more than four times the focal length.
        let folding = brown(-30.0, 0.0);
        let nan = brown(f64::NAN, 0.0);
        for lens in [folding, nan] {
            let error = Undistortion::new(&INTRINSICS, &lens, SIZE, 0.5).unwrap_err();
            assert!(error.to_string().contains("Brown"), "{error}");
        }
        let beside = Intrinsics {
            cx: -10.0,
            ..INTRINSICS
        };
        assert!(Undistortion::new(&beside, &brown(-0.1, 0.0), SIZE, 0.5).is_err());
        assert!(Undistortion::new(&INTRINSICS, &brown(-0.1, 0.0), (0, 80), 0.5).is_err());
    }

    proptest! {
        #[test]
        fn points_go_there_and_back(x in 0.0..120.0, y in 0.0..80.0, half: bool) {
            let pixel_center = if half { 0.5 } else { 0.0 };
            let pixel = Vector2::new(x, y);
            for lens in lenses() {
                let undistortion = Undistortion::new(&INTRINSICS, &lens, SIZE, pixel_center).unwrap();
                let shown = undistortion.photograph_from_pinhole(&pixel);
                let back = undistortion.pinhole_from_photograph(&shown).unwrap();
                prop_assert!((back - pixel).norm() < 1e-8, "{lens:?}");
            }
        }
    }
}
