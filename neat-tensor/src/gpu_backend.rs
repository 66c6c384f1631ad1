//! The side of GPUs in [`NeatBackend`].

use crate::encoding::PositionalEncoding;
use crate::grid_encoding::GridEncoding;
use crate::kernels::gpu::adam::StepNumbers;
use crate::kernels::gpu::operations::GpuOperations;
use crate::kernels::gpu::{adam, error_bound, grid, primitive, tensor};
use crate::neat_backend::{AdamNumbers, NeatBackend};
use crate::row_choice::RowChoice;
use crate::sampling::{DrawNumbers, GridNumbers, RefineNumbers};
use burn::backend::Dispatch;
use burn::tensor::{Device, Tensor};

/// GPUs in float32: activations, encodings, optimiser and samplers as kernels in CubeCL;
/// products are burn's, by parts where they sum over many rows.
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

    fn affine(&self, x: Tensor<2>, weight: Tensor<2>, bias: Tensor<1>) -> Tensor<2> {
        let (x, bias) = (x.into_dispatch(), bias.unsqueeze::<2>().into_dispatch());
        let weight = weight.transpose().into_dispatch();
        Tensor::from_dispatch(Dispatch::gpu_affine(x, weight, bias))
    }

    fn linear(&self, x: Tensor<2>, matrix: Tensor<2>) -> Tensor<2> {
        let (x, matrix) = (x.into_dispatch(), matrix.into_dispatch());
        Tensor::from_dispatch(Dispatch::gpu_linear(x, matrix))
    }

    fn softplus(&self, z: Tensor<2>, sharpness: f64) -> Tensor<2> {
        let value = Dispatch::gpu_softplus(z.into_dispatch(), sharpness as f32);
        Tensor::from_dispatch(value)
    }

    fn times_softplus_slope(&self, g: Tensor<2>, z: Tensor<2>, sharpness: f64) -> Tensor<2> {
        let (g, z) = (g.into_dispatch(), z.into_dispatch());
        Tensor::from_dispatch(Dispatch::gpu_slope(g, z, sharpness as f32))
    }

    fn encode(&self, encoding: PositionalEncoding, x: Tensor<2>) -> Tensor<2> {
        if encoding.octaves == 0 {
            return x;
        }
        Tensor::from_dispatch(Dispatch::gpu_encode(x.into_dispatch(), encoding.octaves))
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
        let (x, gradient) = (x.into_dispatch(), gradient.into_dispatch());
        Tensor::from_dispatch(Dispatch::gpu_pull_back(x, gradient, encoding.octaves))
    }

    fn encode_grid(&self, grid: &GridEncoding, x: Tensor<2>) -> Tensor<2> {
        let (x, table) = (x.into_dispatch(), grid.table.val().into_dispatch());
        Tensor::from_dispatch(Dispatch::gpu_grid(x, table, grid.shape.clone()))
    }

    fn pull_back_grid(&self, grid: &GridEncoding, x: Tensor<2>, gradient: Tensor<2>) -> Tensor<2> {
        let (x, table) = (x.into_dispatch(), grid.table.val().into_dispatch());
        let gradient = gradient.into_dispatch();
        let shape = grid.shape.clone();
        Tensor::from_dispatch(Dispatch::gpu_pull_back_grid(x, table, gradient, shape))
    }

    fn pick_rows(&self, choice: &RowChoice, values: Tensor<2>) -> Tensor<2> {
        let value = Dispatch::gpu_pick_rows(values.into_dispatch(), choice.clone());
        Tensor::from_dispatch(value)
    }

    fn add_up_rows(&self, choice: &RowChoice, rows: Tensor<2>) -> Tensor<2> {
        let value = Dispatch::gpu_add_up_rows(rows.into_dispatch(), choice.clone());
        Tensor::from_dispatch(value)
    }

    fn adam(
        &self,
        value: Tensor<1>,
        gradient: Tensor<1>,
        moments: Option<[Tensor<1>; 2]>,
        numbers: AdamNumbers,
    ) -> (Tensor<1>, [Tensor<1>; 2]) {
        let [first, second] =
            moments.unwrap_or_else(|| [gradient.zeros_like(), gradient.zeros_like()]);
        let numbers = StepNumbers {
            beta1: numbers.beta1 as f32,
            beta2: numbers.beta2 as f32,
            rest1: (1.0 - numbers.beta1) as f32,
            rest2: (1.0 - numbers.beta2) as f32,
            rate: numbers.rate as f32,
            epsilon: numbers.epsilon as f32,
        };
        let tensors = [value, gradient, first, second].map(primitive);
        let [value, first, second] = adam::step(tensors, numbers).map(tensor);
        (value, [first, second])
    }

    fn refine_samples(
        &self,
        samples: Tensor<2>,
        fresh: Tensor<2>,
        betas: Tensor<2>,
        control: Tensor<1>,
        numbers: RefineNumbers,
    ) -> Option<(Tensor<2>, Tensor<2>, Tensor<2>)> {
        let [samples, fresh, betas] = [samples, fresh, betas].map(primitive);
        let tensors = [samples, fresh, betas, primitive(control)];
        let (merged, next_z, state) = error_bound::refine(tensors, numbers);
        Some((tensor(merged), tensor(next_z), tensor(state)))
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
        let [samples, betas, u, kept] = [samples, betas, u, kept].map(primitive);
        let tensors = [samples, betas, primitive(control), u, kept];
        Some(tensor(error_bound::draw(tensors, numbers)))
    }

    fn sample_grid(
        &self,
        rays: Tensor<2>,
        distances: Tensor<1>,
        beta: Tensor<1>,
        noise: Tensor<2>,
        numbers: GridNumbers,
    ) -> Option<(Tensor<2>, Tensor<2>)> {
        let (distances, beta) = (primitive(distances), primitive(beta));
        let tensors = [primitive(rays), distances, beta, primitive(noise)];
        let (z, deltas) = grid::sample(tensors, numbers);
        Some((tensor(z), tensor(deltas)))
    }
}
