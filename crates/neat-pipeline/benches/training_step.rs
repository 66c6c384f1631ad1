//! Time and memory of one training step of each preset, beside the rate of a
//! large matrix product measured in the same run.
//!
//! `cargo bench --workspace --bench training_step -- [PRESET]… [--backend NAME]`
//!
//! A whole-program measurement: one process, one backend, presets in turn.

#![allow(clippy::print_stdout)] // a bench prints its table

use burn::tensor::{Device, Tensor, TensorData};
use neat_core::synthetic::{SyntheticScene, generate};
use neat_pipeline::model::host_vec;
use neat_pipeline::preset::Preset;
use neat_pipeline::trainer::Trainer;
use neat_tensor::Backend;
use std::time::Instant;

/// Side of the square matrices of the yardstick.
const SIDE: usize = 2048;

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
    let config = SyntheticScene {
        views: 8,
        ..SyntheticScene::default()
    };
    let scene = generate(&config).expect("the default scene").scene;

    println!(
        "backend {backend}, {} threads",
        rayon::current_num_threads()
    );
    println!(
        "yardstick: {:.1} GFLOP/s (SGEMM, {SIDE}³)",
        sgemm_gflops(&device)
    );
    for preset in presets {
        let config = preset.config();
        let mut trainer = Trainer::new(&scene, &config, 0, &device).expect("a preset trains");
        let repetitions = if preset == Preset::Fast { 100 } else { 1 };
        trainer.step(0.0).expect("the first step");
        let start = Instant::now();
        for _ in 0..repetitions {
            trainer.step(0.0).expect("a step");
        }
        let seconds = start.elapsed().as_secs_f64() / f64::from(repetitions);
        println!(
            "{preset}: {:.1} ms per step, most memory so far {}",
            seconds * 1e3,
            peak_memory().unwrap_or_else(|| "unknown".to_owned())
        );
    }
    println!("yardstick: {:.1} GFLOP/s (again)", sgemm_gflops(&device));
}

/// Best of a few large products.
fn sgemm_gflops(device: &Device) -> f64 {
    let matrix = |seed: usize| {
        let values: Vec<f32> = (0..SIDE * SIDE)
            .map(|i| ((i * 31 + seed) % 1021) as f32 / 1021.0 - 0.5)
            .collect();
        Tensor::<2>::from_data(TensorData::new(values, [SIDE, SIDE]), device)
    };
    let (a, b) = (matrix(1), matrix(2));
    (0..5)
        .map(|_| {
            let start = Instant::now();
            let product = a.clone().matmul(b.clone());
            // Reading one number waits for a GPU without moving the matrix.
            host_vec(product.slice([0..1, 0..1]));
            2.0 * (SIDE as f64).powi(3) / start.elapsed().as_secs_f64() / 1e9
        })
        .fold(0.0, f64::max)
}

/// Largest resident memory of this process, where the system tells (Linux).
fn peak_memory() -> Option<String> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(format!("{:.2} GiB", kib / 1024.0 / 1024.0))
}
