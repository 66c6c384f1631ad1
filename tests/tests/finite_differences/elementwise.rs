//! Activation and encoding.

use burn::tensor::Tensor;
use neat_tensor::PositionalEncoding;
use neat_tensor::softplus::{softplus, times_softplus_slope};
use neat_tests::comparison::assert_relatively_close;
use neat_tests::finite_differences::{
    assert_differentiates, central_differences, constant, normal,
};
use neat_tests::tensors::numbers;

const SHARPNESS: f64 = 100.0;

/// On both sides of the bend, in it, and far out.
const AROUND_THE_BEND: [f64; 8] = [-2.0, -0.1, -0.01, -1e-3, 2e-3, 0.02, 0.1, 3.0];

/// The derivative of softplus.
fn slope(z: Tensor<1>) -> Tensor<1> {
    times_softplus_slope(z.ones_like(), z, SHARPNESS)
}

#[test]
fn softplus_has_its_stated_derivative() {
    let at_the_bend = numbers(slope(constant(AROUND_THE_BEND.to_vec(), [8])));
    let differences = central_differences(&AROUND_THE_BEND, |z| {
        numbers(softplus(constant::<1>(z, [8]), SHARPNESS).sum())[0]
    });
    assert_relatively_close("slope", &at_the_bend, &differences, 1e-8);
    assert_differentiates("softplus", &AROUND_THE_BEND, [8], 1e-8, |z: Tensor<1>| {
        softplus(z, SHARPNESS).square().sum()
    });
    assert_differentiates(
        "its derivative",
        &AROUND_THE_BEND,
        [8],
        1e-7,
        |z: Tensor<1>| slope(z).sum(),
    );
}

#[test]
fn softplus_overflows_nowhere() {
    let far = [-1e30, -1e4, 0.0, 1e4, 1e30];
    let values = numbers(softplus(constant(far.to_vec(), [5]), SHARPNESS));
    let expected = far.map(|z: f64| {
        if z == 0.0 {
            2f64.ln() / SHARPNESS
        } else {
            z.max(0.0)
        }
    });
    assert_relatively_close("far out", &values, &expected, 1e-12);
    assert!((values[2] / expected[2] - 1.0).abs() < 1e-12);
}

#[test]
fn the_encoding_pulls_gradients_back() {
    let [rows, width] = [5, 3];
    let x = normal(rows * width, 1);
    for octaves in [0, 1, 6] {
        let encoding = PositionalEncoding { octaves };
        let shape = [rows, encoding.output_width(width)];
        let pulled = constant(normal(shape[0] * shape[1], 2), shape);
        let pull_back = |x: Tensor<2>| encoding.pull_back(x, pulled.clone());

        let differences = central_differences(&x, |x| {
            let encoded = encoding.encode(constant(x, [rows, width]));
            numbers((encoded * pulled.clone()).sum())[0]
        });
        let gradient = numbers(pull_back(constant(x.clone(), [rows, width])));
        let what = format!("{octaves} octaves");
        assert_relatively_close(&what, &gradient, &differences, 1e-7);

        // Second order: the eikonal term goes back through the pulled gradient.
        if octaves > 0 {
            assert_differentiates(&what, &x, [rows, width], 1e-6, |x| {
                pull_back(x).square().sum()
            });
        }
        let gradient = normal(shape[0] * shape[1], 3);
        let x = constant(x.clone(), [rows, width]);
        assert_differentiates(&what, &gradient, shape, 1e-7, |gradient| {
            encoding.pull_back(x.clone(), gradient).square().sum()
        });
    }
}
