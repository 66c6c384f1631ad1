//! The losses that VolSDF brings: colour, eikonal, and the silhouette term.

use burn::tensor::Tensor;

/// Mean absolute difference of colours over rays and channels, `[R, 3]` each.
pub fn rgb_loss(rendered: Tensor<2>, observed: Tensor<2>) -> Tensor<1> {
    (rendered - observed).abs().mean()
}

/// Mean of `(|∇sdf| − 1)²` over `gradient` `[N, 3]`.
pub fn eikonal_loss(gradient: Tensor<2>) -> Tensor<1> {
    eikonal_terms(gradient).mean()
}

/// [`eikonal_loss`] over those rows only whose `counts` `[N, 1]` is 1, not 0.
pub fn eikonal_loss_where(gradient: Tensor<2>, counts: Tensor<2>) -> Tensor<1> {
    let sum = (eikonal_terms(gradient) * counts.clone()).sum();
    sum / counts.sum().clamp_min(1.0)
}

/// `(|∇sdf| − 1)²` of each row, `[N, 1]`.
fn eikonal_terms(gradient: Tensor<2>) -> Tensor<2> {
    gradient
        .square()
        .sum_dim(1)
        // keeps the derivative of the root finite where the gradient vanishes
        .add_scalar(1e-24)
        .sqrt()
        .sub_scalar(1.0)
        .square()
}

/// Mean absolute error of `sdf` `[N, 1]` at points whose distance from the surface is
/// known: on it as in Geo-NeuS (Fu et al., NeurIPS 2022), or `distance` `[N, 1]` away.
pub fn point_loss(sdf: Tensor<2>, distance: Tensor<2>) -> Tensor<1> {
    (sdf - distance).abs().mean()
}

/// Mean binary cross entropy of the accumulated weight `opacity` `[R, 1]`
/// against the silhouette `mask` `[R, 1]` of zeros and ones.
pub fn mask_loss(opacity: Tensor<2>, mask: Tensor<2>) -> Tensor<1> {
    let p = opacity.clamp(1e-4, 1.0 - 1e-4);
    let outside = mask.clone().neg().add_scalar(1.0);
    let log_likelihood = mask * p.clone().log() + outside * p.neg().add_scalar(1.0).log();
    log_likelihood.mean().neg()
}
