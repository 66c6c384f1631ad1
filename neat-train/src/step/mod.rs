//! One step of the optimisation, from the rays of a batch to gradients.
//!
//! [`StepExecutor::run`] places samples, renders, compares with what was observed, adds
//! the terms up and differentiates. It does so in one of three ways, with the same
//! result: all rays at once with samples that the host has placed; the same where the
//! networks are, so that a GPU never waits; or in several passes over some of the rays
//! each, in less memory.

mod loss;
mod passes;

pub use loss::{StepLoss, step_loss};

use crate::batch::Batch;
use crate::config::TrainConfig;
use crate::device_sampling::DeviceSampling;
use crate::flops::StepRows;
use crate::losses::{Losses, StepInput};
use crate::model::{NeatModel, PlacedSamples};
use crate::surface_points::KnownDistance;
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use neat_core::assignment::AssignmentError;
use neat_gjp::candidates::JunctionView;
use neat_sdf::DensityConfig;
use neat_sdf::density::BetaSchedule;
use neat_sdf::ray_sampler::{RaySampler, Seeded};
use neat_tensor::Kernels;
use neat_tensor::host::{Transfer, host_vec, index_tensor};
use neat_tensor::parameters::GradientCheck;
use neat_tensor::random::{Purpose, stream};
use passes::in_passes;
use rand::RngExt;
use std::time::{Duration, Instant};

/// What a step is taken of.
pub(crate) struct Step<'a> {
    pub model: &'a NeatModel,
    pub train: &'a TrainConfig,
    pub density: &'a DensityConfig,
    pub batch: &'a Batch,
    pub views: &'a [JunctionView<'a>],
    /// Points on the surface or at known distances from it.
    pub surface_points: &'a [KnownDistance],
    pub seed: u64,
    /// Steps done before.
    pub iteration: u64,
    /// Share of the run that is done.
    pub schedule: f64,
    pub scene_radius: f64,
}

/// What a step found, before the parameters move.
pub(crate) struct StepOutcome {
    pub losses: Losses,
    /// Rendered colour, `[·, 3]` per pass, without gradient.
    pub color: Vec<Tensor<2>>,
    /// Mean pixel error of each rendered segment.
    pub segment_errors: Vec<f32>,
    pub rows: StepRows,
    /// Matched pairs of local and global junctions.
    pub targets: usize,
    /// Scale of the density; `None` where it is learned and was not read.
    pub beta: Option<f32>,
    pub gradients: GradientsParams,
    /// Whether they are numbers.
    pub finite: bool,
    pub timings: StepTimings,
}

/// Where the time of one iteration went, on the host's clock: a device that
/// computes later shows it where its results are read.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTimings {
    /// Rays and what was observed along them.
    pub batch: Duration,
    /// Where rays are sampled, with the network evaluations for it.
    pub sampler: Duration,
    /// Rendering and losses, without the assignment.
    pub forward: Duration,
    /// Local junctions and their assignment.
    pub assignment: Duration,
    /// Gradients.
    pub backward: Duration,
    /// The parameters' move.
    pub optimiser: Duration,
}

impl StepTimings {
    /// All parts together.
    pub fn total(&self) -> Duration {
        self.batch + self.sampler + self.forward + self.assignment + self.backward + self.optimiser
    }
}

impl std::ops::AddAssign for StepTimings {
    fn add_assign(&mut self, other: Self) {
        self.batch += other.batch;
        self.sampler += other.sampler;
        self.forward += other.forward;
        self.assignment += other.assignment;
        self.backward += other.backward;
        self.optimiser += other.optimiser;
    }
}

/// Takes steps in the way that suits device and configuration.
pub(crate) struct StepExecutor {
    device: Device,
    /// The sampler; where samples are placed on the device, its state is there.
    sampler: RaySampler,
    on_device: Option<DeviceSampling>,
    /// Rays per pass, where a batch is taken in several.
    chunk: Option<usize>,
}

