//! VolSDF's Algorithm 1: samples are added until the opacity's error is bounded.
//!
//! Yariv et al. 2021, section 3.3 and Theorem 1. As published, convergence is
//! decided for the whole batch: while any ray has not converged, every ray gets
//! more samples.

use super::inverse_cdf::{inverse_cdf, linspace};
use super::uniform::jittered_linspace;
use super::{DistanceQuery, RayBundle, RaySamples, SamplingNoise};
use crate::density::laplace_density_scalar;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Numbers of the error-bounded sampler.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ErrorBoundConfig {
    /// Where the rays begin.
    pub near: f64,
    /// Where they end.
    pub far: f64,
    /// Samples drawn from the final opacity.
    pub samples: usize,
    /// Samples of the first and of every further iteration.
    pub samples_per_iteration: usize,
    /// Samples kept from those iterations, besides near and far.
    pub extra_samples: usize,
    /// Error ε of the opacity that is tolerated.
    pub epsilon: f64,
    /// Bisections of β per iteration.
    pub bisections: usize,
    /// Most iterations.
    pub max_iterations: usize,
}

impl Default for ErrorBoundConfig {
    fn default() -> Self {
        Self {
            near: 0.0,
            far: 6.0,
            samples: 64,
            samples_per_iteration: 128,
            extra_samples: 32,
            epsilon: 0.1,
            bisections: 10,
            max_iterations: 5,
        }
    }
}

/// The inside of every iteration, for parity tests.
#[derive(Clone, Debug, Default)]
pub struct ErrorBoundTrace {
    /// Positions `[R · n]` that entered each iteration.
    pub z: Vec<Vec<f32>>,
    /// Their distances.
    pub sdf: Vec<Vec<f32>>,
    /// Largest bound with the wanted β, per ray.
    pub error_at_beta0: Vec<Vec<f32>>,
    /// β after the line search, per ray.
    pub beta: Vec<Vec<f32>>,
}

/// Largest value of the exponential inside the bound, as published.
const MAX_ERROR_FACTOR: f32 = 1e6;
/// Added to every interval's mass before the last draw, as published.
const FINAL_MASS_FLOOR: f32 = 1e-5;
/// Cumulative steps below this are flat, as published.
const FLAT_STEP: f32 = 1e-5;

/// One ray while it is refined.
struct RayState {
    z: Vec<f32>,
    sdf: Vec<f32>,
    d_star: Vec<f32>,
    beta: f32,
    error_at_beta0: f32,
    /// Positions that still need a distance.
    new_z: Vec<f32>,
    cdf: Vec<f32>,
}

impl ErrorBoundConfig {
    /// Sample positions for a density with scale `beta0`; `trace` records the
    /// iterations.
    pub fn sample(
        &self,
        rays: &RayBundle,
        beta0: f32,
        query: &mut impl DistanceQuery,
        noise: &mut impl SamplingNoise,
        mut trace: Option<&mut ErrorBoundTrace>,
    ) -> RaySamples {
        let (near, far) = (self.near as f32, self.far as f32);
        let epsilon = self.epsilon as f32;
        let n = self.samples_per_iteration;
        let first = jittered_linspace(near, far, n, rays.len(), noise);
        let mut states: Vec<RayState> = first
            .par_chunks(n)
            .map(|z| RayState::new(z, epsilon))
            .collect();
        let mut iteration = 0;
        loop {
            iteration += 1;
            evaluate_new(rays, &mut states, query);
            states
                .par_iter_mut()
                .for_each(|state| state.search_beta(beta0, epsilon, self.bisections));
            if let Some(trace) = trace.as_deref_mut() {
                trace.record(&states);
            }
            let converged = states.iter().all(|state| state.beta <= beta0);
            if converged || iteration == self.max_iterations {
                break;
            }
            states.par_iter_mut().for_each(|state| state.upsample(n));
        }

        let last_u = noise.uniform(rays.len() * self.samples);
        let columns = match states.first() {
            Some(state) => noise.columns(state.z.len(), self.extra_samples),
            None => Vec::new(),
        };
        let per_ray = self.samples + columns.len() + 2;
        let z: Vec<f32> = states
            .par_iter_mut()
            .enumerate()
            .flat_map_iter(|(ray, state)| {
                let u = last_u
                    .as_ref()
                    .map(|u| &u[ray * self.samples..(ray + 1) * self.samples]);
                let mut z = state.draw(self.samples, u);
                z.extend([near, far]);
                z.extend(columns.iter().map(|c| state.z[*c]));
                z.sort_unstable_by(f32::total_cmp);
                z
            })
            .collect();
        // Infinitely far, for float32: whatever passes the last sample stops there.
        RaySamples::new(z, per_ray, |_, _| 1e10)
    }
}

/// One batched query for the new positions of all rays, merged in order.
fn evaluate_new(rays: &RayBundle, states: &mut [RayState], query: &mut impl DistanceQuery) {
    if states.is_empty() {
        return;
    }
    let points: Vec<[f32; 3]> = states
        .iter()
        .enumerate()
        .flat_map(|(ray, state)| state.new_z.iter().map(move |z| rays.point(ray, *z)))
        .collect();
    let distances = query.distances(&points);
    let mut offset = 0;
    for state in states {
        let count = state.new_z.len();
        state.merge(&distances[offset..offset + count]);
        offset += count;
    }
}

