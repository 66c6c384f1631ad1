//! Lenses that bend straight lines, in photographs that are taken for those of a pinhole.
//!
//! The strength of a lens is by how much of its distance from the principal point it moves what
//! is half the larger side of the image away: a positive one draws it inwards, as wide lenses do.

use nalgebra::Vector2;
use neat_core::Camera;

/// Strengths that are tried, from those of a pincushion to those of a wide lens; 2 % between
/// them, which moves the middle of a side by some 5 pixels of 512.
pub(crate) fn strengths() -> Vec<f64> {
    (-5..=15).map(|step| 0.02 * f64::from(step)).collect()
}

/// Where a pinhole sees what a lens of the given strength shows at `pixel`: one term of the
/// inverse radial model, as VisualSfM has it.
pub(crate) fn straightened(pixel: &Vector2<f64>, camera: &Camera, strength: f64) -> Vector2<f64> {
    let middle = Vector2::new(camera.intrinsics.cx, camera.intrinsics.cy);
    let half_side = 0.5 * f64::from(camera.width.max(camera.height));
    let offset = pixel - middle;
    middle + offset * (1.0 + strength * offset.norm_squared() / (half_side * half_side))
}
