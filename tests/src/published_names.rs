//! Parameters of the published code by our names.

use crate::golden::Golden;
use crate::tensors::golden_data;
use burn::tensor::TensorData;
use std::collections::BTreeMap;

/// Our name of a parameter, relative to its network: `lin4.weight_v` →
/// `mlp.layers.4.weight_v`, `ffn.2.bias` → `decoder.layers.1.bias`; others keep
/// theirs.
pub fn our_name(published: &str) -> String {
    match published.split('.').collect::<Vec<_>>()[..] {
        [layer, parameter] if layer.starts_with("lin") => {
            format!("mlp.layers.{}.{parameter}", &layer["lin".len()..])
        }
        ["ffn", position, parameter] => {
            // ReLUs stand at the odd positions of the published sequence.
            let position: usize = position.parse().expect("ffn.<number>");
            format!("decoder.layers.{}.{parameter}", position / 2)
        }
        _ => published.to_owned(),
    }
}

/// Our name of a parameter of the whole model: `implicit_network.lin4.bias` →
/// `implicit_network.mlp.layers.4.bias`, `latents` → `perceiver.latents`.
pub fn our_name_in_model(published: &str) -> String {
    match published.split_once('.') {
        None | Some(("ffn", _)) => format!("perceiver.{}", our_name(published)),
        Some((network, parameter)) => format!("{network}.{}", our_name(parameter)),
    }
}

/// All tensors whose name begins with `prefix`, by our names.
pub fn parameters(golden: &Golden, prefix: &str) -> BTreeMap<String, TensorData> {
    by_our_names(golden, prefix, our_name, golden_data)
}

/// The elements of all tensors whose name begins with `prefix`, by our names.
pub fn gradients(golden: &Golden, prefix: &str) -> BTreeMap<String, Vec<f64>> {
    by_our_names(golden, prefix, our_name, Golden::numbers)
}

/// [`parameters`] of the whole model.
pub fn model_parameters(golden: &Golden, prefix: &str) -> BTreeMap<String, TensorData> {
    by_our_names(golden, prefix, our_name_in_model, golden_data)
}

/// [`gradients`] of the whole model.
pub fn model_gradients(golden: &Golden, prefix: &str) -> BTreeMap<String, Vec<f64>> {
    by_our_names(golden, prefix, our_name_in_model, Golden::numbers)
}

fn by_our_names<T>(
    golden: &Golden,
    prefix: &str,
    rename: impl Fn(&str) -> String,
    read: impl Fn(&Golden, &str) -> T,
) -> BTreeMap<String, T> {
    let mut values = BTreeMap::new();
    for name in golden.names() {
        if let Some(parameter) = name.strip_prefix(prefix) {
            values.insert(rename(parameter), read(golden, &name));
        }
    }
    assert!(!values.is_empty(), "no tensor is called {prefix}…");
    values
}
