//! Placing the samples of training steps on a GPU, without waiting for it.

use burn::module::Module;
use burn::tensor::{DType, Device, Tensor};
use neat_sdf::device_sampler::{DeviceGrid, DeviceRays, Progress};
use neat_sdf::ray_sampler::{RaySampler, Seeded};
use neat_sdf::{DeviceSamples, ImplicitNetwork, RayBundle};
use neat_tensor::Kernels;
use rand::Rng;

/// After so many steps that needed fewer iterations than were launched, one less
/// is launched.
const PATIENCE: u64 = 100;

/// What sampling on a device keeps between steps.
pub(crate) struct DeviceSampling {
    device: Device,
    /// The grid of [`RaySampler::GridCached`].
    grid: Option<DeviceGrid>,
    /// Iterations of Algorithm 1 that a step launches. How many are needed is known
    /// only when the step is over.
    launched: usize,
    /// Steps in a row that needed fewer.
    fewer: u64,
}

/// Samples of one step.
pub(crate) struct SamplesOnDevice {
    pub samples: DeviceSamples,
    /// Of Algorithm 1.
    pub progress: Option<Progress>,
    /// Distances that it took.
    pub asked: usize,
}

impl DeviceSampling {
    /// Where `device` has kernels that can sample `rays` rays so.
    pub fn new(
        rays: usize,
        sampler: &RaySampler,
        kernels: &Kernels,
        device: &Device,
    ) -> Option<Self> {
        let can = match sampler {
            RaySampler::ErrorBound(config) => config.runs_on_device(rays),
            RaySampler::GridCached(config, grid) => config.runs_on_device(grid, rays),
            RaySampler::Uniform(_) => false,
        };
        (can && kernels.on(device, DType::F32).places_samples()).then(|| {
            let mut sampling = Self {
                device: device.clone(),
                grid: None,
                launched: 1,
                fewer: 0,
            };
            sampling.take_over(sampler);
            sampling
        })
    }

    /// Goes on with the state of `sampler`.
    pub fn take_over(&mut self, sampler: &RaySampler) {
        if let RaySampler::GridCached(_, grid) = sampler {
            self.grid = Some(DeviceGrid::new(grid, &self.device));
        }
    }

    /// The state that [`RaySampler::restore`] takes.
    pub fn state(&self) -> Option<Vec<f32>> {
        self.grid.as_ref().map(DeviceGrid::values)
    }

    /// Samples along `rays` in iteration `iteration`, for a density of scale `beta`
    /// `[1]` and the parameters of `network` as they are.
    pub fn sample(
        &mut self,
        sampler: &RaySampler,
        rays: &RayBundle,
        iteration: u64,
        beta: Tensor<1>,
        network: &ImplicitNetwork,
        mut noise: Seeded<impl Rng + Clone>,
    ) -> SamplesOnDevice {
        let (beta, network) = (beta.inner(), &network.valid());
        let on_device = DeviceRays::new(rays, &self.device);
        match (sampler, &mut self.grid) {
            (RaySampler::ErrorBound(config), _) => {
                let (samples, progress) =
                    config.sample_on_device(&on_device, beta, network, self.launched, &mut noise);
                SamplesOnDevice {
                    samples,
                    progress: Some(progress),
                    asked: rays.len() * config.samples_per_iteration * self.launched,
                }
            }
            (RaySampler::GridCached(config, like), Some(grid)) => {
                let asked = config.refresh_on_device(like, grid, iteration, network);
                let kernels = &network.mlp.kernels;
                let samples =
                    config.sample_on_device(&on_device, beta, like, grid, kernels, &mut noise);
                SamplesOnDevice {
                    samples,
                    progress: None,
                    asked,
                }
            }
            _ => unreachable!("DeviceSampling::new refuses other samplers"),
        }
    }

    /// Hears what became of a step; `false` if it has to be done again because more
    /// iterations were wanted than were launched.
    pub fn sufficed(&mut self, [needed, more_wanted]: [f32; 2]) -> bool {
        if more_wanted > 0.0 {
            self.launched += 1;
            self.fewer = 0;
            return false;
        }
        if (needed as usize) < self.launched {
            self.fewer += 1;
        } else {
            self.fewer = 0;
        }
        if self.fewer >= PATIENCE {
            self.launched -= 1;
            self.fewer = 0;
        }
        true
    }
}
