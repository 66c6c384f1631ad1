//! Case 04: density, rendering weights and depth, with their gradients.

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorCreationOptions, TensorData};
use neat_sdf::LaplaceDensity;
use neat_sdf::density::{laplace_density, laplace_density_scalar};
use neat_sdf::volume_rendering::{integrate, rendering_weights};
use neat_tests::backends::on_each_backend;
use neat_tests::comparison::{assert_close, assert_relatively_close};
use neat_tests::golden::Golden;
use neat_tests::tensors::{golden_tensor, numbers};

/// Length of the interval behind the last sample, as published.
const LAST_DELTA: f64 = 1e10;

/// `[R, S]` positions → lengths of the intervals that begin at them.
pub fn deltas(z: &Tensor<2>) -> Tensor<2> {
    let [rays, samples] = z.dims();
    let next = z.clone().narrow(1, 1, samples - 1);
    let options = TensorCreationOptions::new(z.device()).with_dtype(z.dtype());
    let last = Tensor::full([rays, 1], LAST_DELTA, options);
    Tensor::cat(vec![next - z.clone().narrow(1, 0, samples - 1), last], 1)
}

fn check(golden: &Golden, tag: &str, device: &Device) {
    let density = LaplaceDensity {
        beta: Param::from_tensor(golden_tensor(golden, &format!("{tag}/beta_param"), device)),
        min_beta: 1e-4,
    };
    let z: Tensor<2> = golden_tensor(golden, "z_vals", device);
    let [rays, samples] = z.dims();
    let sdf = golden_tensor::<2>(golden, "sdf", device).require_grad();
    let sigma = laplace_density(sdf.clone(), density.beta());
    let weights = rendering_weights(sigma.clone(), deltas(&z));
    let depth = integrate(weights.clone(), z.reshape([rays * samples, 1]));
    let objective = (weights.clone() * golden_tensor(golden, "fixed", device)).sum();
    let gradients = objective.backward();

    let truth = |name: &str| golden.numbers(&format!("f64.{tag}/{name}"));
    let label = |name: &str| format!("{tag} {name}");
    assert_relatively_close(
        &label("β"),
        &numbers(density.beta()),
        &truth("used_beta"),
        1e-6,
    );
    assert_relatively_close(&label("density"), &numbers(sigma), &truth("density"), 2e-6);
    assert_close(
        &label("weights"),
        &numbers(weights.clone()),
        &truth("weights"),
        5e-6,
    );
    // Distances reach 6: a few times the weights' tolerance.
    assert_close(&label("depth"), &numbers(depth), &truth("depth"), 3e-5);
    assert_close(
        &label("opacity"),
        &numbers(weights.sum_dim(1)),
        &truth("acc"),
        5e-6,
    );
    let of_sdf = sdf.grad(&gradients).expect("the objective depends on it");
    assert_relatively_close(&label("d sdf"), &numbers(of_sdf), &truth("dobj_dsdf"), 1e-4);
    let of_beta = density
        .beta
        .val()
        .grad(&gradients)
        .expect("it depends on β");
    let truth_of_beta = truth("dobj_dbeta_param");
    assert_relatively_close(&label("d β"), &numbers(of_beta), &truth_of_beta, 5e-4);
}

#[test]
fn sharp_soft_and_negative_beta() {
    let golden = Golden::open("04_density_volume_rendering");
    on_each_backend(|device| {
        for tag in ["b0.1", "b0.02", "b0.005", "bneg0.05"] {
            check(&golden, tag, &device);
        }
    });
}

#[test]
fn on_the_surface_the_density_is_half_and_its_gradient_zero() {
    let golden = Golden::open("04_density_volume_rendering");
    let beta = golden.number("b0.1/used_beta");
    let density = golden.numbers("zero/density");
    on_each_backend(|device| {
        let sdf = golden_tensor::<2>(&golden, "zero/sdf", &device).require_grad();
        let sigma = laplace_density(
            sdf.clone(),
            Tensor::from_data(TensorData::from([beta]), &device),
        );
        let gradients = sigma.clone().sum().backward();
        assert_relatively_close("density", &numbers(sigma), &density, 2e-6);
        let gradient = numbers(sdf.grad(&gradients).expect("density depends on distance"));
        assert_relatively_close(
            "d sdf",
            &gradient,
            &golden.numbers("zero/ddensity_dsdf"),
            1e-4,
        );
    });
    let on_the_host: Vec<f64> = golden
        .floats("zero/sdf")
        .iter()
        .map(|&sdf| f64::from(laplace_density_scalar(sdf, beta as f32)))
        .collect();
    assert_relatively_close("density on the host", &on_the_host, &density, 2e-6);
}
