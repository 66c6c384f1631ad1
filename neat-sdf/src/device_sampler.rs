//! The samplers of [`crate::ray_sampler`] on a GPU: nothing is read back.
//!
//! What the host would decide while it samples is decided there. Algorithm 1 ends
//! when the bound holds on every ray; here the iterations are launched before that
//! is known, those that are not needed change nothing, and [`Progress`] tells
//! afterwards whether more would have been.

use crate::ImplicitNetwork;
use crate::ray_sampler::error_bound::opacity_error::opaque_energy;
use crate::ray_sampler::error_bound::refinement::initial_beta;
use crate::ray_sampler::inverse_cdf::linspace;
use crate::ray_sampler::{
    DeviceSamples, DistanceGrid, ErrorBoundConfig, GridCachedConfig, RayBundle, SamplingNoise,
    StopRule,
};
use burn::tensor::{Device, Tensor, TensorData, s};
use neat_tensor::Kernels;
use neat_tensor::host::host_vec;
use neat_tensor::sampling::{DrawNumbers, GridNumbers, RefineNumbers};

/// Points per pass of the network: bounds the memory of a query.
const POINT_CHUNK: usize = 65_536;

/// Most rays of a call: a kernel takes 32 in a group, and of groups at most 65 535.
const MAX_RAYS: usize = 32 * 65_535;

/// Rays on a device, without gradients.
#[derive(Clone, Debug)]
pub struct DeviceRays {
    /// Origins and directions side by side, `[R, 6]`.
    columns: Tensor<2>,
}

/// How far Algorithm 1 came, as a tensor `[2]`: iterations that were needed among
/// those that were launched, and 1 if that was not enough.
pub type Progress = Tensor<1>;

/// What callers ask before.
const PLACES_SAMPLES: &str = "the backend has kernels that place samples";

fn matrix(values: Vec<f32>, shape: [usize; 2], device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values, shape), device)
}

impl DeviceRays {
    /// Takes rays to `device`.
    pub fn new(rays: &RayBundle, device: &Device) -> Self {
        let pairs = rays.origins.iter().zip(&rays.directions);
        let columns = pairs.flat_map(|(o, d)| [*o, *d]).flatten().collect();
        Self {
            columns: matrix(columns, [rays.len(), 6], &device.clone().inner()),
        }
    }

    /// Number of rays.
    fn len(&self) -> usize {
        self.columns.dims()[0]
    }

    fn origins(&self) -> Tensor<2> {
        self.columns.clone().narrow(1, 0, 3)
    }

    fn directions(&self) -> Tensor<2> {
        self.columns.clone().narrow(1, 3, 3)
    }

    /// The points at `z` `[S, R]`, sample after sample, `[S · R, 3]`.
    fn points_by_sample(&self, z: Tensor<2>) -> Tensor<2> {
        let [samples, rays] = z.dims();
        let along = z.reshape([samples, rays, 1]) * self.directions().reshape([1, rays, 3]);
        let points = along + self.origins().reshape([1, rays, 3]);
        points.reshape([samples * rays, 3])
    }

    /// Samples at `z` `[R, S]`.
    fn place(&self, z: Tensor<2>, deltas: Tensor<2>) -> DeviceSamples {
        let [rays, samples] = z.dims();
        let directions = self.directions().reshape([rays, 1, 3]);
        let directions = directions.expand([rays, samples, 3]);
        let origins = self.origins().reshape([rays, 1, 3]);
        let points = z.clone().reshape([rays, samples, 1]) * directions.clone() + origins;
        DeviceSamples {
            points: points.reshape([rays * samples, 3]),
            directions: directions.reshape([rays * samples, 3]),
            z,
            deltas,
        }
    }
}

/// The capped distance at each point, `[N, 1]`.
fn distances(network: &ImplicitNetwork, points: Tensor<2>) -> Tensor<2> {
    let count = points.dims()[0];
    let chunks = (0..count).step_by(POINT_CHUNK).map(|start| {
        let rows = POINT_CHUNK.min(count - start);
        network.sdf(points.clone().narrow(0, start, rows))
    });
    Tensor::cat(chunks.collect(), 0)
}

