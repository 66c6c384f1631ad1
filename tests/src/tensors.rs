//! Numbers on the host ↔ tensors of a device.

use crate::golden::Golden;
use burn::tensor::{DType, Device, Tensor, TensorCreationOptions, TensorData};

/// Creates float64 tensors on `device`.
pub fn float64(device: &Device) -> TensorCreationOptions {
    TensorCreationOptions::new(device.clone()).with_dtype(DType::F64)
}

/// A golden tensor in float64, which holds float32 exactly.
pub fn golden_data(golden: &Golden, name: &str) -> TensorData {
    TensorData::new(golden.numbers(name), golden.shape(name))
}

/// A golden tensor on a device, in the device's or the options' type.
pub fn golden_tensor<const D: usize>(
    golden: &Golden,
    name: &str,
    options: impl Into<TensorCreationOptions>,
) -> Tensor<D> {
    Tensor::from_data(golden_data(golden, name), options)
}

/// The elements of a tensor, row-major.
pub fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    tensor
        .try_into_vec_as()
        .expect("a device can be read and floats become float64")
}
