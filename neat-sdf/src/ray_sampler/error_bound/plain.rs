//! Algorithm 1 written down plainly: one ray after the other, a new list for
//! everything, every bound computed in full. What the sampler must equal.

use super::ErrorBoundConfig;
use super::opacity_error::nearest_distance;
use crate::density::laplace_density_scalar;
use crate::ray_sampler::inverse_cdf::{cumulate, invert, linspace};
use crate::ray_sampler::uniform::jittered_linspace;
use crate::ray_sampler::{DistanceQuery, RayBundle, RaySamples, SamplingNoise};

/// A ray's positions and distances, and the β found so far.
struct PlainRay {
    samples: Vec<(f32, f32)>,
    beta: f32,
}

/// The samples of a batch, and after how many iterations its rays stopped.
pub(super) fn sample(
    config: &ErrorBoundConfig,
    rays: &RayBundle,
    beta0: f32,
    query: &mut DistanceQuery<'_>,
    noise: &mut impl SamplingNoise,
) -> (RaySamples, usize) {
    let (near, far, epsilon) = (config.near as f32, config.far as f32, config.epsilon as f32);
    let n = config.samples_per_iteration;
    let first = jittered_linspace(near, far, n, rays.len(), noise);
    let mut new_z: Vec<Vec<f32>> = first.chunks(n).map(<[f32]>::to_vec).collect();
    let mut states: Vec<PlainRay> = new_z.iter().map(|z| PlainRay::new(z, epsilon)).collect();
    let mut iteration = 0;
    loop {
        iteration += 1;
        for (i, state) in states.iter_mut().enumerate() {
            let points: Vec<_> = new_z[i].iter().map(|z| rays.point(i, *z)).collect();
            let sdf = query(&points);
            state.samples.extend(new_z[i].iter().copied().zip(sdf));
            state.samples.sort_by(|a, b| a.0.total_cmp(&b.0));
            state.search_beta(beta0, epsilon, config.bisections);
        }
        let converged = states.iter().all(|state| state.beta <= beta0);
        if converged || iteration == config.max_iterations {
            break;
        }
        new_z = states.iter().map(|state| state.upsample(n)).collect();
    }
    let last_u = noise.uniform(rays.len() * config.samples);
    let columns = noise.columns(iteration * n, config.extra_samples);
    let mut z = Vec::new();
    for (i, state) in states.iter().enumerate() {
        let u: Vec<f32> = (0..config.samples)
            .map(|k| match &last_u {
                Some(u) => u[i * config.samples + k],
                None => linspace(k, config.samples),
            })
            .collect();
        let mut ray = state.draw(&u);
        ray.extend([near, far]);
        ray.extend(columns.iter().map(|column| state.samples[*column].0));
        ray.sort_by(f32::total_cmp);
        z.extend(ray);
    }
    let per_ray = config.samples + columns.len() + 2;
    (RaySamples::new(z, per_ray, |_, _| 1e10), iteration)
}

impl PlainRay {
    fn new(z: &[f32], epsilon: f32) -> Self {
        let squares: f32 = z.windows(2).map(|p| (p[1] - p[0]) * (p[1] - p[0])).sum();
        Self {
            samples: Vec::new(),
            beta: (squares / (4.0 * (epsilon + 1.0).ln())).sqrt(),
        }
    }

    fn search_beta(&mut self, beta0: f32, epsilon: f32, bisections: usize) {
        let holds = |beta| self.bounds(beta).into_iter().fold(0.0, f32::max) <= epsilon;
        let (mut low, mut high) = (beta0, self.beta);
        if holds(beta0) {
            high = beta0;
        }
        for _ in 0..bisections {
            let middle = (low + high) / 2.0;
            if holds(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        self.beta = high;
    }

    /// VolSDF eq. 15, every section.
    fn bounds(&self, beta: f32) -> Vec<f32> {
        let (mut error_integral, mut free_energy) = (0.0, 0.0);
        self.samples
            .windows(2)
            .map(|pair| {
                let [(z0, sdf0), (z1, sdf1)] = [pair[0], pair[1]];
                let d_star = nearest_distance(z1 - z0, sdf0, sdf1);
                let length = z1 - z0;
                let error = (-d_star / beta).exp() * length * length / (4.0 * beta * beta);
                error_integral += f64::from(error);
                let factor = (error_integral as f32).exp().min(1e6) - 1.0;
                let bound = factor * (-free_energy as f32).exp();
                free_energy += f64::from(length * laplace_density_scalar(sdf0, beta));
                bound
            })
            .collect()
    }

    fn upsample(&self, n: usize) -> Vec<f32> {
        let u: Vec<f32> = (0..n).map(|i| linspace(i, n)).collect();
        self.invert(self.bounds(self.beta), &u)
    }

    fn draw(&self, u: &[f32]) -> Vec<f32> {
        let mut free_energy = 0.0;
        let weight = |pair: &[(f32, f32)]| {
            let here = (pair[1].0 - pair[0].0) * laplace_density_scalar(pair[0].1, self.beta);
            let weight = (1.0 - (-here).exp()) * (-free_energy as f32).exp();
            free_energy += f64::from(here);
            weight + 1e-5
        };
        let weights = self.samples.windows(2).map(weight).collect();
        self.invert(weights, u)
    }

    fn invert(&self, masses: Vec<f32>, u: &[f32]) -> Vec<f32> {
        let edges: Vec<f32> = self.samples.iter().map(|(z, _)| *z).collect();
        let mut cdf = [vec![0.0], masses].concat();
        cumulate(&mut cdf);
        u.iter().map(|u| invert(&edges, &cdf, 1e-5, *u)).collect()
    }
}
