//! How close a training step comes to what the machine's arithmetic allows.
//!
//! Every time stands beside a yardstick of the same run: a large matrix product
//! on the same backend.

use crate::error::LabError;
use burn::tensor::{DType, Device, Tensor, TensorData};
use neat_core::synthetic::{SyntheticScene, generate};
use neat_core::{MemoryLimit, Scene};
use neat_pipeline::config::Preset;
use neat_pipeline::plan::{Machine, settle};
use neat_pipeline::scene::scaled_for;
use neat_sdf::ImplicitNetwork;
use neat_tensor::backend::{gpu_name, software_driver};
use neat_tensor::host::host_vec;
use neat_tensor::random::{Purpose, stream};
use neat_tensor::{Backend, Kernels};
use neat_train::TrainError;
use neat_train::config::ModelConfig;
use neat_train::flops::{StepFlops, StepRows};
use neat_train::{StepTimings, Trainer};
use serde::Serialize;
use std::fmt::Write as _;
use std::time::{Duration, Instant};

/// Side of the square matrices of the yardstick.
const SIDE: usize = 2048;
/// … on a GPU, which is not busy with smaller ones.
const GPU_SIDE: usize = 4096;
/// … through a software driver, which is slow.
const SOFTWARE_SIDE: usize = 512;
/// The yardstick changes by more than this factor on a busy machine.
const BUSY: f64 = 1.2;
/// A timing of the yardstick takes this long or longer, in seconds.
const LONG_ENOUGH: f64 = 0.05;
/// Steps before the measured ones: caches fill, kernels compile.
const WARM_UP_STEPS: u32 = 3;
/// On a CPU one step that takes this long has warmed up everything.
const LONG_STEP: Duration = Duration::from_secs(1);
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
    /// The name of the GPU or the CPU.
    pub device: String,
    /// Threads of the CPU that take part.
    pub threads: usize,
    /// Whether hand-written kernels ran; else plain tensor operations alone.
    pub fused: bool,
    /// Side of the square matrices of the yardstick.
    pub yardstick_side: usize,
    /// Rate of a large float32 matrix product at the start, in GFLOP/s.
    pub yardstick: f64,
    /// The same at the end.
    pub yardstick_again: f64,
    /// Whether the two differ so much that the machine was busy with something
    /// else, and shares are rough.
    pub busy: bool,
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
    /// The parts of a step, the whole by the clock, and the distance network
    /// alone.
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
    /// Floating-point operations that it cannot avoid, see [`StepFlops`]; 0 where
    /// none are counted.
    pub flops: f64,
    /// Share of the yardstick at which they were done.
    pub share: f64,
}

impl Part {
    fn new(name: &'static str, seconds: f64, flops: f64, yardstick: f64) -> Self {
        // A part without counted work may take no time at all.
        let share = match flops > 0.0 {
            true => flops / seconds / 1e9 / yardstick,
            false => 0.0,
        };
        Self {
            name,
            seconds,
            flops,
            share,
        }
    }
}

/// Measures `presets` on `backend`, each until `seconds` have passed (one step at
/// least), with kernels or `plain` tensor operations. `progress` hears what comes next,
/// and which share of all is done.
///
/// # Errors
/// If a preset cannot be trained.
pub fn benchmark(
    backend: Backend,
    device: &Device,
    presets: &[Preset],
    seconds: f64,
    plain: bool,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<Benchmark, LabError> {
    let kernels = if plain {
        Kernels::plain()
    } else {
        Kernels::default()
    };
    progress("matrix product", 0.0);
    let side = match (backend, software_driver(device)) {
        (Backend::Wgpu, None) => GPU_SIDE,
        (Backend::Wgpu, Some(_)) => SOFTWARE_SIDE,
        _ => SIDE,
    };
    let bench = Bench {
        backend,
        device,
        views: generate(&views())
            .expect("benchmark: the default scene is valid")
            .scene,
        kernels,
        yardstick: matrix_product_rate(side, device),
        seconds,
    };
    let mut measured = Vec::new();
    for (i, preset) in presets.iter().enumerate() {
        let mut progress = |step: &str, fraction: f64| {
            let done = (i as f64 + fraction) / presets.len() as f64;
            progress(&format!("{preset}: {step}"), done);
        };
        measured.push(bench.measure(*preset, &mut progress)?);
    }
    progress("matrix product", 1.0);
    let yardstick_again = matrix_product_rate(side, device);
    Ok(Benchmark {
        backend,
        device: device_name(device),
        threads: rayon::current_num_threads(),
        fused: bench.kernels.on(device, DType::F32).has_kernels(),
        yardstick_side: side,
        yardstick: bench.yardstick,
        yardstick_again,
        busy: bench.yardstick.max(yardstick_again) > BUSY * bench.yardstick.min(yardstick_again),
        copy: (backend == Backend::Wgpu).then(|| copy_rate(device)),
        presets: measured,
    })
}

/// What all presets are measured with.
struct Bench<'a> {
    backend: Backend,
    device: &'a Device,
    views: Scene,
    kernels: Kernels,
    yardstick: f64,
    seconds: f64,
}

