//! Ray-traced images of solids.

use super::frustum::bounds_in_image;
use super::{Frustum, PlanarFace, RoundFace};
use crate::{Camera, Ray};
use image::RgbImage;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use std::ops::Range;

/// Light that reaches every face. With it the darkest face keeps more than a
/// quarter of full brightness, far from the black background.
const AMBIENT: f64 = 0.45;
/// Directional lights: direction towards the light (not normalised), strength.
const LIGHTS: [([f64; 3], f64); 2] = [([0.4, 0.5, 0.8], 0.35), ([-0.7, 0.2, -0.5], 0.2)];
/// Albedos of bottom and top: greys.
const END_ALBEDOS: [f64; 2] = [0.65, 1.0];
/// Offsets of the four samples in a pixel, in pixels from its corner.
const SAMPLES: [[f64; 2]; 4] = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]];

/// The solid as seen by a camera outside it, on black, with four samples per
/// pixel. Image coordinates have their origin in the image corner (pixel
/// centres at 0.5).
///
/// Faces have albedos of their own; with `shading` they are Lambertian under
/// two lights fixed in the world, without it they show their albedo.
pub fn render(solid: &Frustum, camera: &Camera, shading: bool) -> RgbImage {
    let mut image = RgbImage::new(camera.width, camera.height);
    // The back of a face is never seen: the solid itself stands before it.
    let front_faces: Vec<SeenFace> = painted_faces(solid, shading)
        .into_iter()
        .filter(|face| match face.shape {
            Shape::Planar(plane) => plane.plane_distance(&camera.center_in_world) > 0.0,
            Shape::Round(_) => true,
        })
        .map(|face| SeenFace::new(face, camera))
        .collect();
    image
        .par_chunks_exact_mut(3 * camera.width.max(1) as usize)
        .enumerate()
        .for_each(|(row, pixels)| {
            let of_row: Vec<&SeenFace> = (front_faces.iter())
                .filter(|seen| seen.rows.contains(&row))
                .collect();
            let first = of_row.iter().map(|seen| seen.columns.start).min();
            let last = of_row.iter().map(|seen| seen.columns.end).max();
            for column in first.unwrap_or(0)..last.unwrap_or(0) {
                let sum: Vector3<f64> = SAMPLES
                    .iter()
                    .map(|[x, y]| Vector2::new(column as f64 + x, row as f64 + y))
                    .map(|sample| trace(&of_row, column, camera, &sample))
                    .sum();
                let color = sum * (255.0 / SAMPLES.len() as f64);
                for channel in 0..3 {
                    pixels[3 * column + channel] = color[channel].round() as u8;
                }
            }
        });
    image
}

#[derive(Clone, Copy)]
enum Shape<'f> {
    Planar(&'f PlanarFace),
    Round(&'f RoundFace),
}

/// A face and its colour.
#[derive(Clone, Copy)]
struct PaintedFace<'f> {
    shape: Shape<'f>,
    albedo: Vector3<f64>,
    shading: bool,
}

impl PaintedFace<'_> {
    /// How far along a ray it is, and its colour there, channels in [0, 1].
    fn along(&self, ray: &Ray) -> Option<(f64, Vector3<f64>)> {
        let (distance, normal) = match self.shape {
            Shape::Planar(face) => (face.intersect(ray)?, face.normal),
            Shape::Round(face) => {
                let distance = face.intersect(ray)?;
                let point = ray.origin + ray.direction * distance;
                (distance, face.normal_beside(&point))
            }
        };
        let light = if self.shading {
            irradiance(&normal)
        } else {
            1.0
        };
        Some((distance, self.albedo * light))
    }

    fn hull(&self) -> Vec<Vector3<f64>> {
        match self.shape {
            Shape::Planar(face) => face.hull(),
            Shape::Round(face) => face.hull(),
        }
    }
}

/// A face and the pixels that may show it.
struct SeenFace<'f> {
    face: PaintedFace<'f>,
    columns: Range<usize>,
    rows: Range<usize>,
}

