//! What exactly this program is.

use neat_tensor::Backend;
use std::sync::LazyLock;

/// The version with what it was built from, of and for: what `neat --version` says.
static LONG: LazyLock<String> = LazyLock::new(|| {
    let mut features: Vec<String> = Backend::built().iter().map(ToString::to_string).collect();
    if cfg!(feature = "onnx") {
        features.push("onnx".to_owned());
    }
    format!(
        "{}\ncommit: {}\nfeatures: {}\ntarget: {}",
        env!("CARGO_PKG_VERSION"),
        env!("NEAT_BUILT_FROM"),
        features.join(", "),
        env!("NEAT_BUILT_FOR"),
    )
});

/// The version, commit, features and target, one per line.
pub fn long() -> &'static str {
    &LONG
}
