//! The coordinate network of a signed distance field: softplus perceptron over
//! encoded points, with the gradient of its first output with respect to the
//! point.
//!
//! burn's reverse mode is first-order only. The gradient is therefore written
//! as a reverse sweep in plain tensor operations: a function of the weights and
//! of the recorded pre-activations like any other, which reverse mode then
//! differentiates for the eikonal, colour and segment terms.

use crate::encoding::PositionalEncoding;
use crate::linear::{Linear, affine};
use crate::softplus::{softplus, softplus_derivative};
use burn::module::Module;
use burn::tensor::{Int, Tensor};

/// A softplus perceptron over the positional encoding of points.
#[derive(Module, Debug)]
pub struct CoordinateMlp {
    /// The layers, first to last; the last is linear.
    pub layers: Vec<Linear>,
    /// Frequencies of the encoding.
    #[module(skip)]
    pub octaves: usize,
    /// Index of the layer whose input is `[h, encoding] / √2`, if any.
    #[module(skip)]
    pub skip: Option<usize>,
    /// Sharpness of the softplus (100 in VolSDF).
    #[module(skip)]
    pub sharpness: f64,
}

impl CoordinateMlp {
    fn encoding(&self) -> PositionalEncoding {
        PositionalEncoding {
            octaves: self.octaves,
        }
    }

    /// Evaluates the network at `points` `[N, 3]` and keeps what the gradient
    /// needs: callers decide by the outputs where they want it.
    pub fn record(&self, points: Tensor<2>) -> Recorded {
        let weights: Vec<_> = self.layers.iter().map(Linear::effective_weight).collect();
        let encoded = self.encoding().encode(points.clone());
        let last = self.layers.len() - 1;
        let mut pre_activations = Vec::with_capacity(last);
        let mut h = encoded.clone();
        for (l, layer) in self.layers.iter().enumerate() {
            if self.skip == Some(l) {
                h = Tensor::cat(vec![h, encoded.clone()], 1).div_scalar(std::f64::consts::SQRT_2);
            }
            let z = affine(h, weights[l].clone(), layer.bias.val());
            if l < last {
                pre_activations.push(z.clone());
                h = softplus(z, self.sharpness);
            } else {
                h = z;
            }
        }
        Recorded {
            points,
            outputs: h,
            pre_activations,
            weights,
        }
    }

    /// The outputs `[N, out]` alone.
    pub fn forward(&self, points: Tensor<2>) -> Tensor<2> {
        self.record(points).outputs
    }
}

/// A forward pass with everything its gradient needs.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// Where the network was evaluated, `[N, 3]`.
    pub points: Tensor<2>,
    /// Its outputs, `[N, out]`.
    pub outputs: Tensor<2>,
    /// Inputs of the activations, `[N, width]` per hidden layer.
    pre_activations: Vec<Tensor<2>>,
    /// Effective weights, `[out, in]` per layer.
    weights: Vec<Tensor<2>>,
}

impl Recorded {
    /// The same pass at some of its rows only.
    pub fn select(&self, rows: Tensor<1, Int>) -> Self {
        let at_rows = |t: &Tensor<2>| t.clone().select(0, rows.clone());
        Self {
            points: at_rows(&self.points),
            outputs: at_rows(&self.outputs),
            pre_activations: self.pre_activations.iter().map(at_rows).collect(),
            weights: self.weights.clone(),
        }
    }

    /// Gradient of output 0 with respect to the points, `[N, 3]`: the reverse
    /// sweep through `mlp`, which made the pass.
    pub fn gradient(&self, mlp: &CoordinateMlp) -> Tensor<2> {
        let weights = &self.weights;
        let rows = self.points.dims()[0];
        let last = weights.len() - 1;
        let inputs = |l: usize| weights[l].dims()[1];
        // d output 0 / d input of layer l; starts as row 0 of the last weight.
        let mut g = weights[last]
            .clone()
            .narrow(0, 0, 1)
            .expand([rows, inputs(last)]);
        let mut to_encoding: Option<Tensor<2>> = None;
        for l in (0..=last).rev() {
            if l < last {
                let slope = softplus_derivative(self.pre_activations[l].clone(), mlp.sharpness);
                g = (g * slope).matmul(weights[l].clone());
            }
            if mlp.skip == Some(l) {
                let scaled = g.div_scalar(std::f64::consts::SQRT_2);
                let hidden = weights[l - 1].dims()[0];
                to_encoding = Some(scaled.clone().narrow(1, hidden, inputs(l) - hidden));
                g = scaled.narrow(1, 0, hidden);
            }
        }
        if let Some(skipped) = to_encoding {
            g = g + skipped;
        }
        mlp.encoding().pull_back(self.points.clone(), g)
    }
}