impl Bench<'_> {
    fn measure(
        &self,
        preset: Preset,
        progress: &mut dyn FnMut(&str, f64),
    ) -> Result<PresetBenchmark, LabError> {
        let asked = preset.config();
        let scene = scaled_for(&asked.data, self.views.clone());
        let machine = Machine {
            backend: self.backend,
            memory_limit: MemoryLimit::NONE,
        };
        let (plan, _) = settle(&asked, &scene, machine, None)?;
        let config = plan.config();
        let training = config.training(self.kernels.clone());
        let mut trainer = Trainer::new(&scene, &training, 0, self.device)?;
        let mut run = Run::default();
        warm_up(&mut trainer, self.backend, progress)?;
        synchronise(self.device);
        run.measure(&mut trainer, &config.model, self.seconds, progress)?;
        let start = Instant::now();
        synchronise(self.device);
        run.whole += start.elapsed();
        progress("distance with gradient", 1.0);
        let mut parts = run.parts(self.yardstick);
        let points = StepRows {
            eikonal: POINTS,
            ..StepRows::default()
        };
        parts.push(Part::new(
            "distance with gradient, alone",
            gradient_seconds(trainer.implicit_network(), self.device),
            StepFlops::count(&config.model, &points).forward,
            self.yardstick,
        ));
        Ok(PresetBenchmark {
            preset,
            steps: run.steps,
            rows: run.rows.divided_by(run.steps as usize),
            parts,
            peak_memory: process_memory("VmHWM:").map(|kib| kib / 1024.0 / 1024.0),
        })
    }
}

/// What all presets are trained on.
fn views() -> SyntheticScene {
    SyntheticScene {
        views: VIEWS,
        ..SyntheticScene::default()
    }
}

