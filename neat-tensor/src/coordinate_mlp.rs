//! The coordinate network of a signed distance field: softplus perceptron over
//! encoded points (sines, and learned grids where there are any), with the gradient of its first output with respect to the
//! point.
//!
//! burn's reverse mode is first-order only. The gradient is therefore written
//! as a reverse sweep in plain tensor operations: a function of the weights and
//! of the recorded pre-activations like any other, which reverse mode then
//! differentiates for the eikonal, colour and segment terms.
//!
//! On the CPU in float32, [`CoordinateMlp::field`] is one operation instead
//! ([`crate::kernels::cpu`]), which these tensor operations explain and check.

use crate::encoding::PositionalEncoding;
use crate::grid_encoding::GridEncoding;
use crate::kernel_choice::Kernels;
use crate::kernels::cpu::KnownPass;
use crate::kernels::cpu::softplus_network::SoftplusNetwork;
use crate::linear::{Linear, flat_parameters};
use crate::neat_backend::{DistanceNetwork, Field, FieldQuery, NeatBackend};
use burn::module::Module;
use burn::tensor::Tensor;
use pulp::Arch;

/// A softplus perceptron over the positional encoding of points.
#[derive(Module, Debug)]
pub struct CoordinateMlp {
    /// The layers, first to last; the last is linear.
    pub layers: Vec<Linear>,
    /// Frequencies of the encoding.
    #[module(skip)]
    pub octaves: usize,
    /// Learned grids whose features follow the sines in the encoding, if any.
    pub grid: Option<GridEncoding>,
    /// Index of the layer whose input is `[h, encoding] / √2`, if any.
    #[module(skip)]
    pub skip: Option<usize>,
    /// Sharpness of the softplus (100 in VolSDF).
    #[module(skip)]
    pub sharpness: f64,
    /// Which operations it runs.
    #[module(skip)]
    pub kernels: Kernels,
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
        self.record_by(self.kernels.of(&points), points)
    }

    fn record_by(&self, by: &(impl NeatBackend + ?Sized), points: Tensor<2>) -> Recorded {
        let weights: Vec<_> = self.layers.iter().map(Linear::effective_weight).collect();
        let mut encoded = by.encode(self.encoding(), points.clone());
        if let Some(grid) = &self.grid {
            encoded = Tensor::cat(vec![encoded, by.encode_grid(grid, points.clone())], 1);
        }
        let last = self.layers.len() - 1;
        let mut pre_activations = Vec::with_capacity(last);
        let mut h = encoded.clone();
        for (l, layer) in self.layers.iter().enumerate() {
            if self.skip == Some(l) {
                h = Tensor::cat(vec![h, encoded.clone()], 1).div_scalar(std::f64::consts::SQRT_2);
            }
            let z = by.affine(h, weights[l].clone(), layer.bias.val());
            if l < last {
                pre_activations.push(z.clone());
                h = by.softplus(z, self.sharpness);
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

impl CoordinateMlp {
    /// First output, its gradient and the other outputs at `points` `[N, 3]`, as
    /// far as `query` wants them.
    pub fn field(&self, points: Tensor<2>, query: FieldQuery) -> Field {
        let backend = self.kernels.of(&points);
        let fused = backend.distance_network(self.network(), points.clone(), query.clone());
        fused.unwrap_or_else(|| self.field_by(backend, points, query))
    }

    /// [`Self::field`] in tensor operations, each as `by` does it: with
    /// [`crate::Plain`], the readable twin of all kernels.
    pub fn field_by(
        &self,
        by: &(impl NeatBackend + ?Sized),
        points: Tensor<2>,
        query: FieldQuery,
    ) -> Field {
        let full_rows = points.dims()[0] - query.light_rows;
        let pass = self.record_by(by, points);
        let outputs = pass.outputs.dims()[1];
        Field {
            first: pass.outputs.clone().narrow(1, 0, 1),
            gradient: pass.head(full_rows).gradient_by(by, self),
            others: query.others.then(|| {
                let full = pass.outputs.narrow(0, 0, full_rows);
                full.narrow(1, 1, outputs - 1)
            }),
        }
    }

    /// The network on the host, for queries without gradients: where it computes
    /// on the CPU in float32.
    pub fn on_host(&self) -> Option<SoftplusNetwork<'static>> {
        let parameters = flat_parameters(&self.layers).detach();
        if !self.kernels.of(&parameters).works_on_host() {
            return None;
        }
        let parameters = parameters.into_data();
        let parameters = parameters.as_slice().ok()?;
        let table = match &self.grid {
            Some(grid) => grid.table.val().detach().into_data().try_into_vec().ok()?,
            None => Vec::new(),
        };
        Some(SoftplusNetwork::new(
            Arch::new(),
            &self.network().shape(),
            parameters,
            table,
        ))
    }

    /// A pass of `network`, which is this one [`Self::on_host`], over `points` `[N · 3]`,
    /// where there is room to keep it.
    pub fn known_pass(&self, network: &SoftplusNetwork<'_>, points: &[f32]) -> Option<KnownPass> {
        KnownPass::run(network, points, self.kernels.memory())
    }

    fn network(&self) -> DistanceNetwork<'_> {
        DistanceNetwork {
            layers: &self.layers,
            octaves: self.octaves,
            grid: self.grid.as_ref(),
            skip: self.skip,
            sharpness: self.sharpness,
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
        self.gradient_by(mlp.kernels.of(&self.points), mlp)
    }

    fn gradient_by(&self, by: &(impl NeatBackend + ?Sized), mlp: &CoordinateMlp) -> Tensor<2> {
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
                let slope = by.times_softplus_slope(g, z, mlp.sharpness);
                g = by.linear(slope, weights[l].clone());
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
        let points = self.points.clone();
        let Some(grid) = &mlp.grid else {
            return by.pull_back(mlp.encoding(), points, g);
        };
        let waves = mlp.encoding().output_width(3);
        let of_grid = g.clone().narrow(1, waves, grid.shape.width());
        by.pull_back(mlp.encoding(), points.clone(), g.narrow(1, 0, waves))
            + by.pull_back_grid(grid, points, of_grid)
    }
}
