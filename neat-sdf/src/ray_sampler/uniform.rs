//! Evenly spaced samples between two fixed distances.

use super::inverse_cdf::linspace;
use super::{RayBundle, RaySamples, SamplingNoise};
use serde::{Deserialize, Serialize};

/// Evenly spaced samples, jittered within their cells in training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UniformConfig {
    /// Distance of the first sample.
    pub near: f64,
    /// Distance of the last sample.
    pub far: f64,
    /// Samples per ray.
    pub samples: usize,
}

impl Default for UniformConfig {
    fn default() -> Self {
        Self {
            near: 0.0,
            far: 6.0,
            samples: 128,
        }
    }
}

impl UniformConfig {
    /// Positions between near and far; noise moves each within its cell, whose
    /// borders are half way to its neighbours.
    pub fn sample(&self, rays: &RayBundle, noise: &mut impl SamplingNoise) -> RaySamples {
        let z = jittered_linspace(
            self.near as f32,
            self.far as f32,
            self.samples,
            rays.len(),
            noise,
        );
        // Infinitely far, for float32: whatever passes the last sample stops there.
        RaySamples::new(z, self.samples, |_, _| 1e10)
    }
}

/// `samples` positions per ray from `near` to `far`, `[rays · samples]`.
pub(super) fn jittered_linspace(
    near: f32,
    far: f32,
    samples: usize,
    rays: usize,
    noise: &mut impl SamplingNoise,
) -> Vec<f32> {
    let even: Vec<f32> = (0..samples)
        .map(|i| {
            let t = linspace(i, samples);
            near * (1.0 - t) + far * t
        })
        .collect();
    let Some(jitter) = noise.uniform(rays * samples) else {
        return even.repeat(rays);
    };
    let lower = |i: usize| {
        if i == 0 {
            even[0]
        } else {
            0.5 * (even[i - 1] + even[i])
        }
    };
    let upper = |i: usize| {
        if i + 1 == samples {
            even[i]
        } else {
            0.5 * (even[i] + even[i + 1])
        }
    };
    jitter
        .iter()
        .enumerate()
        .map(|(k, u)| {
            let i = k % samples;
            lower(i) + (upper(i) - lower(i)) * u
        })
        .collect()
}
