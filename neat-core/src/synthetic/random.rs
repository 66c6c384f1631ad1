//! Random numbers that depend on what they are for, not on who drew before.

use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What a stream of random numbers is for.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    /// Turning the sphere of viewpoints.
    Viewpoints,
    /// Which visible parts are detected.
    Detection,
    /// Noise of the detected end points.
    Noise,
    /// Scores of true vertices and segments.
    Score,
    /// False segments and their scores.
    FalseSegment,
}

/// The stream keyed by `(seed, view, purpose)`.
pub(super) fn stream(seed: u64, view: usize, purpose: Purpose) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&(view as u64).to_le_bytes());
    key[16] = purpose as u8;
    ChaCha8Rng::from_seed(key)
}

/// Two independent standard normal numbers (Box and Muller 1958).
pub(super) fn gaussian_pair(rng: &mut ChaCha8Rng) -> Vector2<f64> {
    // 1 - u lies in (0, 1], so that the logarithm is finite.
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * rng.random::<f64>()).sin_cos();
    Vector2::new(radius * cos, radius * sin)
}
