//! Reproducible random numbers.

use nalgebra::SVector;
use neat_core::LineSegment;

/// Of proposals, per coordinate: 0.03 in space.
pub const PROPOSAL_SIGMA: f64 = 0.0173;

/// Reproducible noise (SplitMix64).
pub struct Noise(pub u64);

impl Noise {
    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Standard normal (Box–Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Independent normal coordinates with this standard deviation.
    pub fn normal_vector<const D: usize>(&mut self, sigma: f64) -> SVector<f64, D> {
        SVector::from_fn(|_, _| sigma * self.normal())
    }

    /// The segment with both ends moved at random.
    pub fn jitter<const D: usize>(
        &mut self,
        segment: &LineSegment<D>,
        sigma: f64,
    ) -> LineSegment<D> {
        LineSegment::new(
            segment.start + self.normal_vector(sigma),
            segment.end + self.normal_vector(sigma),
        )
    }
}
