//! Affine layers, plain or with weight normalisation.

use crate::kernels::cpu::layers::LayerShape;
use crate::random::standard_normal;
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, RngExt};

/// A network cannot have the size that its configuration asks for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NetworkSizeError(pub &'static str);

/// Initial weights of one layer, row-major `[out, in]`, before normalisation.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearInit {
    /// `[out, in]`, row-major.
    pub weight: Vec<f32>,
    /// `[out]`.
    pub bias: Vec<f32>,
}

impl LinearInit {
    /// Uniform in ±1/√in for weights and biases: PyTorch's default for a linear
    /// layer, which the published radiance, attraction and junction networks keep.
    pub fn uniform(inputs: usize, outputs: usize, rng: &mut impl Rng) -> Self {
        let bound = 1.0 / (inputs as f64).sqrt();
        let mut draw = |n| -> Vec<f32> {
            (0..n)
                .map(|_| ((rng.random::<f64>() * 2.0 - 1.0) * bound) as f32)
                .collect()
        };
        Self {
            weight: draw(inputs * outputs),
            bias: draw(outputs),
        }
    }

    /// Normal weights with the given deviation around `mean`, constant bias.
    pub fn normal(
        inputs: usize,
        outputs: usize,
        mean: f64,
        deviation: f64,
        bias: f32,
        rng: &mut impl Rng,
    ) -> Self {
        Self {
            weight: (0..inputs * outputs)
                .map(|_| (mean + deviation * standard_normal(rng)) as f32)
                .collect(),
            bias: vec![bias; outputs],
        }
    }
}

/// `y = x Wᵀ + b`.
///
/// With weight normalisation (Salimans & Kingma 2016) `W = g v / ‖v‖` per output
/// row; the parameters are `weight_v` and `weight_g`. Without it the parameter is
/// `weight`.
#[derive(Module, Debug)]
pub struct Linear {
    /// The plain weight `[out, in]`.
    pub weight: Option<Param<Tensor<2>>>,
    /// Direction `v` of the normalised weight, `[out, in]`.
    pub weight_v: Option<Param<Tensor<2>>>,
    /// Length `g` of each row of the normalised weight, `[out, 1]`.
    pub weight_g: Option<Param<Tensor<2>>>,
    /// `[out]`.
    pub bias: Param<Tensor<1>>,
}

impl Linear {
    /// A layer with the given initial values. Weight normalisation starts with
    /// `g = ‖v‖`, so that the effective weight is the given one.
    pub fn new(
        init: &LinearInit,
        inputs: usize,
        outputs: usize,
        weight_norm: bool,
        device: &Device,
    ) -> Self {
        let matrix = |values: Vec<f32>, shape: [usize; 2]| {
            Param::from_data(TensorData::new(values, shape), device)
        };
        let bias = Param::from_data(TensorData::new(init.bias.clone(), [outputs]), device);
        let weight = matrix(init.weight.clone(), [outputs, inputs]);
        if !weight_norm {
            return Self {
                weight: Some(weight),
                weight_v: None,
                weight_g: None,
                bias,
            };
        }
        let lengths = init
            .weight
            .chunks(inputs)
            .map(|row| row.iter().map(|w| w * w).sum::<f32>().sqrt())
            .collect();
        Self {
            weight: None,
            weight_v: Some(weight),
            weight_g: Some(matrix(lengths, [outputs, 1])),
            bias,
        }
    }

    /// The matrix `W` that multiplies the input, `[out, in]`.
    pub fn effective_weight(&self) -> Tensor<2> {
        match (&self.weight, &self.weight_v, &self.weight_g) {
            (Some(weight), _, _) => weight.val(),
            (None, Some(v), Some(g)) => {
                let v = v.val();
                let length = v.clone().square().sum_dim(1).sqrt();
                v * (g.val() / length)
            }
            _ => unreachable!("Linear::new sets either `weight` or both of `weight_v`, `weight_g`"),
        }
    }

    /// The layer with its weight (not its bias) multiplied by `factor`.
    pub fn scaled(mut self, factor: f64) -> Self {
        let scale = |param: Param<Tensor<2>>| {
            param.map(|w| {
                let tracked = w.is_require_grad();
                let scaled = w.inner().mul_scalar(factor);
                if tracked {
                    Tensor::from_inner(scaled).require_grad()
                } else {
                    scaled
                }
            })
        };
        self.weight = self.weight.map(scale);
        self.weight_g = self.weight_g.map(scale);
        self
    }

    /// `[N, in]` → `[N, out]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        affine(x, self.effective_weight(), self.bias.val())
    }
}

/// `x Wᵀ + b` with `W` `[out, in]`.
pub(crate) fn affine(x: Tensor<2>, weight: Tensor<2>, bias: Tensor<1>) -> Tensor<2> {
    x.matmul(weight.transpose()) + bias.unsqueeze()
}

/// Inputs and outputs of each layer.
pub(crate) fn layer_shapes(layers: &[Linear]) -> Vec<LayerShape> {
    layers
        .iter()
        .map(|layer| {
            let [outputs, inputs] = match (&layer.weight, &layer.weight_v) {
                (Some(weight), _) | (None, Some(weight)) => weight.dims(),
                _ => unreachable!("Linear::new sets `weight` or `weight_v`"),
            };
            LayerShape { inputs, outputs }
        })
        .collect()
}

/// Effective weight and bias of each layer, one after the other.
pub(crate) fn flat_parameters(layers: &[Linear]) -> Tensor<1> {
    let flat = layers.iter().flat_map(|layer| {
        let weight = layer.effective_weight();
        let count = weight.shape().num_elements();
        [weight.reshape([count]), layer.bias.val()]
    });
    Tensor::cat(flat.collect(), 0)
}
