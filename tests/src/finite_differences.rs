//! Gradients by central differences, the oracle of every hand-written one.

use crate::backends::flex;
use crate::comparison::assert_relatively_close;
use crate::tensors::{float64, numbers};
use burn::tensor::{Tensor, TensorData};
use neat_tensor::random::{Purpose, standard_normal, stream};

/// Half the distance of the two evaluations: in float64 the smallest step whose
/// rounding error (1e-16 / step) still lies below every tolerance here.
pub const STEP: f64 = 1e-6;

/// Normally distributed numbers; `seed` tells draws apart.
pub fn normal(count: usize, seed: u64) -> Vec<f64> {
    let mut rng = stream(seed, Purpose::Weights, 0);
    (0..count).map(|_| standard_normal(&mut rng)).collect()
}

/// A float64 tensor on flex without gradient.
pub fn constant<const D: usize>(values: Vec<f64>, shape: [usize; D]) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, shape), float64(&flex()))
}

/// The derivative of `f` along each element of `x`.
pub fn central_differences(x: &[f64], f: impl Fn(Vec<f64>) -> f64) -> Vec<f64> {
    let moved = |i: usize, by: f64| {
        let mut x = x.to_vec();
        x[i] += by;
        f(x)
    };
    (0..x.len())
        .map(|i| (moved(i, STEP) - moved(i, -STEP)) / (2.0 * STEP))
        .collect()
}

/// Compares the reverse-mode gradient of the scalar `f` at `x` with central
/// differences.
#[track_caller]
pub fn assert_differentiates<const D: usize>(
    what: &str,
    x: &[f64],
    shape: [usize; D],
    tolerance: f64,
    f: impl Fn(Tensor<D>) -> Tensor<1>,
) {
    let leaf = constant(x.to_vec(), shape).require_grad();
    let gradients = f(leaf.clone()).backward();
    let gradient = numbers(leaf.grad(&gradients).expect("f depends on x"));
    let differences = central_differences(x, |x| numbers(f(constant(x, shape)))[0]);
    assert_relatively_close(what, &gradient, &differences, tolerance);
}
