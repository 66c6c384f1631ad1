//! Where the samples of training steps are placed: by the host, or on the GPU where
//! the networks are.

use crate::config::TrainConfig;
#[cfg(feature = "wgpu")]
use crate::device_sampling::{DeviceSampling, SamplesOnDevice};
use crate::model::PlacedSamples;
#[cfg(feature = "wgpu")]
use crate::model::index_tensor;
use burn::tensor::{Device, Tensor};
use neat_sdf::ray_sampler::{RaySampler, RaySamples, Seeded};
use neat_sdf::{Distances, ImplicitNetwork, RayBundle};
use neat_tensor::random::{Purpose, stream};

/// A sampler with its state, wherever that lies.
pub(crate) struct SamplePlacement {
    sampler: RaySampler,
    /// Where samples are placed on the device; the state of `sampler` is here then.
    #[cfg(feature = "wgpu")]
    on_device: Option<DeviceSampling>,
}

/// What the samples of an iteration follow from.
pub(crate) struct StepToSample<'a> {
    pub seed: u64,
    pub iteration: u64,
    pub rays: &'a RayBundle,
    /// Scale of the density; only a placement on the host asks for it.
    pub beta: f64,
    /// The same as a tensor `[1]`, for a placement on the device only.
    #[cfg(feature = "wgpu")]
    pub beta_tensor: Option<Tensor<1>>,
    pub network: &'a ImplicitNetwork,
}

/// The samples of an iteration.
pub(crate) enum StepSamples {
    OnHost(RaySamples, Box<Distances>),
    #[cfg(feature = "wgpu")]
    OnDevice(Box<SamplesOnDevice>),
}

impl SamplePlacement {
    /// A sampler at its start, for networks on `device`.
    pub fn new(train: &TrainConfig, sampler: RaySampler, device: &Device) -> Self {
        #[cfg(not(feature = "wgpu"))]
        let _ = (train, device);
        Self {
            #[cfg(feature = "wgpu")]
            on_device: DeviceSampling::new(train, &sampler, device),
            sampler,
        }
    }

    /// Whether the device places the samples, so that the host knows neither them
    /// nor a learned β.
    pub fn is_on_device(&self) -> bool {
        #[cfg(feature = "wgpu")]
        return self.on_device.is_some();
        #[cfg(not(feature = "wgpu"))]
        return false;
    }

    /// The samples of an iteration, and how many distances they took.
    pub fn place(&mut self, step: &StepToSample<'_>, device: &Device) -> (StepSamples, usize) {
        let mut noise = Seeded(stream(step.seed, Purpose::Samples, step.iteration));
        #[cfg(feature = "wgpu")]
        if let Some(on_device) = &mut self.on_device {
            let samples = on_device.sample(&self.sampler, step, noise);
            let asked = samples.asked;
            return (StepSamples::OnDevice(Box::new(samples)), asked);
        }
        let distances = step.network.distances(device);
        let mut asked = 0;
        let mut query = |points: &[[f32; 3]]| {
            asked += points.len();
            distances.capped(points)
        };
        self.sampler.refresh(step.iteration, &mut query);
        let beta = step.beta as f32;
        let samples = (self.sampler).sample(step.rays, beta, &mut query, &mut noise);
        (StepSamples::OnHost(samples, Box::new(distances)), asked)
    }

    /// Hears the numbers of [`StepSamples::progress`]; `false` if the step has to be
    /// done again, because its samples were not refined enough.
    pub fn sufficed(&mut self, progress: [f32; 2]) -> bool {
        #[cfg(feature = "wgpu")]
        if let Some(on_device) = &mut self.on_device {
            return on_device.sufficed(progress);
        }
        let _ = progress;
        true
    }

    /// The sampler, with its state on the host.
    pub fn sampler(&self) -> RaySampler {
        #[cfg(feature = "wgpu")]
        if let Some(state) = self.on_device.as_ref().and_then(DeviceSampling::state) {
            let mut sampler = self.sampler.clone();
            assert!(sampler.restore(state), "a grid keeps its size");
            return sampler;
        }
        self.sampler.clone()
    }

    /// Takes over the state of a checkpoint; `false` if it does not fit.
    pub fn restore(&mut self, state: Vec<f32>) -> bool {
        let fits = self.sampler.restore(state);
        #[cfg(feature = "wgpu")]
        if let Some(on_device) = &mut self.on_device {
            on_device.take_over(&self.sampler);
        }
        fits
    }
}

impl StepSamples {
    /// For rendering.
    pub fn placed(&self) -> PlacedSamples<'_> {
        match self {
            Self::OnHost(samples, distances) => PlacedSamples::OnHost(samples, distances),
            #[cfg(feature = "wgpu")]
            Self::OnDevice(on_device) => PlacedSamples::OnDevice(&on_device.samples),
        }
    }

    /// How far Algorithm 1 came, `[2]`, where only the device knows.
    pub fn progress(&self) -> Option<Tensor<1>> {
        match self {
            Self::OnHost(..) => None,
            #[cfg(feature = "wgpu")]
            Self::OnDevice(on_device) => on_device.progress.clone(),
        }
    }

    /// Sample `picks[r]` of every ray `r`: as points, or where only the device knows
    /// them as a tensor `[R, 3]` without gradient.
    pub fn pick(&self, rays: &RayBundle, picks: &[usize]) -> (Vec<[f32; 3]>, Option<Tensor<2>>) {
        let per_ray = self.placed().per_ray();
        let picks = picks.iter().enumerate();
        let rows = picks.map(|(ray, sample)| (ray, ray * per_ray + sample));
        match self {
            Self::OnHost(samples, _) => {
                let points = rows.map(|(ray, row)| rays.point(ray, samples.z[row]));
                (points.collect(), None)
            }
            #[cfg(feature = "wgpu")]
            Self::OnDevice(on_device) => {
                let points = on_device.samples.points.clone();
                let rows = index_tensor(rows.map(|(_, row)| row), &points.device());
                (Vec::new(), Some(points.select(0, rows)))
            }
        }
    }
}
