//! The bound on the error of the opacity along one ray (VolSDF, Theorem 1).
//!
//! Whether the bound holds is asked a dozen times per ray and iteration and is
//! mostly exponentials. [`Sections::holds`] answers what [`Sections::bounds`]
//! would, to the bit, and leaves out those that cannot change the answer.

use crate::density::laplace_density_scalar;
use neat_tensor::sampling::{MAX_ERROR_FACTOR, SATURATED};

/// The exponential of anything below rounds to 0 in float32.
const NOTHING_PASSES: f32 = -104.5;

/// Sections of a ray between neighbouring samples.
#[derive(Clone, Copy)]
pub(super) struct Sections<'a> {
    /// Positions, one more than sections.
    pub z: &'a [f32],
    /// Distances there.
    pub sdf: &'a [f32],
    /// Lower bound of the distance within each section.
    pub d_star: &'a [f32],
}

impl Sections<'_> {
    /// The bound on the opacity's error at each section (VolSDF eq. 15).
    pub fn bounds(self, beta: f32) -> impl Iterator<Item = f32> {
        let (mut error_integral, mut free_energy) = (0.0, 0.0);
        (0..self.d_star.len()).map(move |i| {
            error_integral += self.error(i, beta);
            let bound = opacity_error(error_integral, free_energy);
            free_energy += self.free_energy(i, beta);
            bound
        })
    }

    /// The largest bound over all sections.
    pub fn largest_bound(self, beta: f32) -> f32 {
        self.bounds(beta).fold(0.0, f32::max)
    }

    /// Whether the largest bound is at most `epsilon`.
    pub fn holds(self, beta: f32, epsilon: f32) -> bool {
        let sections = self.d_star.len();
        let mut error_integral = 0.0;
        // Up to here the bound holds even if everything passes.
        let harmless = harmless_error(epsilon);
        let harmful = (0..sections).find(|i| {
            error_integral += self.error(*i, beta);
            let harmless = error_integral as f32 <= harmless;
            !harmless
        });
        let Some(first) = harmful else {
            return true;
        };
        // From here on it holds whatever the error integral is.
        let opaque = opaque_energy(epsilon);
        let mut free_energy = 0.0;
        for i in 0..first {
            free_energy += self.free_energy(i, beta);
            if free_energy >= opaque {
                return true;
            }
        }
        for i in first..sections {
            if i > first {
                error_integral += self.error(i, beta);
            }
            if opacity_error(error_integral, free_energy) > epsilon {
                return false;
            }
            free_energy += self.free_energy(i, beta);
            if free_energy >= opaque {
                return true;
            }
        }
        true
    }

    /// Rendering weight of each section.
    pub fn weights(self, beta: f32) -> impl Iterator<Item = f32> {
        let mut free_energy = 0.0;
        (0..self.z.len() - 1).map(move |i| {
            let here = self.optical_depth(i, beta);
            let weight = (1.0 - (-here).exp()) * transmittance(free_energy);
            free_energy += f64::from(here);
            weight
        })
    }

    /// Error of section `i`'s density integral.
    fn error(self, i: usize, beta: f32) -> f64 {
        f64::from(section_error(self.length(i), self.d_star[i], beta))
    }

    /// Density times length of section `i`. Running sums are float64, as PyTorch's
    /// on the CPU: float32 would lose the small sections behind large ones.
    fn free_energy(self, i: usize, beta: f32) -> f64 {
        f64::from(self.optical_depth(i, beta))
    }

    fn optical_depth(self, i: usize, beta: f32) -> f32 {
        self.length(i) * laplace_density_scalar(self.sdf[i], beta)
    }

    fn length(self, i: usize) -> f32 {
        self.z[i + 1] - self.z[i]
    }
}

/// The bound on the opacity's error behind sections with the given integrals.
fn opacity_error(error_integral: f64, free_energy: f64) -> f32 {
    let error_integral = error_integral as f32;
    let factor = if error_integral >= SATURATED {
        MAX_ERROR_FACTOR
    } else {
        error_integral.exp().min(MAX_ERROR_FACTOR)
    };
    (factor - 1.0) * transmittance(free_energy)
}

/// What passes a stretch of the given free energy.
fn transmittance(free_energy: f64) -> f32 {
    falling_exp(-free_energy as f32)
}

/// Error of one section's density integral (VolSDF eq. 14).
fn section_error(length: f32, d_star: f32, beta: f32) -> f32 {
    falling_exp(-d_star / beta) * length * length / (4.0 * beta * beta)
}

/// eˣ, without the call where nothing is left of it.
fn falling_exp(x: f32) -> f32 {
    if x < NOTHING_PASSES { 0.0 } else { x.exp() }
}

/// Error integrals up to this keep every bound within `epsilon`; rounding, at most
/// a few units of 10⁻⁷, is on the safe side.
fn harmless_error(epsilon: f32) -> f32 {
    epsilon.ln_1p() * 0.999 - 1e-6
}

/// Free energy from which every bound is within `epsilon`, on the safe side too.
pub(crate) fn opaque_energy(epsilon: f32) -> f64 {
    f64::from(MAX_ERROR_FACTOR / epsilon).ln() + 0.01
}

/// Lower bound d* of the distance to the surface within a section of `length`
/// between distances `d0` and `d1` (VolSDF Theorem 1).
pub(super) fn nearest_distance(length: f32, d0: f32, d1: f32) -> f32 {
    if d0 * d1 <= 0.0 || d0.is_nan() || d1.is_nan() {
        return 0.0;
    }
    let (a, b, c) = (length, d0.abs(), d1.abs());
    if a * a + b * b <= c * c {
        return b;
    }
    if a * a + c * c <= b * b {
        return c;
    }
    if b + c - a <= 0.0 {
        return 0.0;
    }
    // Height of the triangle with sides a, b, c over a (Heron).
    let s = (a + b + c) / 2.0;
    2.0 * (s * (s - a) * (s - b) * (s - c)).sqrt() / a
}
