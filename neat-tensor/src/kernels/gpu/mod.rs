//! Kernels for GPUs, where burn's operations would need many: each reads its
//! inputs once and writes its result once.
//!
//! Written in CubeCL, so that one source serves Vulkan, Metal and DX12. The plain
//! tensor operations of [`crate::NeatBackend`] are their oracle, and serve float64.

mod activations;
pub(crate) mod adam;
mod columns;
mod encoding;
pub(crate) mod error_bound;
pub(crate) mod grid;
mod grid_features;
pub(crate) mod operations;
mod products;
mod rows;

use burn::Tensor;
use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl::calculate_cube_count_elemwise;
use burn_cubecl::cubecl::prelude::{CubeCount, CubeDim};
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;

/// What kernels see of a tensor of a GPU, which must not have a gradient.
pub(crate) fn primitive<const D: usize>(tensor: Tensor<D>) -> CubeTensor {
    let primitive = tensor.try_into_primitive::<CubeBackend>();
    primitive.expect("a tensor of a GPU without gradient")
}

/// The tensor of what a kernel wrote.
pub(crate) fn tensor<const D: usize>(primitive: CubeTensor) -> Tensor<D> {
    Tensor::from_primitive::<CubeBackend>(primitive)
}

/// A tensor of `shape` where `like` lies, to be written by a kernel.
fn empty_of(like: &CubeTensor, shape: impl Into<Shape>) -> CubeTensor {
    let (client, device) = (like.client.clone(), like.device.clone());
    empty_device_contiguous_dtype(client, device, shape.into(), like.dtype)
}

/// A launch of one unit per number of `tensor`.
fn elementwise(tensor: &CubeTensor) -> (CubeCount, CubeDim) {
    units(tensor, tensor.shape().num_elements())
}

/// A launch of so many units where `like` lies.
fn units(like: &CubeTensor, count: usize) -> (CubeCount, CubeDim) {
    let dim = CubeDim::new(&like.client, count);
    (calculate_cube_count_elemwise(&like.client, count, dim), dim)
}

/// Runs a kernel with one unit per number of `$out`; the value is `$out`.
macro_rules! launch_elementwise {
    ($kernel:ident, $out:expr, [$($input:expr),+], $($number:expr),+) => {{
        let (count, dim) = elementwise(&$out);
        $kernel::launch(
            &$out.client,
            count,
            dim,
            $($input.into_tensor_arg(),)+
            $out.clone().into_tensor_arg(),
            $($number),+
        );
        $out
    }};
}
use launch_elementwise;

/// A launch of one unit per ray, in groups of which there are at most 65 535.
fn launch_size(rays: usize) -> (CubeCount, CubeDim) {
    const UNITS: u32 = 32;
    let groups = (rays as u32).div_ceil(UNITS);
    (CubeCount::Static(groups, 1, 1), CubeDim::new_1d(UNITS))
}
