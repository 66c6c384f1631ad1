//! What an image shows across the projection of a line in space: its profile.

use crate::assemble::edge_samples::Images;
use crate::projection::{project_in_front, project_with_jacobian};
use image::RgbImage;
use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, LineSegment3};

/// Places across the line.
pub(super) const PLACES: usize = 25;
/// Distance between them in pixels.
pub(super) const SPACING: f64 = 0.5;
/// Distance of the outermost from the line: room for an edge four pixels beside it.
pub(super) const REACH: f64 = 0.5 * (PLACES as f64 - 1.0) * SPACING;
/// A line is looked at in so many parts of the same length: what hides one in a view does not
/// spoil the others.
const PARTS: usize = 4;
/// Pixels between samples along the line.
const STEP: f64 = 1.5;
/// So many pixels at the ends are not looked at: other edges begin there.
const ENDS: f64 = 3.0;
/// Fewer samples of a part are no profile: their median is noise.
const MIN_SAMPLES: usize = 5;
/// A view counts if it holds at least this share of the line.
const MIN_INSIDE: f64 = 1.0 / 3.0;
/// No image is larger, in pixels.
const MAX_LENGTH: f64 = 1e5;

/// Two unit vectors perpendicular to a line and each other.
pub(super) type Across = [Vector3<f64>; 2];

/// Places across the line in pixels.
pub(super) fn places() -> [f64; PLACES] {
    std::array::from_fn(|k| k as f64 * SPACING - REACH)
}

/// What one view shows across a part of a line.
#[derive(Clone, Debug)]
pub(super) struct Profile {
    pub view: usize,
    /// Where the part is along the line: zero in its middle, ends at ± ½.
    pub along: f64,
    /// Pixels across the line by shifts of it along [`Across`].
    pub by_shift: Vector2<f64>,
    /// Red, green and blue at each place, 0 to 255: medians along the part, to which what hides
    /// less than half of it does nothing.
    pub values: [[f32; 3]; PLACES],
}

/// A point of a line in an image.
struct Sample {
    /// Its parameter.
    place: f64,
    pixel: Vector2<f64>,
    by_shift: Vector2<f64>,
}

impl Images<'_> {
    /// The profiles of the parts of a line that a view holds.
    pub(super) fn profiles(
        &self,
        view: usize,
        image: &RgbImage,
        pixel_center: f64,
        line: &LineSegment3,
        across: &Across,
    ) -> Vec<Profile> {
        let camera = &self.views[view].camera;
        if image.dimensions() != (camera.width, camera.height) {
            return Vec::new();
        }
        let image = Pixels {
            image,
            pixel_center,
        };
        let Some((normal, parts)) = samples(camera, line, across) else {
            return Vec::new();
        };
        let profile = |samples: &Vec<Sample>| {
            let count = samples.len() as f64;
            let by_shift = samples.iter().map(|s| s.by_shift).sum::<Vector2<f64>>() / count;
            // Nearer parts of the line are larger.
            let rays: Vec<(Vector2<f64>, Vector2<f64>)> = (samples.iter())
                .map(|s| (s.pixel, normal * (s.by_shift.norm() / by_shift.norm())))
                .filter(|(pixel, unit)| {
                    [-REACH, REACH]
                        .iter()
                        .all(|side| image.holds(&(pixel + unit * *side)))
                })
                .collect();
            (rays.len() >= MIN_SAMPLES).then(|| Profile {
                view,
                along: samples.iter().map(|s| s.place).sum::<f64>() / count - 0.5,
                by_shift,
                values: image.medians(&rays),
            })
        };
        parts.iter().filter_map(profile).collect()
    }
}

