//! Numbers on their way between the host and tensors.

use burn::tensor::{Device, Int, Tensor, TensorData};
use std::ops::Range;

/// The values of a tensor on the host, row-major, as float32.
pub fn host_vec<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor
        .detach()
        .into_data()
        .convert::<f32>()
        .try_into_vec_as()
        .expect("host_vec: just converted to float32")
}

/// The rows of a tensor `[N, 3]` on the host.
pub fn host_points(tensor: Tensor<2>) -> Vec<[f32; 3]> {
    host_vec(tensor).as_chunks().0.to_vec()
}

/// Points as a tensor `[N, 3]`.
pub fn point_tensor(points: &[[f32; 3]], device: &Device) -> Tensor<2> {
    Tensor::from_data(
        TensorData::new(points.as_flattened().to_vec(), [points.len(), 3]),
        device,
    )
}

/// Indices as a tensor `[N]`.
pub fn index_tensor(indices: impl Iterator<Item = usize>, device: &Device) -> Tensor<1, Int> {
    let indices: Vec<i64> = indices.map(|i| i as i64).collect();
    let len = indices.len();
    Tensor::from_data(TensorData::new(indices, [len]), device)
}

/// A constant without gradient, for the graph of `device` if that keeps one.
pub fn constant_on(device: &Device, tensor: &Tensor<2>) -> Tensor<2> {
    if device.is_autodiff() {
        Tensor::from_inner(tensor.clone())
    } else {
        tensor.clone()
    }
}

/// Vectors that are read from their device in one transfer: every read waits for all
/// work that was given to the device before.
#[derive(Debug, Default)]
pub struct Transfer {
    parts: Vec<Tensor<1>>,
    len: usize,
}

impl Transfer {
    /// Adds a vector, without gradient; returns where its numbers will be.
    pub fn add(&mut self, part: Tensor<1>) -> Range<usize> {
        let place = self.len..self.len + part.dims()[0];
        self.len = place.end;
        self.parts.push(part);
        place
    }

    /// All numbers, one vector after the other.
    ///
    /// # Panics
    /// If nothing was added.
    pub fn read(self) -> Vec<f32> {
        host_vec(Tensor::cat(self.parts, 0))
    }
}
