//! Ray-traced images of solids.

use super::{Frustum, PlanarFace};
use crate::Camera;
use image::RgbImage;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

/// Light that reaches every face. With it the darkest face keeps more than a
/// quarter of full brightness, far from the black background.
const AMBIENT: f64 = 0.45;
/// Directional lights: direction towards the light (not normalised), strength.
const LIGHTS: [([f64; 3], f64); 2] = [([0.4, 0.5, 0.8], 0.35), ([-0.7, 0.2, -0.5], 0.2)];
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
    let colors = face_colors(solid, shading);
    // The back of a face is never seen: the solid itself stands before it.
    let front_faces: Vec<(&PlanarFace, Vector3<f64>)> = solid
        .faces()
        .iter()
        .zip(colors)
        .filter(|(face, _)| face.plane_distance(&camera.center_in_world) > 0.0)
        .collect();
    let [lower, upper] = solid
        .bounds_in_image(camera)
        .unwrap_or([Vector2::zeros(), Vector2::from_element(f64::INFINITY)]);
    // Float-to-integer casts saturate, so bounds beyond the image clip to it.
    let columns = lower.x as usize..(upper.x.ceil() as usize).min(camera.width as usize);
    let rows = lower.y as usize..upper.y.ceil() as usize;
    image
        .par_chunks_exact_mut(3 * camera.width.max(1) as usize)
        .enumerate()
        .filter(|(row, _)| rows.contains(row))
        .for_each(|(row, pixels)| {
            for column in columns.clone() {
                let sum: Vector3<f64> = SAMPLES
                    .iter()
                    .map(|[x, y]| Vector2::new(column as f64 + x, row as f64 + y))
                    .map(|sample| trace(&front_faces, camera, &sample))
                    .sum();
                let color = sum * (255.0 / SAMPLES.len() as f64);
                for channel in 0..3 {
                    pixels[3 * column + channel] = color[channel].round() as u8;
                }
            }
        });
    image
}

/// Colour of the nearest face behind a point of the image; black if none.
fn trace(
    front_faces: &[(&PlanarFace, Vector3<f64>)],
    camera: &Camera,
    point_in_image: &Vector2<f64>,
) -> Vector3<f64> {
    let ray = camera.ray_through(point_in_image);
    front_faces
        .iter()
        .filter_map(|(face, color)| Some((face.intersect(&ray)?, *color)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(Vector3::zeros(), |(_, color)| color)
}

/// Colour of every face, channels in [0, 1].
fn face_colors(solid: &Frustum, shading: bool) -> Vec<Vector3<f64>> {
    solid
        .faces()
        .iter()
        .enumerate()
        .map(|(index, face)| {
            let light = if shading {
                irradiance(&face.normal)
            } else {
                1.0
            };
            albedo(index, solid.faces().len()) * light
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

/// Albedo of a face: hues around the colour circle for the sides of a frustum,
/// two greys for its bottom and top, so that neighbours always differ.
fn albedo(face: usize, face_count: usize) -> Vector3<f64> {
    let sides = face_count - 2;
    if face == sides {
        return Vector3::from_element(0.65);
    }
    if face > sides {
        return Vector3::from_element(1.0);
    }
    let (saturation, value) = (0.6, 0.95);
    let hue = 6.0 * face as f64 / sides as f64; // in sixths of the circle
    Vector3::new(5.0, 3.0, 1.0).map(|channel| {
        let k = (channel + hue) % 6.0;
        value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0)
    })
}
