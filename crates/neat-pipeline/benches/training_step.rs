//! Time and share of the machine's arithmetic of a training step of each preset.
//!
//! `cargo bench --workspace --bench training_step -- [PRESET]… [--backend NAME]`
//!
//! The same measurement as `neat bench`.

#![allow(clippy::print_stdout)] // a bench prints its table

use neat_pipeline::benchmark::benchmark;
use neat_pipeline::preset::Preset;
use neat_tensor::Backend;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let backend: Backend = arguments
        .iter()
        .position(|a| a == "--backend")
        .and_then(|i| arguments.get(i + 1))
        .map_or(Backend::Flex, |name| {
            name.parse().expect("a backend's name")
        });
    let named: Vec<Preset> = arguments.iter().filter_map(|a| a.parse().ok()).collect();
    let presets = if named.is_empty() {
        vec![Preset::Fast, Preset::PaperAbc]
    } else {
        named
    };
    let device = backend.device().expect("a device of the backend");
    let measured = benchmark(backend, &device, &presets, 5.0, &mut |_, _| {});
    print!("{}", measured.expect("a preset trains").to_markdown());
}
