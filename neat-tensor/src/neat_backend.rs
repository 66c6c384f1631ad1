//! What neat asks of a backend beyond burn's operations: one trait, which the distance
//! model, the field, the junctions and the optimiser share.

use crate::encoding::PositionalEncoding;
use crate::grid_encoding::GridEncoding;
use crate::kernels::cpu::KnownRows;
use crate::linear::{Linear, affine};
use crate::row_choice::RowChoice;
use crate::sampling::{DrawNumbers, GridNumbers, RefineNumbers};
use crate::softplus;
use burn::tensor::Tensor;
use std::fmt::Debug;

/// Operations that training needs of a backend beyond burn's own.
///
/// The default is plain tensor operations, which any backend runs in any precision: the
/// readable twin, and the oracle of the tests. A backend overrides what it has kernels
/// for. Where whole networks are no single operation, `None` leads to the operations of
/// [`crate::CoordinateMlp::field_by`] and [`crate::ReluMlp::forward_samples_by`]. Samplers
/// have their twin on the host (`neat_sdf::ray_sampler`), which samples where a backend
/// does not.
pub trait NeatBackend: Debug + Send + Sync {
    /// Whether anything is overridden.
    fn has_kernels(&self) -> bool {
        false
    }

    /// Whether small work is done on the host rather than in tensor operations, because
    /// the host holds the tensors.
    fn works_on_host(&self) -> bool {
        false
    }

    /// Whether samplers' steps have kernels.
    fn places_samples(&self) -> bool {
        false
    }

    /// `x Wᵀ + b` of `x` `[N, in]` and `W` `[out, in]`.
    fn affine(&self, x: Tensor<2>, weight: Tensor<2>, bias: Tensor<1>) -> Tensor<2> {
        affine(x, weight, bias)
    }

    /// `x M` of `x` `[N, k]` and `M` `[k, m]`.
    fn linear(&self, x: Tensor<2>, matrix: Tensor<2>) -> Tensor<2> {
        x.matmul(matrix)
    }

    /// Softplus of `z`: [`softplus::softplus`].
    fn softplus(&self, z: Tensor<2>, sharpness: f64) -> Tensor<2> {
        softplus::softplus(z, sharpness)
    }

    /// `g` times the slope of softplus at `z`: [`softplus::times_softplus_slope`].
    fn times_softplus_slope(&self, g: Tensor<2>, z: Tensor<2>, sharpness: f64) -> Tensor<2> {
        softplus::times_softplus_slope(g, z, sharpness)
    }

    /// `x` `[N, d]`, encoded: [`PositionalEncoding::encode`].
    fn encode(&self, encoding: PositionalEncoding, x: Tensor<2>) -> Tensor<2> {
        encoding.encode(x)
    }

    /// The transposed Jacobian of the encoding at `x` times `gradient`:
    /// [`PositionalEncoding::pull_back`].
    fn pull_back(
        &self,
        encoding: PositionalEncoding,
        x: Tensor<2>,
        gradient: Tensor<2>,
    ) -> Tensor<2> {
        encoding.pull_back(x, gradient)
    }

    /// The features of learned grids at `x` `[N, 3]`: [`GridEncoding::encode`].
    fn encode_grid(&self, grid: &GridEncoding, x: Tensor<2>) -> Tensor<2> {
        grid.encode(x)
    }

    /// The transposed Jacobian of these features at `x` times `gradient`:
    /// [`GridEncoding::pull_back`].
    fn pull_back_grid(&self, grid: &GridEncoding, x: Tensor<2>, gradient: Tensor<2>) -> Tensor<2> {
        grid.pull_back(x, gradient)
    }

    /// The rows `[M, C]` of `values` `[total, C]`: [`RowChoice::pick`].
    fn pick_rows(&self, choice: &RowChoice, values: Tensor<2>) -> Tensor<2> {
        choice.pick(values)
    }

    /// The sums `[total, C]` of `rows` `[M, C]`: [`RowChoice::add_up`].
    fn add_up_rows(&self, choice: &RowChoice, rows: Tensor<2>) -> Tensor<2> {
        choice.add_up(rows)
    }

    /// A softplus network with the gradient of its first output at `points` `[N, 3]`, as
    /// one operation; `None` leaves it to the network's tensor operations.
    fn distance_network(
        &self,
        _network: DistanceNetwork<'_>,
        _points: Tensor<2>,
        _query: FieldQuery,
    ) -> Option<Field> {
        None
    }

    /// A ReLU perceptron of `layers` over samples of a signed distance field, `[N, out]`,
    /// as one operation; `None` leaves it to the network's tensor operations.
    fn sample_network(&self, _layers: &[Linear], _inputs: SampleInputs) -> Option<Tensor<2>> {
        None
    }

