//! Kernels for GPUs, where burn's operations would need many: each reads its
//! inputs once and writes its result once.
//!
//! Written in CubeCL, so that one source serves Vulkan, Metal and DX12. The plain
//! tensor operations beside them stay as their oracle and for float64.

pub(crate) mod activations;
pub(crate) mod adam;
pub(crate) mod encoding;

use burn::backend::TensorMetadata;
use burn::tensor::{DType, Device, Shape};
use burn_cubecl::cubecl::calculate_cube_count_elemwise;
use burn_cubecl::cubecl::prelude::{CubeCount, CubeDim};
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;

/// Whether float32 tensors of `device` go through these kernels: it is a GPU, and
/// [`crate::fused::set_enabled`] did not turn them off.
pub fn has_kernels(device: &Device) -> bool {
    use burn::backend::DispatchDevice;
    let on_gpu = matches!(
        device.clone().inner().as_dispatch(),
        DispatchDevice::Cube(_)
    );
    on_gpu && crate::fused::enabled()
}

/// Whether tensors of `device` and `dtype` go through these kernels.
pub(crate) fn takes_kernels(device: &Device, dtype: DType) -> bool {
    dtype == DType::F32 && has_kernels(device)
}

/// A tensor of the same shape and device as `like`, to be written by a kernel.
fn empty_like(like: &CubeTensor) -> CubeTensor {
    empty_of(like, like.shape())
}

/// A tensor of `shape` where `like` lies, to be written by a kernel.
pub fn empty_of(like: &CubeTensor, shape: impl Into<Shape>) -> CubeTensor {
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
