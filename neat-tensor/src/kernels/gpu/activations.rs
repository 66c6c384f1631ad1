//! Softplus and its slopes, one kernel each.
//!
//! Plain operations need nine for the value alone. The slope is the logistic
//! function `s = 1 / (1 + exp(−βz))`; its own slope is `β s (1 − s)`. Tensors are float32,
//! all of the same shape.

use super::{elementwise, empty_of, launch_elementwise};
use burn::backend::TensorMetadata;
use burn_cubecl::cubecl::{self, prelude::*};
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

#[cube]
fn logistic(z: f32, sharpness: f32) -> f32 {
    // Of the magnitude, so that the exponential stays finite.
    let tail = f32::exp(-f32::abs(z) * sharpness);
    let large = 1.0 / (1.0 + tail);
    if z < 0.0 { 1.0 - large } else { large }
}

#[cube(launch)]
fn softplus_kernel(z: &Tensor<f32>, out: &mut Tensor<f32>, sharpness: f32) {
    if ABSOLUTE_POS < out.len() {
        let z = z[ABSOLUTE_POS];
        let tail = f32::log1p(f32::exp(-f32::abs(z) * sharpness)) / sharpness;
        out[ABSOLUTE_POS] = f32::max(z, 0.0) + tail;
    }
}

#[cube(launch)]
fn slope_kernel(g: &Tensor<f32>, z: &Tensor<f32>, out: &mut Tensor<f32>, sharpness: f32) {
    if ABSOLUTE_POS < out.len() {
        out[ABSOLUTE_POS] = g[ABSOLUTE_POS] * logistic(z[ABSOLUTE_POS], sharpness);
    }
}

#[cube(launch)]
fn curvature_kernel(
    a: &Tensor<f32>,
    g: &Tensor<f32>,
    z: &Tensor<f32>,
    out: &mut Tensor<f32>,
    sharpness: f32,
) {
    if ABSOLUTE_POS < out.len() {
        let slope = logistic(z[ABSOLUTE_POS], sharpness);
        let curvature = sharpness * slope * (1.0 - slope);
        out[ABSOLUTE_POS] = a[ABSOLUTE_POS] * g[ABSOLUTE_POS] * curvature;
    }
}

/// Softplus of `z`.
pub(super) fn softplus(inputs: [CubeTensor; 1], sharpness: f32) -> CubeTensor {
    let [z] = inputs.map(into_contiguous);
    let out = empty_of(&z, z.shape());
    launch_elementwise!(softplus_kernel, out, [z], sharpness)
}

/// `g` times the slope of softplus at `z`.
pub(super) fn slope(inputs: [CubeTensor; 2], sharpness: f32) -> CubeTensor {
    let [g, z] = inputs.map(into_contiguous);
    let out = empty_of(&z, z.shape());
    launch_elementwise!(slope_kernel, out, [g, z], sharpness)
}

/// `a` times `g` times the slope of the slope at `z`.
pub(super) fn curvature(inputs: [CubeTensor; 3], sharpness: f32) -> CubeTensor {
    let [a, g, z] = inputs.map(into_contiguous);
    let out = empty_of(&z, z.shape());
    launch_elementwise!(curvature_kernel, out, [a, g, z], sharpness)
}
