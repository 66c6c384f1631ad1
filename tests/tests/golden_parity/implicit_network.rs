//! Case 01: the signed distance network, its gradient, and the gradient of
//! losses of that gradient.

use burn::tensor::{DType, Device, Tensor};
use neat_sdf::losses::eikonal_loss;
use neat_sdf::{ImplicitNetwork, ImplicitNetworkConfig};
use neat_tensor::PositionalEncoding;
use neat_tensor::parameters::load_parameters;
use neat_tensor::random::{Purpose, stream};
use neat_tests::backends::on_each_backend;
use neat_tests::comparison::{assert_close, assert_relatively_close};
use neat_tests::golden::Golden;
use neat_tests::named_gradients::{assert_gradients_close, named_gradients};
use neat_tests::published_names::{gradients, parameters};
use neat_tests::tensors::{golden_tensor, numbers};

/// Of values and of the gradient with respect to the point.
const VALUE_TOLERANCE: f64 = 5e-6;
/// Of one parameter's gradient.
const PER_TENSOR_TOLERANCE: f64 = 5e-5;
/// Of all parameters' gradients together.
const IN_L2_TOLERANCE: f64 = 1e-5;

/// The small network that the golden cases share.
pub fn network(golden: &Golden, device: &Device, dtype: Option<DType>) -> ImplicitNetwork {
    let config = ImplicitNetworkConfig {
        width: 64,
        features: 32,
        ..ImplicitNetworkConfig::default()
    };
    let untrained = config.init(3.0, &mut stream(0, Purpose::Weights, 0), device);
    let untrained = untrained.expect("the published size");
    load_parameters(untrained, parameters(golden, "param/"), dtype)
        .expect("the golden network has the published architecture")
}

#[test]
fn weight_normalisation_and_encoding() {
    let golden = Golden::open("01_implicit_network");
    on_each_backend(|device| {
        let network = network(&golden, &device, None);
        for l in [0, 3, 8] {
            let name = format!("effective_weight/lin{l}");
            let weight = numbers(network.mlp.layers[l].effective_weight());
            assert_relatively_close(&name, &weight, &golden.numbers(&name), VALUE_TOLERANCE);
        }
        let encoding = PositionalEncoding { octaves: 6 };
        let encoded = encoding.encode(golden_tensor(&golden, "points", &device));
        let truth = golden.numbers("embedding");
        // In float32 the sine of up to 32·4 is known to about the rounding of its
        // argument.
        assert_close("embedding", &numbers(encoded), &truth, 1e-5);
    });
}

#[test]
fn distance_features_and_gradient() {
    let golden = Golden::open("01_implicit_network");
    on_each_backend(|device| {
        let network = network(&golden, &device, None);
        let points: Tensor<2> = golden_tensor(&golden, "points", &device);
        let capped = network.evaluate(points.clone());
        let uncapped = network.evaluate_uncapped(points.clone());
        let check = |name: &str, actual: Vec<f64>, truth: &str| {
            assert_relatively_close(name, &actual, &golden.numbers(truth), VALUE_TOLERANCE);
        };
        check(
            "outputs",
            numbers(network.mlp.forward(points.clone())),
            "raw",
        );
        check("distance", numbers(capped.sdf), "f64.sdf_clamped");
        check(
            "distance alone",
            numbers(network.sdf(points)),
            "f64.sdf_clamped",
        );
        check("features", numbers(capped.features), "f64.feature");
        check("gradient", numbers(capped.gradient), "f64.grad_clamped");
        check(
            "uncapped gradient",
            numbers(uncapped.gradient),
            "f64.grad_unclamped",
        );
    });
}

#[test]
fn the_eikonal_loss_trains_all_layers() {
    let golden = Golden::open("01_implicit_network");
    on_each_backend(|device| {
        let network = network(&golden, &device, None);
        let points = golden_tensor(&golden, "points", &device);
        let loss = eikonal_loss(network.evaluate_uncapped(points).gradient);
        let gradients_of_loss = loss.backward();
        let truth = golden.numbers("f64.eikonal");
        assert_relatively_close("eikonal", &numbers(loss), &truth, VALUE_TOLERANCE);
        assert_gradients_close(
            "d eikonal",
            &named_gradients(&network, gradients_of_loss),
            &gradients(&golden, "f64.deikonal/"),
            PER_TENSOR_TOLERANCE,
            IN_L2_TOLERANCE,
        );
    });
}

#[test]
fn a_loss_of_distance_features_and_gradient_trains_all_layers() {
    let golden = Golden::open("01_implicit_network");
    on_each_backend(|device| {
        let network = network(&golden, &device, None);
        let tensor = |name: &str| -> Tensor<2> { golden_tensor(&golden, name, &device) };
        let output = network.evaluate(tensor("points"));
        let objective = (output.sdf * tensor("fixed_sdf")).sum()
            + (output.features * tensor("fixed_feature")).sum()
            + (output.gradient * tensor("fixed_grad")).sum();
        let gradients_of_objective = objective.backward();
        let truth = golden.numbers("f64.mixed_objective");
        assert_relatively_close(
            "objective",
            &numbers(objective),
            &truth,
            PER_TENSOR_TOLERANCE,
        );
        assert_gradients_close(
            "d objective",
            &named_gradients(&network, gradients_of_objective),
            &gradients(&golden, "f64.dmixed/"),
            PER_TENSOR_TOLERANCE,
            IN_L2_TOLERANCE,
        );
    });
}
