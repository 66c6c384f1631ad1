//! Synthetic things with a texture, which photographs show and plain solids do not.

use image::{Rgb, RgbImage};
use nalgebra::{Vector2, Vector3};
use neat_core::synthetic::{PlanarFace, SyntheticData};
use neat_core::{Camera, Scene};
use rayon::prelude::*;

/// How bright a point of space is that a surface passes through, in [0, 1].
pub type Texture = fn(&Vector3<f64>) -> f64;

/// The scene with a texture on its solid.
pub fn textured(data: SyntheticData, texture: Texture) -> Scene {
    let mut scene = data.scene;
    let faces = data.solid.faces();
    scene.views.par_iter_mut().for_each(|view| {
        let mut image = view.image.read().unwrap().into_owned();
        paint(&mut image, &view.camera, faces, texture);
        view.image = image.into();
    });
    scene
}

fn paint(image: &mut RgbImage, camera: &Camera, faces: &[PlanarFace], texture: Texture) {
    for (x, y, pixel) in image.enumerate_pixels_mut() {
        let ray = camera.ray_through(&Vector2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
        let nearest = (faces.iter())
            .filter_map(|face| face.intersect(&ray))
            .fold(f64::INFINITY, f64::min);
        let shade = if nearest.is_finite() {
            texture(&(ray.origin + nearest * ray.direction))
        } else {
            // A far wall, which also has a texture.
            texture(&(ray.direction * 6.0)) * 0.6
        };
        let Rgb(colors) = *pixel;
        let lit = if nearest.is_finite() {
            colors
        } else {
            [200; 3]
        };
        *pixel = Rgb(lit.map(|color| (f64::from(color) * shade) as u8));
    }
}

/// Veins with sharp borders, everywhere different.
pub fn veins(point: &Vector3<f64>) -> f64 {
    let octave = |scale: f64| noise(&(point * scale));
    let bands = (5.0 * octave(6.0)).fract();
    0.2 + 0.4 * f64::from(bands > 0.5) + 0.4 * octave(25.0)
}

/// Dark squares that are the same again after a twelfth of a turn around the upright axis, and none
/// far away: what is matched across views are places that look the same.
pub fn repeated_twelve_times(point: &Vector3<f64>) -> f64 {
    let twelfth = std::f64::consts::FRAC_PI_6;
    let angle = point.y.atan2(point.x).rem_euclid(twelfth);
    let [across, up] = [5.0 * angle / twelfth, 9.0 * point.z];
    let in_square = [across, up]
        .iter()
        .all(|place| place.rem_euclid(1.0) > 0.35);
    let dark = in_square && hash([across.floor() as i64, up.floor() as i64, 3]) > 0.3;
    if dark && point.norm() < 3.0 { 0.3 } else { 1.0 }
}

/// Bricks with mortar between them, each a little lighter or darker than the next: what
/// photographs of walls repeat.
pub fn bricks(point: &Vector3<f64>) -> f64 {
    let row = (point.z * 9.0).floor();
    let along = (point.x + point.y) * 5.0 + 0.5 * row.rem_euclid(2.0);
    let [in_row, in_column] = [point.z * 9.0 - row, along - along.floor()];
    if in_row < 0.15 || in_column < 0.08 {
        return 0.9;
    }
    0.45 + 0.15 * hash([row as i64, along.floor() as i64, 7])
}

/// Noise between the values of a lattice.
fn noise(point: &Vector3<f64>) -> f64 {
    let cell = point.map(f64::floor);
    let share = (point - cell).map(|t| t * t * (3.0 - 2.0 * t));
    let mut sum = 0.0;
    for corner in 0..8 {
        let bit = |axis: usize| f64::from(corner >> axis & 1);
        let weight = |axis: usize| {
            if bit(axis) > 0.5 {
                share[axis]
            } else {
                1.0 - share[axis]
            }
        };
        let at = [0, 1, 2].map(|axis| (cell[axis] + bit(axis)) as i64);
        sum += weight(0) * weight(1) * weight(2) * hash(at);
    }
    sum
}

/// A number in [0, 1) for each place of a lattice.
fn hash(at: [i64; 3]) -> f64 {
    let mut mixed = 0u64;
    for value in at {
        mixed = (mixed ^ value as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        mixed ^= mixed >> 29;
    }
    (mixed >> 11) as f64 / (1u64 << 53) as f64
}
