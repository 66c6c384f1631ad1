//! The rendering integral and its quadrature (paper eq. 1 and 4).

use crate::ray_sampler::RaySamples;
use burn::tensor::{Tensor, TensorData};
use neat_tensor::kernels::cpu::density::passed_shares;
use neat_tensor::{Kernels, RowChoice};

/// Weight of every sample: `w_i = (1 − exp(−δ_i σ_i)) · exp(−Σ_{j<i} δ_j σ_j)`.
///
/// `density` and `deltas` (lengths of the intervals that begin at the samples)
/// are `[R, S]`.
pub fn rendering_weights(density: Tensor<2>, deltas: Tensor<2>) -> Tensor<2> {
    let free_energy = density * deltas;
    let [_, samples] = free_energy.dims();
    // The exclusive running sum as a product with a triangle of ones: parallel
    // over samples on every backend, where a scan is serial or absent.
    let triangle = strictly_upper_ones(samples, &free_energy);
    let passed = free_energy.clone().matmul(triangle);
    let transmittance = passed.neg().exp();
    let opacity = free_energy.neg().exp().neg().add_scalar(1.0);
    opacity * transmittance
}

/// [`rendering_weights`] of capped distances `[R · S]` with a Laplace density, on
/// the host: to decide which samples matter.
pub fn rendering_weights_on_host(sdf: &[f32], samples: &RaySamples, beta: f32) -> Vec<f32> {
    let mut weights = vec![0.0; sdf.len()];
    passed_shares(sdf, &samples.deltas, beta, &mut weights);
    for ray in weights.chunks_mut(samples.per_ray) {
        let mut transmittance = 1.0;
        for weight in ray {
            let passed = *weight;
            *weight = transmittance * (1.0 - passed);
            transmittance *= passed;
        }
    }
    weights
}

fn strictly_upper_ones(n: usize, like: &Tensor<2>) -> Tensor<2> {
    let ones: Vec<f32> = (0..n * n)
        .map(|i| if i / n < i % n { 1.0 } else { 0.0 })
        .collect();
    let options = burn::tensor::TensorCreationOptions::new(like.device()).with_dtype(like.dtype());
    Tensor::from_data(TensorData::new(ones, [n, n]), options)
}

/// `Σ_i w_i v_i` per ray: `weights` `[R, S]`, `values` `[R·S, C]` → `[R, C]`.
pub fn integrate(weights: Tensor<2>, values: Tensor<2>) -> Tensor<2> {
    let [rays, samples] = weights.dims();
    let channels = values.dims()[1];
    let weighted = values * weights.reshape([rays * samples, 1]);
    weighted
        .reshape([rays, samples, channels])
        .sum_dim(1)
        .reshape([rays, channels])
}

/// [`integrate`] over some of the samples only: `weights` `[M, 1]` and `values` `[M, C]` of
/// samples that belong to the rays `ray_of_sample`, `M` of `R` → `[R, C]`.
pub fn integrate_selected(
    kernels: &Kernels,
    weights: Tensor<2>,
    values: Tensor<2>,
    ray_of_sample: &RowChoice,
) -> Tensor<2> {
    let weighted = values * weights;
    kernels.of(&weighted).add_up_rows(ray_of_sample, weighted)
}