impl RayState {
    fn new(z: &[f32], epsilon: f32) -> Self {
        let squares: f32 = z.windows(2).map(|p| (p[1] - p[0]) * (p[1] - p[0])).sum();
        Self {
            z: Vec::new(),
            sdf: Vec::new(),
            d_star: Vec::new(),
            // Large enough for the bound to hold with any distances (Lemma 2).
            beta: (squares / (4.0 * (epsilon + 1.0).ln())).sqrt(),
            error_at_beta0: 0.0,
            new_z: z.to_vec(),
            cdf: Vec::new(),
        }
    }

    /// Sorts the new positions with their distances into the old ones.
    fn merge(&mut self, new_sdf: &[f32]) {
        let mut new: Vec<(f32, f32)> = self
            .new_z
            .iter()
            .copied()
            .zip(new_sdf.iter().copied())
            .collect();
        new.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut z = Vec::with_capacity(self.z.len() + new.len());
        let mut sdf = Vec::with_capacity(z.capacity());
        let mut old = self
            .z
            .iter()
            .copied()
            .zip(self.sdf.iter().copied())
            .peekable();
        for (new_z, new_sdf) in new {
            while let Some((old_z, old_sdf)) = old.next_if(|(old_z, _)| *old_z <= new_z) {
                z.push(old_z);
                sdf.push(old_sdf);
            }
            z.push(new_z);
            sdf.push(new_sdf);
        }
        for (old_z, old_sdf) in old {
            z.push(old_z);
            sdf.push(old_sdf);
        }
        self.z = z;
        self.sdf = sdf;
        self.new_z.clear();
    }

    fn search_beta(&mut self, beta0: f32, epsilon: f32, bisections: usize) {
        self.d_star.clear();
        for i in 0..self.z.len() - 1 {
            let length = self.z[i + 1] - self.z[i];
            self.d_star
                .push(nearest_distance(length, self.sdf[i], self.sdf[i + 1]));
        }
        self.error_at_beta0 = self.error_bound(beta0);
        if self.error_at_beta0 <= epsilon {
            self.beta = beta0;
        }
        let (mut low, mut high) = (beta0, self.beta);
        for _ in 0..bisections {
            let middle = (low + high) / 2.0;
            if self.error_bound(middle) <= epsilon {
                high = middle;
            } else {
                low = middle;
            }
        }
        self.beta = high;
    }

    /// The largest bound on the opacity's error over all sections.
    fn error_bound(&self, beta: f32) -> f32 {
        self.section_bounds(beta).fold(0.0, f32::max)
    }

    /// The bound on the opacity's error at each section (VolSDF eq. 15).
    fn section_bounds(&self, beta: f32) -> impl Iterator<Item = f32> {
        let (mut error_integral, mut free_energy) = (0.0, 0.0);
        self.d_star.iter().enumerate().map(move |(i, d_star)| {
            let length = self.z[i + 1] - self.z[i];
            error_integral += f64::from(section_error(length, *d_star, beta));
            let error = (error_integral as f32).exp().min(MAX_ERROR_FACTOR) - 1.0;
            let bound = error * transmittance(free_energy);
            free_energy += f64::from(length * laplace_density_scalar(self.sdf[i], beta));
            bound
        })
    }

    /// `n` new positions where the bound is large.
    fn upsample(&mut self, n: usize) {
        let masses: Vec<f32> = self.section_bounds(self.beta).collect();
        inverse_cdf(
            &self.z,
            masses.iter().copied(),
            FLAT_STEP,
            (0..n).map(|i| linspace(i, n)),
            &mut self.new_z,
            &mut self.cdf,
        );
    }

    /// `n` positions drawn from the rendering weights, at `u` or evenly.
    fn draw(&mut self, n: usize, u: Option<&[f32]>) -> Vec<f32> {
        let mut free_energy = 0.0;
        let masses: Vec<f32> = (0..self.z.len() - 1)
            .map(|i| {
                let length = self.z[i + 1] - self.z[i];
                let here = length * laplace_density_scalar(self.sdf[i], self.beta);
                let weight = (1.0 - (-here).exp()) * transmittance(free_energy);
                free_energy += f64::from(here);
                weight + FINAL_MASS_FLOOR
            })
            .collect();
        let mut drawn = Vec::with_capacity(n);
        let u = (0..n).map(|i| u.map_or_else(|| linspace(i, n), |u| u[i]));
        inverse_cdf(
            &self.z,
            masses.iter().copied(),
            FLAT_STEP,
            u,
            &mut drawn,
            &mut self.cdf,
        );
        drawn
    }
}

/// What passes a stretch of the given free energy. Running sums are float64, as
/// PyTorch's on the CPU: float32 would lose the small sections behind large ones.
fn transmittance(free_energy: f64) -> f32 {
    (-free_energy as f32).exp()
}

/// Error of one section's density integral (VolSDF eq. 14).
fn section_error(length: f32, d_star: f32, beta: f32) -> f32 {
    (-d_star / beta).exp() * length * length / (4.0 * beta * beta)
}

/// Lower bound d* of the distance to the surface within a section of `length`
/// between distances `d0` and `d1` (VolSDF Theorem 1).
fn nearest_distance(length: f32, d0: f32, d1: f32) -> f32 {
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

impl ErrorBoundTrace {
    fn record(&mut self, states: &[RayState]) {
        let gather = |f: &dyn Fn(&RayState) -> &[f32]| {
            states.iter().flat_map(|s| f(s).iter().copied()).collect()
        };
        self.z.push(gather(&|s| &s.z));
        self.sdf.push(gather(&|s| &s.sdf));
        self.error_at_beta0
            .push(states.iter().map(|s| s.error_at_beta0).collect());
        self.beta.push(states.iter().map(|s| s.beta).collect());
    }
}