    /// Adam's step of a parameter `[P]`: its new value, mean gradient and mean square.
    /// Without `moments` it is the first.
    fn adam(
        &self,
        value: Tensor<1>,
        gradient: Tensor<1>,
        moments: Option<[Tensor<1>; 2]>,
        numbers: AdamNumbers,
    ) -> (Tensor<1>, [Tensor<1>; 2]) {
        adam_step(value, gradient, moments, numbers)
    }

    /// One iteration of VolSDF's Algorithm 1 for `R` rays, one column each. `samples`
    /// `[2 · len, R]` are positions, then distances, `fresh` `[2 · step, R]` the same of
    /// new samples, `betas` `[1, R]`, `control` `[3]` β₀, whether samples are still wanted,
    /// and the iterations so far. Gives all samples, the next positions `[step, R]`, and
    /// the rays' state `[2, R]`: β, and whether the bound holds.
    fn refine_samples(
        &self,
        _samples: Tensor<2>,
        _fresh: Tensor<2>,
        _betas: Tensor<2>,
        _control: Tensor<1>,
        _numbers: RefineNumbers,
    ) -> Option<(Tensor<2>, Tensor<2>, Tensor<2>)> {
        None
    }

    /// The final samples of Algorithm 1, `[R, S]`: near, those at the ascending `u`
    /// `[drawn, R]` of the rendering weights, the columns `kept` `[iterations, extras]` of
    /// those that the bound was computed with, far.
    fn draw_samples(
        &self,
        _samples: Tensor<2>,
        _betas: Tensor<2>,
        _control: Tensor<1>,
        _u: Tensor<2>,
        _kept: Tensor<2>,
        _numbers: DrawNumbers,
    ) -> Option<Tensor<2>> {
        None
    }

    /// Samples along rays `[R, 6]` and their intervals, each `[R, S]`, by a grid of
    /// distances `[nodes³]`, for a density of scale `beta` `[1]`; `noise` `[lookups + S, R]`
    /// moves each within its stratum.
    fn sample_grid(
        &self,
        _rays: Tensor<2>,
        _grid: Tensor<1>,
        _beta: Tensor<1>,
        _noise: Tensor<2>,
        _numbers: GridNumbers,
    ) -> Option<(Tensor<2>, Tensor<2>)> {
        None
    }
}

/// A softplus perceptron over encoded points: see [`crate::CoordinateMlp`].
#[derive(Clone, Copy, Debug)]
pub struct DistanceNetwork<'a> {
    /// The layers, first to last; the last is linear.
    pub layers: &'a [Linear],
    /// Frequencies of the encoding.
    pub octaves: usize,
    /// Learned grids whose features follow the sines, if any.
    pub grid: Option<&'a GridEncoding>,
    /// Index of the layer whose input is `[h, encoding] / √2`, if any.
    pub skip: Option<usize>,
    /// Sharpness of the softplus.
    pub sharpness: f64,
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

/// Per row: what a perceptron over samples of a signed distance field sees.
#[derive(Clone, Debug)]
pub struct SampleInputs {
    /// Columns that carry no gradient in training, `[N, C]`: points, directions.
    pub rays: Tensor<2>,
    /// How they are read, in order: first column, columns, octaves.
    pub ray_parts: Vec<(usize, usize, PositionalEncoding)>,
    /// Gradients of the distance `[N, 3]`.
    pub gradients: Tensor<2>,
    /// Features `[N, F]`.
    pub features: Tensor<2>,
}

/// The numbers of a step, bias corrections included.
#[derive(Clone, Copy, Debug)]
pub struct AdamNumbers {
    /// Decay of the mean gradient.
    pub beta1: f64,
    /// Decay of the mean square.
    pub beta2: f64,
    /// Step size.
    pub rate: f64,
    /// Added to the root of the mean square.
    pub epsilon: f64,
}

/// Plain tensor operations, on any device in any precision.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plain;

impl NeatBackend for Plain {}

/// Adam's step in tensor operations: value, mean gradient and mean square after it.
fn adam_step(
    value: Tensor<1>,
    gradient: Tensor<1>,
    moments: Option<[Tensor<1>; 2]>,
    numbers: AdamNumbers,
) -> (Tensor<1>, [Tensor<1>; 2]) {
    let AdamNumbers { beta1, beta2, .. } = numbers;
    let first = gradient.clone().mul_scalar(1.0 - beta1);
    let second = gradient.square().mul_scalar(1.0 - beta2);
    let (first, second) = match moments {
        Some([m, v]) => (first + m.mul_scalar(beta1), second + v.mul_scalar(beta2)),
        None => (first, second),
    };
    let change = first
        .clone()
        .div(second.clone().sqrt().add_scalar(numbers.epsilon))
        .mul_scalar(numbers.rate);
    (value - change, [first, second])
}
