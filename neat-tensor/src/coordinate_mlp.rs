//! The coordinate network of a signed distance field: softplus perceptron over
//! encoded points, with the gradient of its first output with respect to the
//! point.
//!
//! burn's reverse mode is first-order only. The gradient is therefore written
//! as a reverse sweep in plain tensor operations: a function of the weights and
//! of the recorded pre-activations like any other, which reverse mode then
//! differentiates for the eikonal, colour and segment terms.
//!
//! On the CPU in float32, [`CoordinateMlp::field`] is one fused operation instead
//! ([`crate::fused`]), which these tensor operations explain and check.

use crate::encoding::PositionalEncoding;
use crate::fused::{self, KnownRows, SoftplusRequest};
use crate::kernels::softplus_network::{SoftplusNetwork, SoftplusShape};
use crate::linear::{Linear, affine, flat_parameters, layer_shapes};
use crate::softplus::{softplus, times_softplus_slope};
use burn::module::Module;
use burn::tensor::{DType, Tensor};
use pulp::Arch;

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

/// Which rows of a query want what.
#[derive(Clone, Debug, Default)]
pub struct FieldQuery {
    /// Of so many last rows only the first output is wanted; the others are full
    /// rows.
    pub light_rows: usize,
    /// What an earlier pass with the same parameters says of the rows: a fused
    /// operation does not compute it again.
    pub known: Option<KnownRows>,
    /// Whether full rows want the outputs beyond the first.
    pub others: bool,
}

/// What a network says of `N` points, the first `H` of them full rows.
#[derive(Clone, Debug)]
pub struct Field {
    /// First output `[N, 1]`.
    pub first: Tensor<2>,
    /// Its gradient with respect to the point `[H, 3]`.
    pub gradient: Tensor<2>,
    /// The other outputs `[H, out − 1]`, if asked for.
    pub others: Option<Tensor<2>>,
}

impl CoordinateMlp {
    /// First output, its gradient and the other outputs at `points` `[N, 3]`, as
    /// far as `query` wants them.
    pub fn field(&self, points: Tensor<2>, query: FieldQuery) -> Field {
        if fused::takes_fused(&points) {
            self.fused_field(points, query)
        } else {
            self.plain_field(points, query)
        }
    }

    /// [`Self::field`] in plain tensor operations, on any device: the readable
    /// twin of the fused operation.
    pub fn plain_field(&self, points: Tensor<2>, query: FieldQuery) -> Field {
        let full_rows = points.dims()[0] - query.light_rows;
        let pass = self.record(points);
        let outputs = pass.outputs.dims()[1];
        Field {
            first: pass.outputs.clone().narrow(1, 0, 1),
            gradient: pass.head(full_rows).gradient(self),
            others: query.others.then(|| {
                let full = pass.outputs.narrow(0, 0, full_rows);
                full.narrow(1, 1, outputs - 1)
            }),
        }
    }

    fn fused_field(&self, points: Tensor<2>, query: FieldQuery) -> Field {
        let request = SoftplusRequest {
            shape: self.shape(),
            full_rows: points.dims()[0] - query.light_rows,
            others: query.others,
            known: query.known,
        };
        let (first, gradient, others) =
            fused::softplus_network(points, flat_parameters(&self.layers), request);
        Field {
            first,
            gradient,
            others,
        }
    }

    /// The network on the host, for queries without gradients: where it computes
    /// on the CPU in float32.
    pub fn on_host(&self) -> Option<SoftplusNetwork> {
        let parameters = flat_parameters(&self.layers).detach();
        if parameters.dtype() != DType::F32 || !fused::is_fused(&parameters.device()) {
            return None;
        }
        let parameters = parameters.into_data();
        let parameters = parameters.as_slice().ok()?;
        Some(SoftplusNetwork::new(Arch::new(), &self.shape(), parameters))
    }

    fn shape(&self) -> SoftplusShape {
        SoftplusShape {
            layers: layer_shapes(&self.layers),
            octaves: self.octaves,
            skip: self.skip,
            sharpness: self.sharpness as f32,
        }
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
    /// The same pass at its first `rows` rows only.
    fn head(&self, rows: usize) -> Self {
        let head = |t: &Tensor<2>| t.clone().narrow(0, 0, rows);
        Self {
            points: head(&self.points),
            outputs: head(&self.outputs),
            pre_activations: self.pre_activations.iter().map(head).collect(),
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
                let z = self.pre_activations[l].clone();
                g = times_softplus_slope(g, z, mlp.sharpness).matmul(weights[l].clone());
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
