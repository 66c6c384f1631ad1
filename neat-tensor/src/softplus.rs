//! Softplus, the activation of signed distance networks.

use burn::tensor::{Tensor, activation};

/// `ln(1 + exp(sharpness · z)) / sharpness`, without overflow for any `z`.
///
/// With the sharpness of 100 that VolSDF uses it is a ReLU rounded within a few
/// hundredths of zero.
pub fn softplus<const D: usize>(z: Tensor<D>, sharpness: f64) -> Tensor<D> {
    // max(z, 0) + ln(1 + exp(-sharpness |z|)) / sharpness, where max(z, 0) is
    // written with the same |z|: reverse mode then gives ½ at zero, as it must.
    let magnitude = z.clone().abs();
    let tail = magnitude
        .clone()
        .mul_scalar(-sharpness)
        .exp()
        .log1p()
        .div_scalar(sharpness);
    (z + magnitude).mul_scalar(0.5) + tail
}

/// `g` times the derivative of [`softplus`] at `z`, which is `sigmoid(sharpness · z)`.
pub fn times_softplus_slope<const D: usize>(
    g: Tensor<D>,
    z: Tensor<D>,
    sharpness: f64,
) -> Tensor<D> {
    g * activation::sigmoid(z.mul_scalar(sharpness))
}