impl<'f> SeenFace<'f> {
    fn new(face: PaintedFace<'f>, camera: &Camera) -> Self {
        let everywhere = [Vector2::zeros(), Vector2::from_element(f64::INFINITY)];
        let [lower, upper] = bounds_in_image(&face.hull(), camera).unwrap_or(everywhere);
        // Float-to-integer casts saturate, so bounds beyond the image clip to it.
        let within = |axis: usize, size: u32| {
            lower[axis] as usize..(upper[axis].ceil() as usize).min(size as usize)
        };
        Self {
            face,
            columns: within(0, camera.width),
            rows: within(1, camera.height),
        }
    }
}

/// Colour of the nearest face behind a point of a pixel in a column; black if none.
fn trace(
    faces: &[&SeenFace],
    column: usize,
    camera: &Camera,
    point_in_image: &Vector2<f64>,
) -> Vector3<f64> {
    let ray = camera.ray_through(point_in_image);
    (faces.iter())
        .filter(|seen| seen.columns.contains(&column))
        .filter_map(|seen| seen.face.along(&ray))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(Vector3::zeros(), |(_, color)| color)
}

/// Every face with its albedo: sides that go on smoothly share theirs.
fn painted_faces(solid: &Frustum, shading: bool) -> Vec<PaintedFace<'_>> {
    let (planes, rounds) = (solid.faces(), solid.round_faces());
    let (straight, ends) = planes.split_at(planes.len() - 2);
    let sides = (straight.iter().map(Shape::Planar)).chain(rounds.iter().map(Shape::Round));
    let surfaces = solid.surfaces();
    let count = surfaces.iter().max().map_or(0, |last| last + 1);
    let of_sides = surfaces.iter().map(|surface| side_albedo(*surface, count));
    (sides.zip(of_sides))
        .chain(
            ends.iter()
                .map(Shape::Planar)
                .zip(END_ALBEDOS.map(Vector3::from_element)),
        )
        .map(|(shape, albedo)| PaintedFace {
            shape,
            albedo,
            shading,
        })
        .collect()
}

/// Light on a face: at least [`AMBIENT`], at most 1.
fn irradiance(normal: &Vector3<f64>) -> f64 {
    LIGHTS.iter().fold(AMBIENT, |sum, (direction, strength)| {
        let towards_light = Vector3::from(*direction).normalize();
        sum + strength * normal.dot(&towards_light).max(0.0)
    })
}

/// Albedo of a side: hues around the colour circle, so that neighbours always differ.
fn side_albedo(surface: usize, count: usize) -> Vector3<f64> {
    let (saturation, value) = (0.6, 0.95);
    let hue = 6.0 * surface as f64 / count as f64; // in sixths of the circle
    Vector3::new(5.0, 3.0, 1.0).map(|channel| {
        let k = (channel + hue) % 6.0;
        value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{Solid, viewpoints};

    #[test]
    fn faces_are_seen_wherever_rays_meet_them() {
        // From afar, and from so near that corners lie behind the camera.
        for (solid, distance) in [
            (Solid::LPrism, 2.5),
            (Solid::StairPrism, 0.8),
            (Solid::DrilledPlate, 0.8),
            (Solid::TruncatedCone, 2.5),
        ] {
            let solid = solid.frustum();
            let faces = painted_faces(&solid, true);
            let seen_along = |ray: &Ray| {
                (faces.iter())
                    .filter_map(|face| face.along(ray))
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .map_or(Vector3::zeros(), |(_, color)| color)
            };
            for camera in viewpoints(6, distance, (40, 32), 0) {
                assert!(!solid.contains(&camera.center_in_world));
                for (column, row, pixel) in render(&solid, &camera, true).enumerate_pixels() {
                    let corner = Vector2::new(f64::from(column), f64::from(row));
                    let sum: Vector3<f64> = (SAMPLES.iter())
                        .map(|sample| {
                            seen_along(&camera.ray_through(&(corner + Vector2::from(*sample))))
                        })
                        .sum();
                    let expected = (sum * (255.0 / 4.0)).map(|value| value.round() as u8);
                    assert_eq!(pixel.0, <[u8; 3]>::from(expected), "{column} {row}");
                }
            }
        }
    }
}
