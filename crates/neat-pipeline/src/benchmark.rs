//! How close a training step comes to what the machine's arithmetic allows.
//!
//! Every time stands beside a yardstick of the same run: a large matrix product
//! on the same backend.

use crate::flops::{StepFlops, StepRows};
use crate::model::host_vec;
use crate::preset::Preset;
use crate::trainer::{StepTimings, TrainError, Trainer};
use burn::tensor::{Device, Tensor, TensorData};
use neat_core::synthetic::{SyntheticScene, generate};
use neat_sdf::ImplicitNetwork;
use neat_tensor::Backend;
use neat_tensor::random::{Purpose, stream};
use serde::Serialize;
use std::fmt::Write as _;
use std::time::{Duration, Instant};

/// Side of the square matrices of the yardstick.
const SIDE: usize = 2048;
/// Steps before the measured ones: caches fill, kernels compile.
const WARM_UP_STEPS: u32 = 3;
/// Where in the schedule steps are measured: β has fallen, most samples of a
/// preset that leaves light ones out are light.
const SCHEDULE: f64 = 0.5;
/// Views of the synthetic scene that is trained on.
const VIEWS: usize = 8;
/// Points of the measurement of the distance network alone.
const POINTS: usize = 24_576;

/// What was measured on one backend.
#[derive(Clone, Debug, Serialize)]
pub struct Benchmark {
    /// The backend.
    pub backend: Backend,
    /// Threads of the CPU that take part.
    pub threads: usize,
    /// Rate of a large matrix product at the start, in GFLOP/s.
    pub yardstick: f64,
    /// The same at the end: a large difference means a busy machine.
    pub yardstick_again: f64,
    /// Rate of copying a large tensor, in GB/s read and written; on a GPU.
    pub copy: Option<f64>,
    /// One entry per preset.
    pub presets: Vec<PresetBenchmark>,
}

/// What was measured of one preset.
#[derive(Clone, Debug, Serialize)]
pub struct PresetBenchmark {
    /// The preset.
    pub preset: Preset,
    /// Steps that were measured.
    pub steps: u32,
    /// What went through the networks in a step, on average.
    pub rows: StepRows,
    /// The parts of a step, then the whole.
    pub parts: Vec<Part>,
    /// The most memory that the process held so far, in GiB, where the system
    /// tells.
    pub peak_memory: Option<f64>,
}

/// Time and arithmetic of one part.
#[derive(Clone, Debug, Serialize)]
pub struct Part {
    /// What it is.
    pub name: &'static str,
    /// Seconds.
    pub seconds: f64,
    /// Floating-point operations that it cannot avoid.
    pub flops: f64,
    /// Share of the yardstick that they make.
    pub share: f64,
}

/// Measures `presets` on `backend`, each until `seconds` have passed (one step at
/// least). `progress` hears of every preset before it starts.
///
/// # Errors
/// If a preset cannot be trained.
pub fn benchmark(
    backend: Backend,
    device: &Device,
    presets: &[Preset],
    seconds: f64,
    progress: &mut dyn FnMut(Preset),
) -> Result<Benchmark, TrainError> {
    let config = SyntheticScene {
        views: VIEWS,
        ..SyntheticScene::default()
    };
    let scene = generate(&config)
        .expect("benchmark: the default scene is valid")
        .scene;
    let yardstick = matrix_product_rate(device);
    let mut measured = Vec::new();
    for preset in presets {
        progress(*preset);
        let config = preset.config();
        let mut trainer = Trainer::new(&scene, &config, 0, device)?;
        for _ in 0..WARM_UP_STEPS {
            if trainer.timings().total() > Duration::from_secs(1) {
                break;
            }
            trainer.step(SCHEDULE)?;
        }
        let (mut steps, mut time, mut rows) = (0, StepTimings::default(), StepRows::default());
        let mut flops = StepFlops::default();
        let start = Instant::now();
        while steps == 0 || start.elapsed().as_secs_f64() < seconds {
            trainer.step(SCHEDULE)?;
            steps += 1;
            time += trainer.timings();
            rows += trainer.rows();
            flops += StepFlops::count(&config.model, &trainer.rows());
        }
        let part = |name, time: Duration, flops: f64| {
            let seconds = time.as_secs_f64() / f64::from(steps);
            let flops = flops / f64::from(steps);
            Part {
                name,
                seconds,
                flops,
                share: flops / seconds / 1e9 / yardstick,
            }
        };
        let mut parts = vec![
            part("rays", time.batch, 0.0),
            part("sampler", time.sampler, flops.sampler),
            part("forward", time.forward, flops.forward),
            part("assignment", time.assignment, 0.0),
            part("backward", time.backward, flops.backward),
            part("optimiser", time.optimiser, 0.0),
            part("step", time.total(), flops.total()),
        ];
        let network = trainer.implicit_network();
        let one_row = StepRows {
            full: 0,
            eikonal: POINTS,
            ..StepRows::default()
        };
        let alone = StepFlops::count(&config.model, &one_row).forward;
        let seconds = gradient_seconds(network, device);
        parts.push(Part {
            name: "distance with gradient, alone",
            seconds,
            flops: alone,
            share: alone / seconds / 1e9 / yardstick,
        });
        measured.push(PresetBenchmark {
            preset: *preset,
            steps,
            rows: rows.divided_by(steps as usize),
            parts,
            peak_memory: peak_memory(),
        });
    }
    Ok(Benchmark {
        backend,
        threads: rayon::current_num_threads(),
        yardstick,
        yardstick_again: matrix_product_rate(device),
        copy: (backend == Backend::Wgpu).then(|| copy_rate(device)),
        presets: measured,
    })
}

