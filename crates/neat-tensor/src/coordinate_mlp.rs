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

/// At which rows the gradient with respect to the point is wanted.
#[derive(Clone, Debug)]
pub enum GradientRows {
    /// Nowhere.
    None,
    /// At every point.
    All,
    /// At these row indices `[M]`.
    Selected(Tensor<1, Int>),
}

/// What a coordinate network says of `N` points.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// All outputs `[N, out]`; column 0 is the signed distance.
    pub outputs: Tensor<2>,
    /// Gradient of column 0 with respect to the point, `[M, 3]`, if asked for.
    pub gradient: Option<Tensor<2>>,
}

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

    /// Evaluates the network at `points` `[N, 3]`, and its gradient at `rows`.
    pub fn evaluate(&self, points: Tensor<2>, rows: GradientRows) -> Evaluation {
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
        let gradient = match rows {
            GradientRows::None => None,
            GradientRows::All => Some(self.gradient(points, &pre_activations, &weights)),
            GradientRows::Selected(rows) => {
                let at_rows: Vec<_> = pre_activations
                    .into_iter()
                    .map(|z| z.select(0, rows.clone()))
                    .collect();
                Some(self.gradient(points.select(0, rows), &at_rows, &weights))
            }
        };
        Evaluation {
            outputs: h,
            gradient,
        }
    }

    /// The outputs `[N, out]` alone.
    pub fn forward(&self, points: Tensor<2>) -> Tensor<2> {
        self.evaluate(points, GradientRows::None).outputs
    }

    /// Reverse sweep from output 0 to the points `[M, 3]`.
    fn gradient(
        &self,
        points: Tensor<2>,
        pre_activations: &[Tensor<2>],
        weights: &[Tensor<2>],
    ) -> Tensor<2> {
        let rows = points.dims()[0];
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
                g = (g * softplus_derivative(pre_activations[l].clone(), self.sharpness))
                    .matmul(weights[l].clone());
            }
            if self.skip == Some(l) {
                let scaled = g.div_scalar(std::f64::consts::SQRT_2);
                let hidden = weights[l - 1].dims()[0];
                to_encoding = Some(scaled.clone().narrow(1, hidden, inputs(l) - hidden));
                g = scaled.narrow(1, 0, hidden);
            }
        }
        if let Some(skipped) = to_encoding {
            g = g + skipped;
        }
        self.encoding().pull_back(points, g)
    }
}
