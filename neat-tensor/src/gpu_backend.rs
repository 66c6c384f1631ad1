//! The side of GPUs in [`NeatBackend`].

use crate::encoding::PositionalEncoding;
use crate::kernels::gpu::adam::StepNumbers;
use crate::kernels::gpu::{activations, adam, encoding, sampling};
use crate::neat_backend::{AdamNumbers, NeatBackend};
use crate::sampling::{DrawNumbers, GridNumbers, RefineNumbers};
use burn::tensor::{Device, Tensor};

/// GPUs in float32: activations, encoding, optimiser and samplers as kernels in CubeCL;
/// products stay burn's.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Gpu;

impl Gpu {
    /// Whether `device` is one.
    pub fn is(device: &Device) -> bool {
        use burn::backend::DispatchDevice;
        matches!(
            device.clone().inner().as_dispatch(),
            DispatchDevice::Cube(_)
        )
    }
}

impl NeatBackend for Gpu {
    fn has_kernels(&self) -> bool {
        true
    }

    fn places_samples(&self) -> bool {
        true
    }

    fn softplus(&self, z: Tensor<2>, sharpness: f64) -> Tensor<2> {
        activations::softplus(z, sharpness)
    }

    fn times_softplus_slope(&self, g: Tensor<2>, z: Tensor<2>, sharpness: f64) -> Tensor<2> {
        activations::times_slope(g, z, sharpness)
    }

    fn encode(&self, encoding: PositionalEncoding, x: Tensor<2>) -> Tensor<2> {
        if encoding.octaves == 0 {
            return x;
        }
        encoding::encode(x, encoding.octaves)
    }

    fn pull_back(
        &self,
        encoding: PositionalEncoding,
        x: Tensor<2>,
        gradient: Tensor<2>,
    ) -> Tensor<2> {
        if encoding.octaves == 0 {
            return gradient;
        }
        encoding::pull_back(x, gradient, encoding.octaves)
    }

    fn adam(
        &self,
        value: Tensor<1>,
        gradient: Tensor<1>,
        moments: Option<[Tensor<1>; 2]>,
        numbers: AdamNumbers,
    ) -> (Tensor<1>, [Tensor<1>; 2]) {
        let moments = moments.unwrap_or_else(|| [gradient.zeros_like(), gradient.zeros_like()]);
        let numbers = StepNumbers {
            beta1: numbers.beta1 as f32,
            beta2: numbers.beta2 as f32,
            rest1: (1.0 - numbers.beta1) as f32,
            rest2: (1.0 - numbers.beta2) as f32,
            rate: numbers.rate as f32,
            epsilon: numbers.epsilon as f32,
        };
        adam::step(value, gradient, moments, numbers)
    }

    fn refine_samples(
        &self,
        samples: Tensor<2>,
        fresh: Tensor<2>,
        betas: Tensor<2>,
        control: Tensor<1>,
        numbers: RefineNumbers,
    ) -> Option<(Tensor<2>, Tensor<2>, Tensor<2>)> {
        Some(sampling::refine(samples, fresh, betas, control, numbers))
    }

    fn draw_samples(
        &self,
        samples: Tensor<2>,
        betas: Tensor<2>,
        control: Tensor<1>,
        u: Tensor<2>,
        kept: Tensor<2>,
        numbers: DrawNumbers,
    ) -> Option<Tensor<2>> {
        Some(sampling::draw(samples, betas, control, u, kept, numbers))
    }

    fn sample_grid(
        &self,
        rays: Tensor<2>,
        grid: Tensor<1>,
        beta: Tensor<1>,
        noise: Tensor<2>,
        numbers: GridNumbers,
    ) -> Option<(Tensor<2>, Tensor<2>)> {
        Some(sampling::sample_grid(rays, grid, beta, noise, numbers))
    }
}