impl StepExecutor {
    /// For networks on `device`.
    pub fn new(
        train: &TrainConfig,
        sampler: RaySampler,
        kernels: &Kernels,
        device: &Device,
    ) -> Self {
        let chunk = train.ray_chunk.filter(|chunk| *chunk < train.rays);
        // The host cuts samples into passes, so it places them.
        let on_device = match chunk {
            Some(_) => None,
            None => DeviceSampling::new(train.rays, &sampler, kernels, device),
        };
        Self {
            device: device.clone(),
            sampler,
            on_device,
            chunk,
        }
    }

    /// Losses and gradients of a step.
    ///
    /// # Errors
    /// If rendered end points are so far out that they cannot be matched.
    pub fn run(&mut self, step: &Step<'_>) -> Result<StepOutcome, AssignmentError> {
        if let Some(sampling) = &mut self.on_device {
            return with_samples_on_device(step, &self.sampler, sampling, &self.device);
        }
        let start = Instant::now();
        let beta = host_vec(step.beta(&self.device))[0];
        let distances = step.model.implicit_network.distances(&self.device);
        let mut asked = 0;
        let mut query = |points: &[[f32; 3]]| {
            asked += points.len();
            distances.capped(points)
        };
        self.sampler.refresh(step.iteration, &mut query);
        let rays = &step.batch.rays;
        let samples = (self.sampler).sample(rays, beta, &mut query, &mut step.noise());
        let sampler = start.elapsed();

        let (mut eikonal_points, picked) = step.eikonal_points(samples.per_ray);
        let picked = picked.into_iter().enumerate();
        eikonal_points.extend(picked.map(|(ray, row)| rays.point(ray, samples.z[row])));
        let placed = PlacedSamples::OnHost(&samples, &distances);
        let input = step.input(placed, &eikonal_points, None);
        let mut outcome = match self.chunk {
            None => at_once(step, &input, None, &self.device)?.0,
            Some(chunk) => in_passes(step, &input, (&samples, &distances), chunk, &self.device)?,
        };
        outcome.beta = Some(beta);
        outcome.rows.sampler = asked;
        outcome.timings.sampler = sampler;
        Ok(outcome)
    }

    /// The sampler, with its state on the host.
    pub fn sampler(&self) -> RaySampler {
        let mut sampler = self.sampler.clone();
        if let Some(state) = self.on_device.as_ref().and_then(DeviceSampling::state) {
            assert!(sampler.restore(state), "a grid keeps its size");
        }
        sampler
    }

    /// Takes over the sampler's state of a checkpoint; `false` if it does not fit.
    pub fn restore(&mut self, state: Vec<f32>) -> bool {
        let fits = self.sampler.restore(state);
        if let Some(on_device) = &mut self.on_device {
            on_device.take_over(&self.sampler);
        }
        fits
    }
}

/// A step whose samples are placed where the networks are. Whether Algorithm 1 was
/// given enough iterations is known only when the step is over: if not, it is done
/// again.
fn with_samples_on_device(
    step: &Step<'_>,
    sampler: &RaySampler,
    sampling: &mut DeviceSampling,
    device: &Device,
) -> Result<StepOutcome, AssignmentError> {
    loop {
        let start = Instant::now();
        let placed = sampling.sample(
            sampler,
            &step.batch.rays,
            step.iteration,
            step.beta(device),
            &step.model.implicit_network,
            step.noise(),
        );
        let time = start.elapsed();
        let (eikonal_points, picked) = step.eikonal_points(placed.samples.z.dims()[1]);
        let picked = (!picked.is_empty()).then(|| {
            let points = placed.samples.points.clone();
            let rows = index_tensor(picked.into_iter(), &points.device());
            points.select(0, rows)
        });
        let samples = PlacedSamples::OnDevice(&placed.samples);
        let input = step.input(samples, &eikonal_points, picked.as_ref());
        let (mut outcome, progress) = at_once(step, &input, placed.progress, device)?;
        if let Some(progress) = progress
            && !sampling.sufficed(progress)
        {
            tracing::debug!(
                iteration = step.iteration,
                "samples not refined enough: again"
            );
            continue;
        }
        outcome.rows.sampler = placed.asked;
        outcome.timings.sampler = time;
        return Ok(outcome);
    }
}

