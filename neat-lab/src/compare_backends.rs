//! The same seeds on every backend: time, memory and agreement.

use crate::benchmark::process_memory;
use burn::tensor::TensorData;
use neat_core::Scene;
use neat_tensor::{Backend, BackendError, Kernels};
use neat_train::TrainError;
use neat_train::config::TrainingConfig;
use neat_train::trainer::{Probe, Trainer};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::time::Instant;

/// Why backends could not be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// A backend cannot be used.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// Training failed on a backend.
    #[error("on {backend}: {source}")]
    Train {
        /// The backend.
        backend: Backend,
        /// What happened.
        source: TrainError,
    },
}

/// How one backend did, against the first.
#[derive(Clone, Debug, Serialize)]
pub struct BackendResult {
    /// The backend.
    pub backend: Backend,
    /// Whether it ran plain tensor operations alone, without kernels of our own.
    pub plain: bool,
    /// Median time of a step after the first, in milliseconds.
    pub milliseconds_per_step: f64,
    /// Time of the first step, which compiles kernels on a GPU.
    pub first_step_milliseconds: f64,
    /// Total loss of every step.
    pub losses: Vec<f64>,
    /// Largest relative difference of a total loss from the first backend's.
    pub largest_loss_difference: f64,
    /// Largest difference of a rendered colour in the first step.
    pub largest_color_difference: f64,
    /// Largest difference within a gradient of the first step, relative to that
    /// tensor's largest entry.
    pub largest_gradient_difference: f64,
    /// The parameter of that gradient.
    pub worst_gradient: String,
    /// L2 norm of the difference of all gradients, relative to their norm.
    pub gradient_difference_norm: f64,
    /// Most resident memory of the process after a step, in MiB, where the system
    /// tells.
    pub peak_memory_mib: Option<f64>,
}

/// The comparison of all backends.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Name of the scene.
    pub scene: String,
    /// The seed.
    pub seed: u64,
    /// Steps per backend.
    pub steps: u64,
    /// One entry per backend; the first is the reference.
    pub backends: Vec<BackendResult>,
}

/// Trains `steps` steps with the same seed on every backend; with `plain`, on each once
/// more in plain tensor operations alone, which its kernels are compared with so.
///
/// # Errors
/// If a backend has no device, or a step fails.
pub fn compare_backends(
    scene: &Scene,
    config: &TrainingConfig,
    seed: u64,
    steps: u64,
    backends: &[Backend],
    plain: bool,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<Comparison, CompareError> {
    let mut reference: Option<(Probe, Vec<f64>)> = None;
    let mut results = Vec::new();
    let twins: &[bool] = if plain { &[false, true] } else { &[false] };
    let all = backends.iter();
    for (backend, plain) in all.flat_map(|b| twins.iter().map(move |plain| (b, *plain))) {
        let device = backend.device()?;
        let fail = |source| CompareError::Train {
            backend: *backend,
            source,
        };
        let mut training = config.clone();
        if plain {
            training.kernels = Kernels::plain();
        }
        let mut trainer = Trainer::new(scene, &training, seed, &device).map_err(fail)?;
        let probe = trainer.probe(0.0).map_err(fail)?;
        let (mut losses, mut times) = (Vec::new(), Vec::new());
        let mut peak: Option<f64> = None;
        for step in 0..steps {
            let start = Instant::now();
            let report = trainer.step(step as f64 / steps as f64).map_err(fail)?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
            losses.push(report.losses.total);
            if let Some(mib) = process_memory("VmRSS:").map(|kib| kib / 1024.0) {
                peak = Some(peak.map_or(mib, |p| p.max(mib)));
            }
            progress(&backend.to_string(), (step + 1) as f64 / steps as f64);
        }
        let first_step_milliseconds = times.first().copied().unwrap_or(0.0);
        let mut later = times.split_off(times.len().min(1));
        later.sort_by(f64::total_cmp);
        let (reference_probe, reference_losses) =
            reference.get_or_insert_with(|| (probe.clone(), losses.clone()));
        let gradients = compare_gradients(&reference_probe.gradients, &probe.gradients);
        results.push(BackendResult {
            backend: *backend,
            plain,
            milliseconds_per_step: later.get(later.len() / 2).copied().unwrap_or(0.0),
            first_step_milliseconds,
            largest_loss_difference: largest(
                losses
                    .iter()
                    .zip(reference_losses.iter())
                    .map(|(a, b)| (a - b).abs() / b.abs().max(f64::MIN_POSITIVE)),
            ),
            largest_color_difference: largest(
                probe
                    .color
                    .iter()
                    .zip(&reference_probe.color)
                    .map(|(a, b)| f64::from((a - b).abs())),
            ),
            largest_gradient_difference: gradients.largest,
            worst_gradient: gradients.worst,
            gradient_difference_norm: gradients.norm,
            losses,
            peak_memory_mib: peak,
        });
    }
    Ok(Comparison {
        scene: scene.name.clone(),
        seed,
        steps,
        backends: results,
    })
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |a, b| if b.is_nan() { f64::NAN } else { a.max(b) })
}

struct GradientDifference {
    largest: f64,
    worst: String,
    norm: f64,
}

fn compare_gradients(
    reference: &BTreeMap<String, TensorData>,
    other: &BTreeMap<String, TensorData>,
) -> GradientDifference {
    let mut difference = GradientDifference {
        largest: 0.0,
        worst: String::new(),
        norm: 0.0,
    };
    let (mut squared_difference, mut squared_norm) = (0.0, 0.0);
    for (name, reference) in reference {
        let values = |data: &TensorData| -> Vec<f32> {
            let data = data.clone().convert::<f32>();
            data.try_into_vec_as().unwrap_or_default()
        };
        let reference = values(reference);
        let other = other.get(name).map(values).unwrap_or_default();
        let scale = largest(reference.iter().map(|v| f64::from(v.abs())));
        let mut worst = 0.0f64;
        for (i, a) in reference.iter().enumerate() {
            // A missing gradient counts as infinitely wrong.
            let b = other.get(i).copied().unwrap_or(f32::INFINITY);
            let d = f64::from((a - b).abs());
            worst = worst.max(d);
            squared_difference += d * d;
            squared_norm += f64::from(*a) * f64::from(*a);
        }
        let relative = worst / scale.max(1e-12);
        if relative > difference.largest {
            difference.largest = relative;
            difference.worst = name.clone();
        }
    }
    difference.norm = (squared_difference / squared_norm.max(f64::MIN_POSITIVE)).sqrt();
    difference
}

impl Comparison {
    /// The table for people.
    pub fn to_markdown(&self) -> String {
        let mut table = String::from(
            "| backend | ms per step | first step | loss difference | colour difference | gradient, worst tensor | gradient, all | memory |\n\
             |---|---|---|---|---|---|---|---|\n",
        );
        for b in &self.backends {
            let memory = b
                .peak_memory_mib
                .map_or_else(|| "–".to_owned(), |mib| format!("{mib:.0} MiB"));
            // Writing to a string cannot fail.
            let _ = writeln!(
                table,
                "| {}{} | {:.1} | {:.0} ms | {:.1e} | {:.1e} | {:.1e} {} | {:.1e} | {} |",
                b.backend,
                if b.plain { ", plain" } else { "" },
                b.milliseconds_per_step,
                b.first_step_milliseconds,
                b.largest_loss_difference,
                b.largest_color_difference,
                b.largest_gradient_difference,
                b.worst_gradient,
                b.gradient_difference_norm,
                memory,
            );
        }
        table
    }
}
