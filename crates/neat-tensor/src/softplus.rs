//! Softplus, the activation of signed distance networks.

use burn::tensor::{Tensor, activation};

/// `ln(1 + exp(sharpness · z)) / sharpness`, without overflow for any `z`.
///
/// With the sharpness of 100 that VolSDF uses it is a ReLU rounded within a few
/// hundredths of zero.
pub fn softplus<const D: usize>(z: Tensor<D>, sharpness: f64) -> Tensor<D> {
    // max(z, 0) + ln(1 + exp(-sharpness |z|)) / sharpness
    let tail = z
        .clone()
        .abs()
        .mul_scalar(-sharpness)
        .exp()
        .log1p()
        .div_scalar(sharpness);
    activation::relu(z) + tail
}

/// The derivative of [`softplus`] with respect to `z`: `sigmoid(sharpness · z)`.
pub fn softplus_derivative<const D: usize>(z: Tensor<D>, sharpness: f64) -> Tensor<D> {
    activation::sigmoid(z.mul_scalar(sharpness))
}