impl Step<'_> {
    /// Scale of the density, `[1]`, as a function of the parameters where it is learned.
    fn beta(&self, device: &Device) -> Tensor<1> {
        match self.annealed_beta() {
            Some(beta) => Tensor::from_data([beta], device),
            None => self.model.density.beta(),
        }
    }

    fn annealed_beta(&self) -> Option<f32> {
        let annealed = self.density.schedule == BetaSchedule::Annealed;
        annealed.then(|| self.density.annealed_beta(self.schedule) as f32)
    }

    /// The random decisions of the sampler.
    fn noise(&self) -> Seeded<impl rand::Rng + Clone + use<>> {
        Seeded(stream(self.seed, Purpose::Samples, self.iteration))
    }

    /// The points of the eikonal term besides rendered samples: those drawn in the cube
    /// around the scene, and of one sample per ray, if asked for, the index
    /// `ray · per_ray + sample`.
    fn eikonal_points(&self, per_ray: usize) -> (Vec<[f32; 3]>, Vec<usize>) {
        let config = &self.train.eikonal;
        let rays = self.batch.rays.len();
        let mut rng = stream(self.seed, Purpose::Eikonal, self.iteration);
        let radius = self.scene_radius as f32;
        let points = (0..config.uniform_points.unwrap_or(rays))
            .map(|_| std::array::from_fn(|_| (rng.random::<f32>() * 2.0 - 1.0) * radius))
            .collect();
        let picked = if config.one_sample_per_ray {
            let pick = |ray: usize| ray * per_ray + rng.random_range(0..per_ray);
            (0..rays).map(pick).collect()
        } else {
            Vec::new()
        };
        (points, picked)
    }

    fn input<'a>(
        &'a self,
        samples: PlacedSamples<'a>,
        eikonal_points: &'a [[f32; 3]],
        eikonal_samples: Option<&'a Tensor<2>>,
    ) -> StepInput<'a> {
        let interval = self.train.junction_interval.max(1);
        StepInput {
            batch: self.batch,
            samples,
            eikonal_points,
            eikonal_samples,
            surface_points: self.surface_points,
            views: self.views,
            junctions_due: (self.iteration + 1).is_multiple_of(interval),
        }
    }
}

/// All rays at once. `progress` `[2]` is read with the results.
fn at_once(
    step: &Step<'_>,
    input: &StepInput<'_>,
    progress: Option<Tensor<1>>,
    device: &Device,
) -> Result<(StepOutcome, Option<[f32; 2]>), AssignmentError> {
    let start = Instant::now();
    let loss = step_loss(step.model, input, step.beta(device), step.train, device)?;
    let forward = start.elapsed() - loss.assignment;
    let start = Instant::now();
    let mut gradients = GradientsParams::from_grads(loss.total.backward(), step.model);
    let check = GradientCheck::of(step.model, &mut gradients);
    // Of a device, everything is read at once when the step is over.
    let mut transfer = Transfer::default();
    let terms = transfer.add(loss.terms.inner());
    let annealed = step.annealed_beta();
    let placed_on_device = matches!(input.samples, PlacedSamples::OnDevice(_));
    let unknown_beta = placed_on_device && annealed.is_none();
    let beta = unknown_beta.then(|| transfer.add(step.beta(device).inner()));
    let progress = progress.map(|progress| transfer.add(progress));
    let sum = check.on_device.map(|sum| transfer.add(sum));
    let numbers = transfer.read();
    let finite = sum.is_none_or(|sum| numbers[sum].iter().all(|x| x.is_finite()));
    let outcome = StepOutcome {
        losses: Losses::from_terms(&numbers[terms]),
        color: vec![loss.color],
        segment_errors: loss.segment_errors,
        rows: loss.rows,
        targets: loss.targets,
        beta: beta.map(|beta| numbers[beta.start]).or(annealed),
        gradients,
        finite: check.on_host && finite,
        timings: StepTimings {
            forward,
            assignment: loss.assignment,
            backward: start.elapsed(),
            ..StepTimings::default()
        },
    };
    let progress = progress.map(|place| [numbers[place.start], numbers[place.start + 1]]);
    Ok((outcome, progress))
}
