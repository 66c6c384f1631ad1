//! All randomness of neat: ChaCha8 streams on the host.
//!
//! A stream is keyed by (seed, purpose, iteration), so that every backend and
//! every resumed run sees the same numbers, and adding a consumer of random
//! numbers changes no other consumer's.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What random numbers are for. Each purpose has its own stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Initial network weights.
    Weights = 1,
    /// Which pixels are rendered in an iteration.
    Rays = 2,
    /// Where samples lie along the rays.
    Samples = 3,
    /// Points of the eikonal loss.
    Eikonal = 4,
    /// Which view an epoch visits when.
    ViewOrder = 5,
    /// Which sparse points the surface is drawn to in an iteration.
    SurfacePoints = 6,
}

/// The stream of `purpose` in `iteration` of the run with `seed`.
pub fn stream(seed: u64, purpose: Purpose, iteration: u64) -> ChaCha8Rng {
    let mut key = [0u8; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&(purpose as u64).to_le_bytes());
    key[16..24].copy_from_slice(&iteration.to_le_bytes());
    ChaCha8Rng::from_seed(key)
}

/// A standard normal number (Box–Muller, one of the pair).
pub fn standard_normal(rng: &mut impl Rng) -> f64 {
    // 1 - u lies in (0, 1], so the logarithm is finite.
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_each_part_of_the_key() {
        let first = |s, p, i| stream(s, p, i).random::<u64>();
        let base = first(0, Purpose::Rays, 0);
        assert_eq!(base, first(0, Purpose::Rays, 0));
        assert_ne!(base, first(1, Purpose::Rays, 0));
        assert_ne!(base, first(0, Purpose::Samples, 0));
        assert_ne!(base, first(0, Purpose::Rays, 1));
    }

    #[test]
    fn normal_numbers_have_unit_variance() {
        let mut rng = stream(3, Purpose::Weights, 0);
        let n = 20_000;
        let draws: Vec<f64> = (0..n).map(|_| standard_normal(&mut rng)).collect();
        let mean = draws.iter().sum::<f64>() / n as f64;
        let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n as f64;
        assert!(mean.abs() < 0.03, "{mean}");
        assert!((variance - 1.0).abs() < 0.05, "{variance}");
    }
}
