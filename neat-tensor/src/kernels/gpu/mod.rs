//! Kernels for GPUs, where burn's operations would need many: each reads its
//! inputs once and writes its result once.
//!
//! Written in CubeCL, so that one source serves Vulkan, Metal and DX12. The plain
//! tensor operations beside them stay as their oracle and for float64.

pub(crate) mod activations;
pub(crate) mod adam;
mod columns;
pub(crate) mod encoding;
mod error_bound;
mod grid;
pub(crate) mod sampling;

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::cubecl::calculate_cube_count_elemwise;
use burn_cubecl::cubecl::prelude::{CubeCount, CubeDim};
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;

/// A tensor of the same shape and device as `like`, to be written by a kernel.
fn empty_like(like: &CubeTensor) -> CubeTensor {
    empty_of(like, like.shape())
}

/// A tensor of `shape` where `like` lies, to be written by a kernel.
fn empty_of(like: &CubeTensor, shape: impl Into<Shape>) -> CubeTensor {
    let (client, device) = (like.client.clone(), like.device.clone());
    empty_device_contiguous_dtype(client, device, shape.into(), like.dtype)
}

/// A launch of one unit per number of `tensor`.
fn elementwise(tensor: &CubeTensor) -> (CubeCount, CubeDim) {
    let units = tensor.shape().num_elements();
    let dim = CubeDim::new(&tensor.client, units);
    (
        calculate_cube_count_elemwise(&tensor.client, units, dim),
        dim,
    )
}