fn random_matrix(rows: usize, columns: usize, device: &Device) -> Tensor<2> {
    use rand::RngExt;
    let mut rng = stream(0, Purpose::Weights, 0);
    let values: Vec<f32> = (0..rows * columns)
        .map(|_| rng.random::<f32>() - 0.5)
        .collect();
    Tensor::from_data(TensorData::new(values, [rows, columns]), device)
}

/// Waits for a device without moving a matrix.
fn wait_for(matrix: Tensor<2>) {
    host_vec(matrix.slice([0..1, 0..1]));
}

/// The shortest of a few runs.
fn best_seconds(runs: usize, mut run: impl FnMut()) -> f64 {
    (0..runs)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

/// GFLOP/s of a large float32 matrix product.
fn matrix_product_rate(device: &Device) -> f64 {
    let device = device.clone().inner();
    let a = random_matrix(SIDE, SIDE, &device);
    let b = random_matrix(SIDE, SIDE, &device);
    let seconds = best_seconds(5, || wait_for(a.clone().matmul(b.clone())));
    2.0 * (SIDE as f64).powi(3) / seconds / 1e9
}

/// GB/s of adding to a large tensor: each number is read and written once.
fn copy_rate(device: &Device) -> f64 {
    let device = device.clone().inner();
    let a = random_matrix(8 * SIDE, SIDE, &device);
    let seconds = best_seconds(5, || wait_for(a.clone().add_scalar(1.0)));
    2.0 * (8 * SIDE * SIDE * size_of::<f32>()) as f64 / seconds / 1e9
}

fn gradient_seconds(network: &ImplicitNetwork, device: &Device) -> f64 {
    use burn::module::Module;
    let network = network.valid();
    let points = random_matrix(POINTS, 3, &device.clone().inner());
    best_seconds(3, || {
        wait_for(network.gradient_uncapped(points.clone()));
    })
}

/// Largest resident memory of this process in GiB, where the system tells
/// (Linux).
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0 / 1024.0)
}

impl Benchmark {
    /// The tables that `neat bench` prints.
    pub fn to_markdown(&self) -> String {
        let mut text = format!(
            "Backend {}, {} CPU threads. Yardstick: {:.1} GFLOP/s (float32 matrix product, {SIDE}³), {:.1} at the end.\n",
            self.backend, self.threads, self.yardstick, self.yardstick_again
        );
        if let Some(copy) = self.copy {
            let _ = writeln!(text, "Copying: {copy:.1} GB/s.");
        }
        for preset in &self.presets {
            let rows = &preset.rows;
            let _ = write!(
                text,
                "\n{}, mean of {} steps: {} samples, {} of them in full, {} eikonal points, {} distances for the sampler",
                preset.preset, preset.steps, rows.samples, rows.full, rows.eikonal, rows.sampler
            );
            if let Some(memory) = preset.peak_memory {
                let _ = write!(text, "; {memory:.2} GiB at most");
            }
            text.push_str("\n\n| part | time | GFLOP | GFLOP/s | of yardstick |\n| --- | --: | --: | --: | --: |\n");
            for part in &preset.parts {
                let _ = match part.flops > 0.0 {
                    true => writeln!(
                        text,
                        "| {} | {:.2} ms | {:.3} | {:.1} | {:.0} % |",
                        part.name,
                        part.seconds * 1e3,
                        part.flops / 1e9,
                        part.flops / part.seconds / 1e9,
                        part.share * 100.0
                    ),
                    false => {
                        writeln!(
                            text,
                            "| {} | {:.2} ms | | | |",
                            part.name,
                            part.seconds * 1e3
                        )
                    }
                };
            }
        }
        text
    }
}
