//! Adam's step of one parameter as one kernel.

use super::{elementwise, empty_like};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl::{self, prelude::*};
use burn_cubecl::kernel::into_contiguous;

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

/// The optimiser as an operation of a backend; tensors are float32, all of the same
/// shape.
#[backend_extension(Cube)]
pub trait DeviceAdam: Backend {
    /// Parameter, mean gradient and mean square after a step.
    fn device_adam(
        value: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        numbers: StepNumbers,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
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

impl DeviceAdam for CubeBackend {
    fn device_adam(
        value: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        numbers: StepNumbers,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let [value, gradient, first, second] =
            [value, gradient, first, second].map(into_contiguous);
        let [new_value, new_first, new_second] = std::array::from_fn(|_| empty_like(&value));
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
        (new_value, new_first, new_second)
    }
}

/// [`DeviceAdam::device_adam`] for tensors of a GPU.
pub(crate) fn step<const D: usize>(
    value: burn::Tensor<D>,
    gradient: burn::Tensor<D>,
    [first, second]: [burn::Tensor<D>; 2],
    numbers: StepNumbers,
) -> (burn::Tensor<D>, [burn::Tensor<D>; 2]) {
    let (value, first, second) = <Dispatch as DeviceAdam>::device_adam(
        value.into_dispatch(),
        gradient.into_dispatch(),
        first.into_dispatch(),
        second.into_dispatch(),
        numbers,
    );
    let moments = [
        burn::Tensor::from_dispatch(first),
        burn::Tensor::from_dispatch(second),
    ];
    (burn::Tensor::from_dispatch(value), moments)
}