fn warm_up(
    trainer: &mut Trainer,
    backend: Backend,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<(), TrainError> {
    for step in 1..=WARM_UP_STEPS {
        progress(&format!("warm-up step {step}"), 0.0);
        trainer.step(SCHEDULE)?;
        // A GPU's first steps are long because kernels compile.
        if backend != Backend::Wgpu && trainer.timings().total() > LONG_STEP {
            break;
        }
    }
    Ok(())
}

/// Waits until a device has done everything.
fn synchronise(device: &Device) {
    // A device that is lost says so where a result is read.
    let _ = device.sync();
}

/// The measured steps of one preset, added up.
#[derive(Default)]
struct Run {
    steps: u32,
    rows: StepRows,
    flops: StepFlops,
    parts: StepTimings,
    /// By the clock, with what lies between the parts.
    whole: Duration,
}

impl Run {
    fn measure(
        &mut self,
        trainer: &mut Trainer,
        model: &ModelConfig,
        seconds: f64,
        progress: &mut dyn FnMut(&str, f64),
    ) -> Result<(), TrainError> {
        while self.steps == 0 || self.whole.as_secs_f64() < seconds {
            let done = (self.whole.as_secs_f64() / seconds).min(1.0);
            progress(&format!("step {}", self.steps + 1), done);
            let start = Instant::now();
            trainer.step(SCHEDULE)?;
            self.whole += start.elapsed();
            self.steps += 1;
            self.parts += trainer.timings();
            self.rows += trainer.rows();
            self.flops += StepFlops::count(model, &trainer.rows());
        }
        Ok(())
    }

    /// The mean of the steps.
    fn parts(&self, yardstick: f64) -> Vec<Part> {
        let steps = f64::from(self.steps);
        let (time, flops) = (&self.parts, &self.flops);
        [
            ("rays", time.batch, 0.0),
            ("sampler", time.sampler, flops.sampler),
            ("forward", time.forward, flops.forward),
            ("assignment", time.assignment, 0.0),
            ("backward", time.backward, flops.backward),
            ("optimiser", time.optimiser, 0.0),
            ("step", self.whole, flops.total()),
        ]
        .map(|(name, time, flops)| {
            Part::new(name, time.as_secs_f64() / steps, flops / steps, yardstick)
        })
        .into()
    }
}

/// The name of a GPU, else of the CPU where the system tells (Linux), else of its
/// kind.
fn device_name(device: &Device) -> String {
    let of_cpu = || {
        let info = std::fs::read_to_string("/proc/cpuinfo").ok()?;
        let line = info.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    };
    let name = gpu_name(device).or_else(of_cpu);
    name.unwrap_or_else(|| std::env::consts::ARCH.to_owned())
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

/// Seconds of one `run`, the shortest of a few timings. A fast device gets many
/// runs at once: waiting for it takes longer than one of them.
fn best_seconds(mut run: impl FnMut() -> Tensor<2>) -> f64 {
    let mut time = |runs: usize| {
        let start = Instant::now();
        let mut last = run();
        for _ in 1..runs {
            last = run();
        }
        wait_for(last);
        start.elapsed().as_secs_f64() / runs as f64
    };
    time(1); // kernels compile
    let once = time(1);
    let runs = (LONG_ENOUGH / once).ceil().clamp(1.0, 100.0) as usize;
    // Noise does not matter where a run takes seconds.
    let timings = if once > 1.0 { 1 } else { 4 };
    (0..timings).map(|_| time(runs)).fold(once, f64::min)
}

/// GFLOP/s of a large float32 matrix product.
pub(crate) fn matrix_product_rate(side: usize, device: &Device) -> f64 {
    let device = device.clone().inner();
    let a = random_matrix(side, side, &device);
    let b = random_matrix(side, side, &device);
    let seconds = best_seconds(|| a.clone().matmul(b.clone()));
    2.0 * (side as f64).powi(3) / seconds / 1e9
}

/// GB/s of adding to a large tensor: each number is read and written once.
fn copy_rate(device: &Device) -> f64 {
    let device = device.clone().inner();
    let a = random_matrix(8 * SIDE, SIDE, &device);
    let seconds = best_seconds(|| a.clone().add_scalar(1.0));
    2.0 * (8 * SIDE * SIDE * size_of::<f32>()) as f64 / seconds / 1e9
}

fn gradient_seconds(network: &ImplicitNetwork, device: &Device) -> f64 {
    use burn::module::Module;
    let network = network.valid();
    let points = random_matrix(POINTS, 3, &device.clone().inner());
    best_seconds(|| network.gradient_uncapped(points.clone()))
}

/// A figure of this process's memory in KiB, by its name where the system tells (Linux).
pub(crate) fn process_memory(name: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(name))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

impl Benchmark {
    /// The tables that `neat bench` prints.
    pub fn to_markdown(&self) -> String {
        let side = self.yardstick_side;
        let mut text = format!(
            "Backend {} on {}, {} CPU threads, {}.\n\
             Yardstick, a float32 matrix product of {side}³: {:.1} GFLOP/s, at the end {:.1}.\n",
            self.backend,
            self.device,
            self.threads,
            self.networks(),
            self.yardstick,
            self.yardstick_again,
        );
        // Writing to a string cannot fail, here and below.
        if let Some(copy) = self.copy {
            let _ = writeln!(text, "Copying: {copy:.1} GB/s read and written.");
        }
        if self.backend == Backend::Wgpu {
            text.push_str(
                "The host's clock counts what the GPU has yet to do towards the next part that reads a result.\n",
            );
        }
        if self.busy {
            let _ = writeln!(
                text,
                "Warning: the yardstick changed by more than {:.0} %, so the machine was busy and shares are rough.",
                (BUSY - 1.0) * 100.0
            );
        }
        for preset in &self.presets {
            preset.write(&mut text, self.networks());
        }
        text
    }

    /// How networks ran, in words.
    fn networks(&self) -> &'static str {
        if self.fused {
            "fused operations"
        } else {
            "fused operations off"
        }
    }
}

impl PresetBenchmark {
    fn write(&self, text: &mut String, networks: &str) {
        let rows = &self.rows;
        let plural = if self.steps == 1 { "" } else { "s" };
        let _ = write!(
            text,
            "\n{} ({networks}), mean of {} step{}: {} samples, {} of them in full, {} eikonal points, {} distances for the sampler",
            self.preset, self.steps, plural, rows.samples, rows.full, rows.eikonal, rows.sampler
        );
        if let Some(memory) = self.peak_memory {
            let _ = write!(text, "; {memory:.2} GiB of memory at most so far");
        }
        text.push_str(
            "\n\n| part | time | GFLOP | GFLOP/s | of yardstick |\n| --- | --: | --: | --: | --: |\n",
        );
        for part in &self.parts {
            let (name, milliseconds) = (part.name, part.seconds * 1e3);
            let _ = if part.flops > 0.0 {
                writeln!(
                    text,
                    "| {name} | {milliseconds:.2} ms | {:.3} | {:.1} | {:.0} % |",
                    part.flops / 1e9,
                    part.flops / part.seconds / 1e9,
                    part.share * 100.0
                )
            } else {
                writeln!(text, "| {name} | {milliseconds:.2} ms | | | |")
            };
        }
    }
}

#[cfg(all(test, feature = "flex"))]
mod tests {
    use super::*;

    #[test]
    fn every_preset_trains_on_the_scene() {
        let views = generate(&views()).unwrap().scene;
        for preset in Preset::ALL {
            let mut asked = preset.config();
            asked.train.rays = 8;
            asked.train.eikonal.uniform_points = Some(8);
            let scene = scaled_for(&asked.data, views.clone());
            let machine = Machine {
                backend: Backend::Flex,
                memory_limit: MemoryLimit::NONE,
            };
            let (plan, _) = settle(&asked, &scene, machine, None).unwrap();
            let training = plan.config().training(Kernels::default());
            let mut trainer = Trainer::new(&scene, &training, 0, &Device::flex()).unwrap();
            trainer.step(SCHEDULE).unwrap();
            let rows = trainer.rows();
            let all = [rows.sampler, rows.samples, rows.full, rows.segment];
            assert!(all.iter().all(|rows| *rows > 0), "{preset}: {rows:?}");
        }
    }
}