impl ErrorBoundConfig {
    /// Whether a GPU can sample so many rays so: all stop together, every iteration
    /// has enough samples to keep some of, and no tensor is empty.
    pub fn runs_on_device(&self, rays: usize) -> bool {
        self.stop == StopRule::Batch
            && (1..=self.samples_per_iteration).contains(&self.extra_samples)
            && self.samples_per_iteration >= 2
            && self.samples >= 1
            && (1..=MAX_RAYS).contains(&rays)
    }

    /// [`Self::sample`] where the networks are, with at most `launched` iterations.
    pub fn sample_on_device(
        &self,
        rays: &DeviceRays,
        beta0: Tensor<1>,
        network: &ImplicitNetwork,
        launched: usize,
        noise: &mut (impl SamplingNoise + Clone),
    ) -> (DeviceSamples, Progress) {
        let device = &rays.columns.device();
        let kernels = network.mlp.kernels.of(&rays.columns);
        let (count, step) = (rays.len(), self.samples_per_iteration);
        let (near, far) = (self.near as f32, self.far as f32);
        let epsilon = self.epsilon as f32;
        let launched = launched.clamp(1, self.max_iterations.max(1));

        let first = self.first_positions(count, noise);
        let betas: Vec<f32> = first
            .chunks(step)
            .map(|z| initial_beta(z, epsilon))
            .collect();
        let mut betas = matrix(betas, [1, count], device);
        let mut new_z = matrix(first, [count, step], device).transpose();
        // Never read: a tensor needs a row.
        let mut samples = Tensor::<2>::zeros([2, count], device);
        let mut progress = Tensor::<1>::from_data([0.0f32, 1.0], device);
        for iteration in 0..launched {
            let sdf = distances(network, rays.points_by_sample(new_z.clone()));
            let fresh = Tensor::cat(vec![new_z, sdf.reshape([step, count])], 0);
            let [iterations, wanted] = [0, 1].map(|i| progress.clone().narrow(0, i, 1));
            let control = Tensor::cat(vec![beta0.clone(), wanted.clone(), iterations.clone()], 0);
            let numbers = RefineNumbers {
                len: iteration * step,
                step,
                rays: count,
                bisections: self.bisections,
                epsilon,
                opaque: opaque_energy(epsilon) as f32,
            };
            let refined = kernels.refine_samples(samples, fresh, betas, control, numbers);
            let state;
            (samples, new_z, state) = refined.expect(PLACES_SAMPLES);
            betas = state.clone().narrow(0, 0, 1);
            let all_hold = state.narrow(0, 1, 1).min();
            let still = wanted.clone() * all_hold.neg().add_scalar(1.0);
            progress = Tensor::cat(vec![iterations + wanted, still], 0);
        }

        let (u, kept) = self.final_noise(count, launched, noise, device);
        let iterations = progress.clone().narrow(0, 0, 1);
        let control = Tensor::cat(vec![beta0, progress.clone().narrow(0, 1, 1), iterations], 0);
        let numbers = DrawNumbers {
            len: launched * step,
            step,
            rays: count,
            drawn: self.samples,
            extras: self.extra_samples,
            near,
            far,
        };
        let drawn = kernels.draw_samples(samples, betas, control, u, kept, numbers);
        let z = drawn.expect(PLACES_SAMPLES);
        let last = self.samples + self.extra_samples + 1;
        let steps = z.clone().narrow(1, 1, last) - z.clone().narrow(1, 0, last);
        // Infinitely far, for float32: whatever passes the last sample stops there.
        let infinite = Tensor::<2>::full([count, 1], 1e10, device);
        // After all iterations the published code stops too.
        let most = self.max_iterations.max(1);
        let progress = if launched == most {
            progress * Tensor::from_data([1.0f32, 0.0], device)
        } else {
            progress
        };
        (
            rays.place(z, Tensor::cat(vec![steps, infinite], 1)),
            progress,
        )
    }

