//! What an image shows across the projection of a curve in space: its profile.

use super::curve::Curve;
use super::pixels::Pixels;
use nalgebra::{SVector, Vector2};
use neat_core::Camera;

/// Places across the curve.
pub(super) const PLACES: usize = 25;
/// Distance between them in pixels.
pub(super) const SPACING: f64 = 0.5;
/// Distance of the outermost from the curve: room for an edge four pixels beside it.
pub(super) const REACH: f64 = 0.5 * (PLACES as f64 - 1.0) * SPACING;
/// Fewer samples of a part are no profile: their median is noise.
pub(super) const MIN_SAMPLES: usize = 5;

/// Places across the curve in pixels.
pub(super) fn places() -> [f64; PLACES] {
    std::array::from_fn(|k| k as f64 * SPACING - REACH)
}

/// What one view shows across a part of a curve.
#[derive(Clone, Debug)]
pub(super) struct Profile<const N: usize> {
    pub view: usize,
    /// Where the part is along the curve, from -1 to 1.
    pub along: f64,
    /// Pixels across the curve by shifts of it in both directions across it.
    pub by_shift: Vector2<f64>,
    /// Pixels across the curve by its parameters.
    pub by_step: SVector<f64, N>,
    /// Red, green and blue at each place, 0 to 255: medians along the part, to which what hides
    /// less than half of it does nothing.
    pub values: [[f32; 3]; PLACES],
}

/// A point of a curve in an image.
pub(super) struct Sample {
    /// Its parameter.
    pub place: f64,
    pub pixel: Vector2<f64>,
    /// The unit vector across the curve.
    pub normal: Vector2<f64>,
    /// Pixels along the normal by shifts in both directions across the curve.
    pub by_shift: Vector2<f64>,
}

/// The profiles of the parts of a curve that a view holds.
pub(super) fn profiles<const N: usize>(
    curve: &impl Curve<N>,
    view: usize,
    camera: &Camera,
    image: &Pixels<'_>,
) -> Vec<Profile<N>> {
    let profile = |samples: &Vec<Sample>| {
        let count = samples.len() as f64;
        let by_shift = samples.iter().map(|s| s.by_shift).sum::<Vector2<f64>>() / count;
        // Nearer parts of the curve are larger.
        let rays: Vec<(Vector2<f64>, Vector2<f64>)> = (samples.iter())
            .map(|s| (s.pixel, s.normal * (s.by_shift.norm() / by_shift.norm())))
            .filter(|(pixel, unit)| {
                [-REACH, REACH]
                    .iter()
                    .all(|side| image.holds(&(pixel + unit * *side)))
            })
            .collect();
        (rays.len() >= MIN_SAMPLES).then(|| {
            let place = samples.iter().map(|s| s.place).sum::<f64>() / count;
            Profile {
                view,
                along: curve.along(place),
                by_shift,
                by_step: curve.shift_by_step(place).tr_mul(&by_shift),
                values: image.medians(&rays),
            }
        })
    };
    (curve.samples(view, camera).iter())
        .filter_map(profile)
        .collect()
}
