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

/// Square of the largest distance from the principal point, in halves of the larger side, at
/// which a lens bends more: twice the diagonal of a square. Principal points can be anywhere.
const FARTHEST: f64 = 8.0;

/// Where a pinhole sees what a lens of the given strength shows at `pixel`: one term of the
/// inverse radial model, as VisualSfM has it.
pub(crate) fn straightened(pixel: &Vector2<f64>, camera: &Camera, strength: f64) -> Vector2<f64> {
    let middle = Vector2::new(camera.intrinsics.cx, camera.intrinsics.cy);
    let half_side = 0.5 * f64::from(camera.width.max(camera.height));
    let offset = pixel - middle;
    let squared = (offset.norm_squared() / (half_side * half_side)).min(FARTHEST);
    middle + offset * (1.0 + strength * squared)
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::Intrinsics;

    #[test]
    fn a_lens_moves_the_side_by_its_strength_and_what_is_far_outside_no_further() {
        let intrinsics = Intrinsics::new(90.0, 90.0, 50.0, 40.0);
        let pose = nalgebra::Matrix4::identity();
        let mut camera = Camera::from_matrices(intrinsics, &pose, 100, 80);
        let side = straightened(&Vector2::new(100.0, 40.0), &camera, 0.1);
        assert!((side - Vector2::new(105.0, 40.0)).norm() < 1e-12);
        camera.intrinsics.cx = 1e9;
        let [left, right] = [0.0, 100.0].map(|x| straightened(&Vector2::new(x, 0.0), &camera, 0.3));
        assert!((right - left).norm() < 400.0);
    }
}