    /// The numbers of the last draw, ascending for each ray, `[samples, R]`; and
    /// which samples stay after how many iterations, `[launched, extras]`.
    fn final_noise(
        &self,
        rays: usize,
        launched: usize,
        noise: &mut (impl SamplingNoise + Clone),
        device: &Device,
    ) -> (Tensor<2>, Tensor<2>) {
        let even = || (0..rays * self.samples).map(|i| linspace(i % self.samples, self.samples));
        let u = noise.uniform(rays * self.samples);
        let mut u = u.unwrap_or_else(|| even().collect());
        for u in u.chunks_mut(self.samples) {
            u.sort_unstable_by(f32::total_cmp);
        }
        let kept = (1..=launched).flat_map(|iterations| {
            let available = iterations * self.samples_per_iteration;
            let mut columns = noise.clone().columns(available, self.extra_samples);
            columns.sort_unstable();
            columns.into_iter().map(|column| column as f32)
        });
        let kept = kept.collect();
        (
            matrix(u, [rays, self.samples], device).transpose(),
            matrix(kept, [launched, self.extra_samples], device),
        )
    }
}

/// A [`DistanceGrid`] on a device.
#[derive(Clone, Debug)]
pub struct DeviceGrid {
    /// The distances at all nodes, `[nodes³]`.
    values: Tensor<1>,
}

impl DeviceGrid {
    /// Takes a grid to `device`.
    pub fn new(grid: &DistanceGrid, device: &Device) -> Self {
        let device = &device.clone().inner();
        Self {
            values: Tensor::from_data(grid.values(), device),
        }
    }

    /// Reads the grid back.
    pub fn values(&self) -> Vec<f32> {
        host_vec(self.values.clone())
    }
}

impl GridCachedConfig {
    /// Whether a GPU can sample so many rays so: nothing is drawn once more, for which there
    /// is no kernel, there are two nodes to look between,
    /// and no tensor is empty.
    pub fn runs_on_device(&self, grid: &DistanceGrid, rays: usize) -> bool {
        !self.redraw
            && grid.resolution() >= 2
            && self.lookups >= 1
            && self.importance_samples + self.uniform_samples >= 1
            && (1..=MAX_RAYS).contains(&rays)
    }

    /// [`crate::RaySampler::refresh`] where the network is. Returns the number of
    /// distances that it took.
    pub fn refresh_on_device(
        &self,
        like: &DistanceGrid,
        grid: &mut DeviceGrid,
        iteration: u64,
        network: &ImplicitNetwork,
    ) -> usize {
        let Some((offset, stride)) = self.due(iteration) else {
            return 0;
        };
        let nodes = like.interleaved_nodes(offset, stride);
        let count = nodes.len();
        let points: Vec<f32> = nodes.as_flattened().to_vec();
        let points = matrix(points, [count, 3], &grid.values.device());
        let sdf = distances(network, points).reshape([count]);
        let all = grid.values.clone();
        grid.values = match stride {
            1 => sdf,
            _ => all.slice_assign([s![offset as isize..;stride as isize]], sdf),
        };
        count
    }

    /// [`crate::RaySampler::sample`] where the grid is.
    ///
    /// # Panics
    /// If `kernels` cannot place samples there.
    pub fn sample_on_device(
        &self,
        rays: &DeviceRays,
        beta: Tensor<1>,
        like: &DistanceGrid,
        grid: &DeviceGrid,
        kernels: &Kernels,
        noise: &mut impl SamplingNoise,
    ) -> DeviceSamples {
        let count = rays.len();
        let stratum = self.lookups + self.importance_samples + self.uniform_samples;
        let noise = noise.uniform(count * stratum);
        let noise = noise.unwrap_or_else(|| vec![0.5; count * stratum]);
        let noise = matrix(noise, [count, stratum], &grid.values.device()).transpose();
        let numbers = GridNumbers {
            rays: count,
            nodes: like.resolution(),
            lookups: self.lookups,
            drawn: self.importance_samples,
            even: self.uniform_samples,
            radius: like.radius(),
            // A density sharper than the grid resolves would miss the surface.
            min_beta: 0.5 * like.cell(),
            weight_floor: self.weight_floor as f32,
        };
        let (rays_there, values) = (rays.columns.clone(), grid.values.clone());
        let backend = kernels.of(&values);
        let placed = backend.sample_grid(rays_there, values, beta, noise, numbers);
        let (z, deltas) = placed.expect(PLACES_SAMPLES);
        rays.place(z, deltas)
    }
}
