//! Gradients of a module's parameters by name.

use crate::comparison::{assert_close_in_l2, assert_relatively_close};
use burn::module::Module;
use burn::optim::GradientsParams;
use burn::tensor::Gradients;
use neat_tensor::parameters;
use std::collections::BTreeMap;

/// Gradient of each parameter of `module`, by the parameter's name; zeros where
/// the loss does not depend on it.
pub fn named_gradients<M: Module>(module: &M, gradients: Gradients) -> BTreeMap<String, Vec<f64>> {
    let mut gradients = GradientsParams::from_grads(gradients, module);
    let mut named = parameters::named_gradients(module, &mut gradients);
    parameters::named_parameters(module)
        .into_iter()
        .map(|(name, parameter)| {
            let gradient = match named.remove(&name) {
                Some(gradient) => gradient.try_into_vec_as().expect("floats become float64"),
                None => vec![0.0; parameter.num_elements()],
            };
            (name, gradient)
        })
        .collect()
}

/// Compares gradients with the truth: each within `per_tensor` of its largest
/// element, all together within `in_l2` of their norm.
#[track_caller]
pub fn assert_gradients_close(
    what: &str,
    gradients: &BTreeMap<String, Vec<f64>>,
    truth: &BTreeMap<String, Vec<f64>>,
    per_tensor: f64,
    in_l2: f64,
) {
    let names = |map: &BTreeMap<String, Vec<f64>>| -> Vec<String> { map.keys().cloned().collect() };
    assert_eq!(names(gradients), names(truth), "{what}: other parameters");
    for (name, gradient) in gradients {
        assert_relatively_close(
            &format!("{what} {name}"),
            gradient,
            &truth[name],
            per_tensor,
        );
    }
    let all =
        |map: &BTreeMap<String, Vec<f64>>| map.values().flatten().copied().collect::<Vec<_>>();
    assert_close_in_l2(what, &all(gradients), &all(truth), in_l2);
}