/// The normal of a line in an image, and samples of each part of it.
fn samples(
    camera: &Camera,
    line: &LineSegment3,
    across: &Across,
) -> Option<(Vector2<f64>, [Vec<Sample>; PARTS])> {
    let start = project_in_front(camera, &line.start)?;
    let offset = project_in_front(camera, &line.end)? - start;
    let length = offset.norm();
    if !(2.0 * ENDS + STEP * MIN_SAMPLES as f64..MAX_LENGTH).contains(&length) {
        return None;
    }
    let normal = Vector2::new(-offset.y, offset.x) / length;
    let depths = line.ends().map(|end| camera.to_camera(&end).z);
    let count = ((length - 2.0 * ENDS) / STEP) as usize;
    let mut parts: [Vec<Sample>; PARTS] = Default::default();
    let mut inside = 0;
    for k in 0..count {
        let share = (ENDS + (k as f64 + 0.5) / count as f64 * (length - 2.0 * ENDS)) / length;
        let pixel = start + offset * share;
        let within = |x: f64, size: u32| x >= 0.0 && x <= f64::from(size);
        if !(within(pixel.x, camera.width) && within(pixel.y, camera.height)) {
            continue;
        }
        // Even steps in the image are uneven ones in space.
        let (end, start) = (share / depths[1], (1.0 - share) / depths[0]);
        let place = end / (end + start);
        let Some((pixel, by_point)) = project_with_jacobian(camera, &line.point_at(place)) else {
            continue;
        };
        inside += 1;
        parts[((place * PARTS as f64) as usize).min(PARTS - 1)].push(Sample {
            place,
            pixel,
            by_shift: Vector2::from(across.map(|side| normal.dot(&(by_point * side)))),
        });
    }
    parts.iter_mut().for_each(|part| {
        if part.len() < MIN_SAMPLES {
            part.clear();
        }
    });
    (f64::from(inside) >= MIN_INSIDE * count as f64).then_some((normal, parts))
}

struct Pixels<'a> {
    image: &'a RgbImage,
    pixel_center: f64,
}

impl Pixels<'_> {
    /// Whether the colour at a point is known.
    fn holds(&self, pixel: &Vector2<f64>) -> bool {
        let within = |x: f64, size: u32| {
            let x = x - self.pixel_center;
            x >= 1.0 && x < f64::from(size) - 2.0
        };
        within(pixel.x, self.image.width()) && within(pixel.y, self.image.height())
    }

    /// The medians over points along a line, at each place on the way across it that each of them
    /// has with it.
    fn medians(&self, rays: &[(Vector2<f64>, Vector2<f64>)]) -> [[f32; 3]; PLACES] {
        let mut values: [Vec<f32>; 3] = std::array::from_fn(|_| Vec::with_capacity(rays.len()));
        places().map(|across| {
            values.iter_mut().for_each(Vec::clear);
            for (pixel, unit) in rays {
                let colour = self.colour(&(pixel + unit * across));
                for (values, value) in values.iter_mut().zip(colour) {
                    values.push(value);
                }
            }
            std::array::from_fn(|c| {
                let middle = values[c].len() / 2;
                *values[c].select_nth_unstable_by(middle, f32::total_cmp).1
            })
        })
    }

    /// The colour at a point that the image [`holds`](Self::holds), by cubic convolution (Keys
    /// 1981): linear interpolation would blur.
    fn colour(&self, pixel: &Vector2<f64>) -> [f32; 3] {
        let place = pixel.add_scalar(-self.pixel_center);
        let (column, row) = (place.x.floor(), place.y.floor());
        let across = cubic_weights((place.x - column) as f32);
        let down = cubic_weights((place.y - row) as f32);
        let (width, values) = (self.image.width() as usize, self.image.as_raw());
        let mut colour = [0.0; 3];
        for (j, down) in down.into_iter().enumerate() {
            let first = (row as usize + j - 1) * width + column as usize - 1;
            for (i, across) in across.into_iter().enumerate() {
                for (c, sum) in colour.iter_mut().enumerate() {
                    *sum += down * across * f32::from(values[3 * (first + i) + c]);
                }
            }
        }
        colour
    }
}

/// Weights of the values at -1, 0, 1 and 2.
fn cubic_weights(at: f32) -> [f32; 4] {
    let (square, cube) = (at * at, at * at * at);
    [
        -0.5 * cube + square - 0.5 * at,
        1.5 * cube - 2.5 * square + 1.0,
        -1.5 * cube + 2.0 * square + 0.5 * at,
        0.5 * cube - 0.5 * square,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn colours_between_pixels_follow_a_slope() {
        let image = RgbImage::from_fn(12, 10, |x, y| Rgb([20 + 9 * x as u8, 30 + 4 * y as u8, 7]));
        let pixels = Pixels {
            image: &image,
            pixel_center: 0.5,
        };
        let pixel = Vector2::new(4.3, 5.9);
        assert!(pixels.holds(&pixel));
        let expected = [20.0 + 9.0 * 3.8, 30.0 + 4.0 * 5.4, 7.0];
        for (value, expected) in pixels.colour(&pixel).into_iter().zip(expected) {
            assert!((value - expected).abs() < 1e-4, "{value} {expected}");
        }
        assert!(!pixels.holds(&Vector2::new(1.4, 5.0)));
        assert!(!pixels.holds(&Vector2::new(5.0, 8.6)));
        assert!(!pixels.holds(&Vector2::new(f64::NAN, 5.0)));
    }
}
