//! Adam's step of one parameter as one kernel.

use super::{elementwise, empty_of};
use burn::backend::TensorMetadata;
use burn_cubecl::cubecl::{self, prelude::*};
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

/// The numbers of a step, bias corrections included.
#[derive(Clone, Copy, Debug)]
pub struct StepNumbers {
    /// Decay of the mean gradient.
    pub beta1: f32,
    /// Decay of the mean square.
    pub beta2: f32,
    /// `1 − beta1`, rounded after the difference.
    pub rest1: f32,
    /// `1 − beta2`.
    pub rest2: f32,
    /// Step size.
    pub rate: f32,
    /// Added to the root of the mean square.
    pub epsilon: f32,
}

#[cube(launch)]
#[expect(
    clippy::too_many_arguments,
    reason = "a kernel's arguments are its bindings"
)]
fn adam_kernel(
    value: &Tensor<f32>,
    gradient: &Tensor<f32>,
    first: &Tensor<f32>,
    second: &Tensor<f32>,
    new_value: &mut Tensor<f32>,
    new_first: &mut Tensor<f32>,
    new_second: &mut Tensor<f32>,
    beta1: f32,
    beta2: f32,
    rest1: f32,
    rest2: f32,
    rate: f32,
    epsilon: f32,
) {
    if ABSOLUTE_POS < new_value.len() {
        let g = gradient[ABSOLUTE_POS];
        let m = g * rest1 + first[ABSOLUTE_POS] * beta1;
        let v = g * g * rest2 + second[ABSOLUTE_POS] * beta2;
        new_first[ABSOLUTE_POS] = m;
        new_second[ABSOLUTE_POS] = v;
        new_value[ABSOLUTE_POS] = value[ABSOLUTE_POS] - m / (f32::sqrt(v) + epsilon) * rate;
    }
}

/// Parameter, mean gradient and mean square after a step; tensors are float32, all of the
/// same shape.
pub(crate) fn step(
    [value, gradient, first, second]: [CubeTensor; 4],
    numbers: StepNumbers,
) -> [CubeTensor; 3] {
    let [value, gradient, first, second] = [value, gradient, first, second].map(into_contiguous);
    let [new_value, new_first, new_second] =
        std::array::from_fn(|_| empty_of(&value, value.shape()));
    let (count, dim) = elementwise(&new_value);
    adam_kernel::launch(
        &new_value.client,
        count,
        dim,
        value.into_tensor_arg(),
        gradient.into_tensor_arg(),
        first.into_tensor_arg(),
        second.into_tensor_arg(),
        new_value.clone().into_tensor_arg(),
        new_first.clone().into_tensor_arg(),
        new_second.clone().into_tensor_arg(),
        numbers.beta1,
        numbers.beta2,
        numbers.rest1,
        numbers.rest2,
        numbers.rate,
        numbers.epsilon,
    );
    [new_value, new_first, new_second]
}
