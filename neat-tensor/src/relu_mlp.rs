//! The ReLU perceptron: radiance, attraction, junctions.

use crate::kernel_choice::Kernels;
use crate::linear::{Linear, LinearInit};
use crate::neat_backend::{NeatBackend, SampleInputs};
use burn::module::Module;
use burn::tensor::{Device, Tensor, activation};
use rand::Rng;

/// A perceptron with ReLU between its layers and a linear last layer.
#[derive(Module, Debug)]
pub struct ReluMlp {
    /// The layers, first to last.
    pub layers: Vec<Linear>,
    /// Which operations it runs.
    #[module(skip)]
    pub kernels: Kernels,
}

impl ReluMlp {
    /// `widths[0]` inputs, then each layer's outputs; PyTorch's default
    /// initialisation.
    pub fn new(widths: &[usize], weight_norm: bool, rng: &mut impl Rng, device: &Device) -> Self {
        let layers = widths
            .windows(2)
            .map(|w| {
                let init = LinearInit::uniform(w[0], w[1], rng);
                Linear::new(&init, w[0], w[1], weight_norm, device)
            })
            .collect();
        Self {
            layers,
            kernels: Kernels::default(),
        }
    }

    /// `[N, in]` → `[N, out]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        self.forward_by(self.kernels.of(&x), x)
    }

    fn forward_by(&self, by: &(impl NeatBackend + ?Sized), x: Tensor<2>) -> Tensor<2> {
        let affine = |x, layer: &Linear| by.affine(x, layer.effective_weight(), layer.bias.val());
        let (last, hidden) = self
            .layers
            .split_last()
            .expect("ReluMlp: a perceptron has at least one layer");
        let x = hidden
            .iter()
            .fold(x, |x, layer| activation::relu(affine(x, layer)));
        affine(x, last)
    }

    /// [`Self::forward`] of encoded ray columns, gradients and features side by
    /// side.
    pub fn forward_samples(&self, inputs: SampleInputs) -> Tensor<2> {
        let backend = self.kernels.of(&inputs.rays);
        let fused = backend.sample_network(&self.layers, inputs.clone());
        fused.unwrap_or_else(|| self.forward_samples_by(backend, inputs))
    }

    /// [`Self::forward_samples`] in tensor operations, each as `by` does it: with
    /// [`crate::Plain`], the readable twin of all kernels.
    pub fn forward_samples_by(
        &self,
        by: &(impl NeatBackend + ?Sized),
        inputs: SampleInputs,
    ) -> Tensor<2> {
        let mut columns: Vec<Tensor<2>> = inputs
            .ray_parts
            .iter()
            .map(|(first, width, encoding)| {
                by.encode(*encoding, inputs.rays.clone().narrow(1, *first, *width))
            })
            .collect();
        columns.extend([inputs.gradients, inputs.features]);
        self.forward_by(by, Tensor::cat(columns, 1))
    }
}
