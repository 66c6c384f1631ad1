//! Density, rendering weights and the rendering integral.

use burn::tensor::Tensor;
use neat_sdf::density::laplace_density;
use neat_sdf::volume_rendering::{integrate, integrate_selected, rendering_weights};
use neat_tensor::{Kernels, RowChoice};
use neat_tests::comparison::assert_close;
use neat_tests::finite_differences::{assert_differentiates, constant, normal};
use neat_tests::tensors::numbers;

const RAYS: usize = 3;
const SAMPLES: usize = 7;
const SHAPE: [usize; 2] = [RAYS, SAMPLES];

fn fixed() -> Tensor<2> {
    constant(normal(RAYS * SAMPLES, 5), SHAPE)
}

/// Positive numbers around `scale`.
fn positive(scale: f64, seed: u64) -> Vec<f64> {
    let exponents = normal(RAYS * SAMPLES, seed);
    exponents.iter().map(|x| scale * (0.5 * x).exp()).collect()
}

#[test]
fn density() {
    let sdf: Vec<f64> = normal(RAYS * SAMPLES, 1).iter().map(|d| 0.1 * d).collect();
    for beta in [0.2, 0.02] {
        let fixed_beta = || constant(vec![beta], [1]);
        assert_differentiates("d sdf", &sdf, SHAPE, 1e-6, |sdf| {
            (laplace_density(sdf, fixed_beta()) * fixed()).sum()
        });
        let sdf = constant(sdf.clone(), SHAPE);
        assert_differentiates("d β", &[beta], [1], 1e-6, |beta| {
            (laplace_density(sdf.clone(), beta) * fixed()).sum()
        });
    }
}

#[test]
fn weights() {
    let (density, deltas) = (positive(5.0, 2), positive(0.1, 3));
    let fixed_deltas = constant(deltas.clone(), SHAPE);
    assert_differentiates("d density", &density, SHAPE, 1e-7, |density| {
        (rendering_weights(density, fixed_deltas.clone()) * fixed()).sum()
    });
    let fixed_density = constant(density, SHAPE);
    assert_differentiates("d deltas", &deltas, SHAPE, 1e-7, |deltas| {
        (rendering_weights(fixed_density.clone(), deltas) * fixed()).sum()
    });
}

#[test]
fn weights_are_opacity_times_what_the_samples_before_let_through() {
    let (density, deltas) = (positive(5.0, 2), positive(0.1, 3));
    let weights = numbers(rendering_weights(
        constant(density.clone(), SHAPE),
        constant(deltas.clone(), SHAPE),
    ));
    let mut expected = Vec::new();
    for (density, deltas) in density.chunks(SAMPLES).zip(deltas.chunks(SAMPLES)) {
        let mut passed = 1.0;
        for (density, delta) in density.iter().zip(deltas) {
            let opacity = 1.0 - (-density * delta).exp();
            expected.push(passed * opacity);
            passed *= 1.0 - opacity;
        }
    }
    assert_close("weights", &weights, &expected, 1e-14);
}

#[test]
fn the_integral_over_selected_samples_is_that_of_all_with_the_others_weight_zero() {
    let rows: [u32; 6] = [1, 2, 6, 7, 9, 15];
    let samples = RowChoice::new(rows, RAYS * SAMPLES);
    let rays = RowChoice::new(rows.map(|row| row / SAMPLES as u32), RAYS);
    let kernels = Kernels::plain();
    let weights = positive(0.1, 4);
    let mut masked = vec![0.0; weights.len()];
    rows.iter()
        .for_each(|&row| masked[row as usize] = weights[row as usize]);
    let values = normal(RAYS * SAMPLES * 2, 6);

    let all = integrate(
        constant(masked, SHAPE),
        constant(values.clone(), [RAYS * SAMPLES, 2]),
    );
    let selected = |weights: Tensor<2>, values: Tensor<2>| {
        let weights = weights.reshape([RAYS * SAMPLES, 1]);
        integrate_selected(&kernels, samples.pick(weights), samples.pick(values), &rays)
    };
    let rendered = selected(
        constant(weights.clone(), SHAPE),
        constant(values.clone(), [RAYS * SAMPLES, 2]),
    );
    assert_close("integral", &numbers(rendered), &numbers(all), 1e-14);

    let of_rays = constant(normal(RAYS * 2, 8), [RAYS, 2]);
    let fixed_values = constant(values.clone(), [RAYS * SAMPLES, 2]);
    assert_differentiates("d weights", &weights, SHAPE, 1e-7, |weights| {
        (selected(weights, fixed_values.clone()) * of_rays.clone()).sum()
    });
    let fixed_weights = constant(weights, SHAPE);
    let shape = [RAYS * SAMPLES, 2];
    assert_differentiates("d values", &values, shape, 1e-7, |values| {
        (selected(fixed_weights.clone(), values) * of_rays.clone()).sum()
    });
}
