//! VolSDF's Algorithm 1: samples are added until the opacity's error is bounded.
//!
//! Yariv et al. 2021, section 3.3 and Theorem 1. Each iteration asks for the
//! distances at the new samples of all rays at once; the rest is done ray by ray,
//! in memory that is kept between calls.

pub(crate) mod opacity_error;
#[cfg(test)]
mod plain;
pub(crate) mod refinement;
#[cfg(test)]
mod tests;

use super::uniform::jittered_linspace;
use super::{DistanceQuery, RayBundle, RaySamples, SamplingNoise};
use rayon::prelude::*;
use refinement::{RayState, Refinement};
use serde::{Deserialize, Serialize};
use std::cell::Cell;

/// When rays get no more samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopRule {
    /// All at once, when the bound holds on every one, as published: while any ray
    /// has not converged, every ray gets more samples.
    #[default]
    Batch,
    /// Each when the bound holds on it: it gets the samples that it would get in a
    /// batch of its own, and the network is asked about the others only.
    Ray,
}

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
    /// Most iterations; the first is always made.
    pub max_iterations: usize,
    /// Whether rays stop together or one by one.
    pub stop: StopRule,
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
            stop: StopRule::Batch,
        }
    }
}

/// The inside of every iteration, for parity tests; of the rays that took part.
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

thread_local! {
    /// Memory of the last call. Taken out while in use: a thread that waits for
    /// others may be given another call to make.
    static KEPT: Cell<Refinement> = Cell::default();
}

impl ErrorBoundConfig {
    /// Sample positions for a density with scale `beta0`; `trace` records the
    /// iterations.
    pub fn sample(
        &self,
        rays: &RayBundle,
        beta0: f32,
        query: &mut DistanceQuery<'_>,
        noise: &mut impl SamplingNoise,
        trace: Option<&mut ErrorBoundTrace>,
    ) -> RaySamples {
        let mut refinement = KEPT.take();
        self.refine(&mut refinement, rays, beta0, query, noise, trace);
        let samples = self.draw(&mut refinement, noise);
        KEPT.set(refinement);
        samples
    }

    /// Adds samples until the bound holds with `beta0`.
    fn refine(
        &self,
        refinement: &mut Refinement,
        rays: &RayBundle,
        beta0: f32,
        query: &mut DistanceQuery<'_>,
        noise: &mut impl SamplingNoise,
        mut trace: Option<&mut ErrorBoundTrace>,
    ) {
        let epsilon = self.epsilon as f32;
        let n = self.samples_per_iteration;
        let most_iterations = self.max_iterations.max(1);
        let first = self.first_positions(rays.len(), noise);
        refinement.begin(&first, n, most_iterations, epsilon);
        for iteration in 1..=most_iterations {
            let wanted = refinement.wanted(rays);
            if wanted.is_empty() {
                break;
            }
            let distances = query(wanted);
            refinement.merge_each(&distances, |ray| {
                ray.search_beta(beta0, epsilon, self.bisections);
            });
            if let Some(trace) = trace.as_deref_mut() {
                trace.record(refinement, beta0);
            }
            self.stop.apply(refinement.states(), beta0);
            if iteration < most_iterations {
                refinement.upsample_each();
            }
        }
    }

    /// The positions of the first iteration, `[rays · samples_per_iteration]`.
    pub(crate) fn first_positions(&self, rays: usize, noise: &mut impl SamplingNoise) -> Vec<f32> {
        let (near, far) = (self.near as f32, self.far as f32);
        jittered_linspace(near, far, self.samples_per_iteration, rays, noise)
    }

    /// The final samples: drawn from the rendering weights, near, far, and some of
    /// those that the bound was computed with.
    fn draw(&self, refinement: &mut Refinement, noise: &mut impl SamplingNoise) -> RaySamples {
        let (near, far) = (self.near as f32, self.far as f32);
        let last_u = noise.uniform(refinement.states().len() * self.samples);
        let columns = self.extra_columns(refinement.states(), noise);
        // Random columns are fewer where fewer are available: as many for all rays.
        let extras = columns.iter().flatten().map(Vec::len).min().unwrap_or(0);
        let per_ray = self.samples + 2 + extras;
        let mut z = vec![0.0; refinement.states().len() * per_ray];
        z.par_chunks_mut(per_ray)
            .zip(refinement.each())
            .enumerate()
            .for_each(|(i, (z, mut ray))| {
                let u = last_u
                    .as_ref()
                    .map(|u| &u[i * self.samples..(i + 1) * self.samples]);
                let (drawn, others) = z.split_at_mut(self.samples);
                ray.draw(u, drawn);
                let (ends, extra) = others.split_at_mut(2);
                ends.copy_from_slice(&[near, far]);
                let columns = columns[ray.state.iterations].iter().flatten();
                for (z, column) in extra.iter_mut().zip(columns) {
                    *z = ray.positions()[*column];
                }
                z.sort_unstable_by(f32::total_cmp);
            });
        // Infinitely far, for float32: whatever passes the last sample stops there.
        RaySamples::new(z, per_ray, |_, _| 1e10)
    }

    /// Which samples stay, for rays of so many iterations: the same for all of the
    /// same length, drawn from the shortest to the longest. `None` where no ray
    /// has that length.
    fn extra_columns(
        &self,
        states: &[RayState],
        noise: &mut impl SamplingNoise,
    ) -> Vec<Option<Vec<usize>>> {
        (0..=self.max_iterations.max(1))
            .map(|iterations| {
                let present = states.iter().any(|ray| ray.iterations == iterations);
                let available = iterations * self.samples_per_iteration;
                present.then(|| noise.columns(available, self.extra_samples))
            })
            .collect()
    }
}

impl StopRule {
    /// Decides which of the rays are refined further.
    fn apply(self, rays: &mut [RayState], beta0: f32) {
        let converged = |ray: &RayState| ray.beta <= beta0;
        match self {
            Self::Batch => {
                let all = rays.iter().all(converged);
                rays.iter_mut().for_each(|ray| ray.refining = !all);
            }
            Self::Ray => {
                for ray in rays {
                    ray.refining = ray.refining && !converged(ray);
                }
            }
        }
    }
}

impl ErrorBoundTrace {
    fn record(&mut self, refinement: &mut Refinement, beta0: f32) {
        let states = refinement.states().to_vec();
        let took_part = || (0..states.len()).filter(|ray| states[*ray].refining);
        let sections = |ray| refinement.sections(ray);
        self.z.push(
            took_part()
                .flat_map(|ray| sections(ray).z.to_vec())
                .collect(),
        );
        self.sdf.push(
            took_part()
                .flat_map(|ray| sections(ray).sdf.to_vec())
                .collect(),
        );
        self.error_at_beta0.push(
            took_part()
                .map(|ray| sections(ray).largest_bound(beta0))
                .collect(),
        );
        self.beta
            .push(took_part().map(|ray| states[ray].beta).collect());
    }
}
