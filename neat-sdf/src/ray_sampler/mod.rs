//! Where the samples of a ray lie.
//!
//! Samplers run on the host, without gradients: sorting, running sums and
//! searches are short per ray and awkward on the tensor backends. They ask the
//! network for distances in batches. While a model is trained on a GPU,
//! `device_sampler` does the same there.

pub(crate) mod error_bound;
pub(crate) mod grid_cached;
pub(crate) mod inverse_cdf;
mod noise;
mod ray_sections;
mod redrawn;
mod uniform;

pub use error_bound::{ErrorBoundConfig, ErrorBoundTrace, StopRule};
pub use grid_cached::{DistanceGrid, GridCachedConfig};
pub use noise::{Deterministic, SamplingNoise, Seeded};
pub use uniform::UniformConfig;

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

/// Rays, and the stretch of each that is sampled.
#[derive(Clone, Debug, Default)]
pub struct RayBundle {
    /// Where the rays start, `[R]`.
    pub origins: Vec<[f32; 3]>,
    /// Unit directions, `[R]`.
    pub directions: Vec<[f32; 3]>,
}

impl RayBundle {
    /// Number of rays.
    pub fn len(&self) -> usize {
        self.origins.len()
    }

    /// Whether there is no ray.
    pub fn is_empty(&self) -> bool {
        self.origins.is_empty()
    }

    /// The point at distance `z` along ray `ray`.
    pub fn point(&self, ray: usize, z: f32) -> [f32; 3] {
        let (o, d) = (self.origins[ray], self.directions[ray]);
        [o[0] + z * d[0], o[1] + z * d[1], o[2] + z * d[2]]
    }

    /// The points of `samples` sorted distances per ray, row-major `[R · S]`.
    pub fn points(&self, z: &[f32], samples: usize) -> Vec<[f32; 3]> {
        z.iter()
            .enumerate()
            .map(|(i, z)| self.point(i / samples, *z))
            .collect()
    }
}

/// Sorted sample positions along rays.
#[derive(Clone, Debug)]
pub struct RaySamples {
    /// Samples per ray `S`.
    pub per_ray: usize,
    /// Distances along the rays `[R · S]`, ascending within a ray.
    pub z: Vec<f32>,
    /// Length of the interval that begins at each sample `[R · S]`.
    pub deltas: Vec<f32>,
}

impl RaySamples {
    /// From sorted distances; the last interval of ray `r` is `last_delta(r, z)`.
    fn new(z: Vec<f32>, per_ray: usize, last_delta: impl Fn(usize, f32) -> f32) -> Self {
        let mut deltas = Vec::with_capacity(z.len());
        for (ray, z) in z.chunks(per_ray).enumerate() {
            deltas.extend(z.windows(2).map(|pair| pair[1] - pair[0]));
            deltas.push(last_delta(ray, z[per_ray - 1]));
        }
        Self { per_ray, z, deltas }
    }
}

impl RaySamples {
    /// The samples of some rays.
    pub fn of_rays(&self, rays: std::ops::Range<usize>) -> Self {
        let samples = rays.start * self.per_ray..rays.end * self.per_ray;
        Self {
            per_ray: self.per_ray,
            z: self.z[samples.clone()].to_vec(),
            deltas: self.deltas[samples].to_vec(),
        }
    }
}

/// Sorted sample positions along rays where the networks are, without gradients.
#[derive(Clone, Debug)]
pub struct DeviceSamples {
    /// Distances along the rays `[R, S]`, ascending within a ray.
    pub z: Tensor<2>,
    /// Length of the interval that begins at each sample `[R, S]`.
    pub deltas: Tensor<2>,
    /// The samples' positions `[R · S, 3]`.
    pub points: Tensor<2>,
    /// The rays' directions at each sample `[R · S, 3]`.
    pub directions: Tensor<2>,
}

/// A batched query: the (capped) signed distance at each point.
pub type DistanceQuery<'a> = dyn FnMut(&[[f32; 3]]) -> Vec<f32> + 'a;

/// Which sampler, and its numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum RaySamplerConfig {
    /// VolSDF's Algorithm 1.
    ErrorBound(ErrorBoundConfig),
    /// Importance sampling of a cached grid of distances.
    GridCached(GridCachedConfig),
    /// Evenly spaced samples.
    Uniform(UniformConfig),
}

/// A sampler with its state.
#[derive(Clone, Debug)]
pub enum RaySampler {
    /// VolSDF's Algorithm 1.
    ErrorBound(ErrorBoundConfig),
    /// Importance sampling of a cached grid.
    GridCached(GridCachedConfig, DistanceGrid),
    /// Evenly spaced samples.
    Uniform(UniformConfig),
}

impl RaySamplerConfig {
    /// A sampler for a scene of `scene_radius` around the origin, whose initial
    /// surface is a sphere of `initial_radius`.
    pub fn init(&self, scene_radius: f64, initial_radius: f64) -> RaySampler {
        match self {
            Self::ErrorBound(config) => RaySampler::ErrorBound(*config),
            Self::GridCached(config) => RaySampler::GridCached(
                *config,
                DistanceGrid::sphere(
                    config.resolution,
                    scene_radius as f32,
                    initial_radius as f32,
                ),
            ),
            Self::Uniform(config) => RaySampler::Uniform(*config),
        }
    }
}

impl RaySampler {
    /// Brings cached state up to date before iteration `iteration`.
    pub fn refresh(&mut self, iteration: u64, query: &mut DistanceQuery<'_>) {
        if let Self::GridCached(config, grid) = self {
            config.refresh(grid, iteration, query);
        }
    }

    /// Brings cached state fully up to date, for evaluation.
    pub fn refresh_all(&mut self, query: &mut DistanceQuery<'_>) {
        if let Self::GridCached(_, grid) = self {
            grid.update_interleaved(0, 1, query);
        }
    }

    /// Cached values that a checkpoint must keep for an exact resume.
    pub fn state(&self) -> Option<&[f32]> {
        match self {
            Self::GridCached(_, grid) => Some(grid.values()),
            Self::ErrorBound(_) | Self::Uniform(_) => None,
        }
    }

    /// Takes over cached values; `false` if they do not fit this sampler.
    pub fn restore(&mut self, state: Vec<f32>) -> bool {
        match self {
            Self::GridCached(_, grid) => grid.set_values(state),
            Self::ErrorBound(_) | Self::Uniform(_) => false,
        }
    }

    /// Sample positions along `rays` for a density of scale `beta`.
    pub fn sample(
        &self,
        rays: &RayBundle,
        beta: f32,
        query: &mut DistanceQuery<'_>,
        noise: &mut impl SamplingNoise,
    ) -> RaySamples {
        match self {
            Self::ErrorBound(config) => config.sample(rays, beta, query, noise, None),
            Self::GridCached(config, grid) => config.sample(rays, beta, grid, query, noise),
            Self::Uniform(config) => config.sample(rays, noise),
        }
    }
}
