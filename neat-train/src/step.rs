//! One step of the optimisation, from the rays of a batch to gradients.
//!
//! [`StepExecutor::run`] places samples, renders, compares with what was observed, adds
//! the terms up and differentiates. It does so in one of three ways, with the same
//! result: all rays at once with samples that the host has placed; the same where the
//! networks are, so that a GPU never waits; or in several passes over some of the rays
//! each, in less memory.

use crate::batch::Batch;
use crate::config::TrainConfig;
use crate::device_sampling::DeviceSampling;
use crate::flops::StepRows;
use crate::losses::{Losses, StepInput, TermInput};
use crate::model::{NeatModel, PlacedSamples, RenderRequest, Rendering};
use burn::module::Module;
use burn::optim::{GradientsAccumulator, GradientsParams};
use burn::tensor::{Device, Tensor};
use neat_core::assignment::AssignmentError;
use neat_field::host_segment_loss::host_segment_loss;
use neat_field::segment_comparison::{ComparedRay, compare_segments, linear_in};
use neat_gjp::candidates::{JunctionView, RenderedSegment};
use neat_gjp::junction_loss::{JunctionLoss, JunctionMatching};
use neat_sdf::density::BetaSchedule;
use neat_sdf::ray_sampler::{RaySampler, RaySamples, Seeded};
use neat_sdf::{DensityConfig, Distances};
use neat_tensor::Kernels;
use neat_tensor::host::{Transfer, host_points, host_vec, index_tensor};
use neat_tensor::parameters::GradientCheck;
use neat_tensor::random::{Purpose, stream};
use rand::RngExt;
use std::ops::Range;
use std::time::{Duration, Instant};

/// What a step is taken of.
pub(crate) struct Step<'a> {
    pub model: &'a NeatModel,
    pub train: &'a TrainConfig,
    pub density: &'a DensityConfig,
    pub batch: &'a Batch,
    pub views: &'a [JunctionView<'a>],
    /// Points that should lie on the surface.
    pub surface_points: &'a [[f32; 3]],
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
    let gradients = GradientsParams::from_grads(loss.total.backward(), step.model);
    let check = GradientCheck::of(step.model, &gradients);
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

/// The loss as a tensor, and what is reported of its inside.
#[derive(Clone, Debug)]
pub struct StepLoss {
    /// The weighted sum, `[1]`.
    pub total: Tensor<1>,
    /// `total`, then the terms in the order of [`crate::LOSS_TERMS`], without gradient.
    pub terms: Tensor<1>,
    /// Rendered colour `[R, 3]`, without gradient.
    pub color: Tensor<2>,
    /// Mean pixel error of each rendered segment `[R']`.
    pub segment_errors: Vec<f32>,
    /// Rows that went through the networks, but for the sampler's.
    pub rows: StepRows,
    /// Matched pairs of local and global junctions.
    pub targets: usize,
    /// Time spent on local junctions and their assignment.
    pub assignment: Duration,
}

impl StepLoss {
    /// The terms on the host.
    pub fn losses(&self) -> Losses {
        Losses::from_terms(&host_vec(self.terms.clone()))
    }
}

/// Renders the batch with a density of scale `beta` `[1]`, compares it with what was
/// observed, and adds up the terms (paper eq. 8).
///
/// # Errors
/// If rendered end points are so far out that they cannot be matched.
pub fn step_loss(
    model: &NeatModel,
    input: &StepInput<'_>,
    beta: Tensor<1>,
    config: &TrainConfig,
    device: &Device,
) -> Result<StepLoss, AssignmentError> {
    let (rendering, rows) = render(model, input, beta, config, true, device);
    let mut terms = term_input(model, input, config, Some(&rendering), device);
    let (mut rays, mut targets, mut assignment) = (Vec::new(), 0, Duration::ZERO);
    if let Some((ends, opacity)) = segments(&rendering) {
        let global = input.junctions_due.then(|| model.perceiver.junctions());
        let observed = input.batch.observed(input.views);
        let counting = config.loss.segments();
        let backend = model.kernels().of(&ends);
        let compared =
            compare_segments(backend, ends, opacity, &observed, counting, global.as_ref());
        terms.segment = Some(compared.loss);
        rays = compared.rays;
        if let (Some(global), Some(in_world)) = (global, compared.also) {
            let start = Instant::now();
            let in_world: &[[f32; 3]] = in_world.as_chunks().0;
            (targets, terms.junctions) = match_junctions(&rays, global, in_world, input, config)?;
            assignment = start.elapsed();
        }
    }
    let (total, terms) = config.loss.add_up(terms.all_values(), device);
    Ok(StepLoss {
        total,
        terms,
        color: rendering.color.expect("colour was asked for").detach(),
        segment_errors: rays.iter().map(|ray| ray.error_in_pixels).collect(),
        rows,
        targets,
        assignment,
    })
}

/// Some rays after the others. The segment and junction terms look at all rays at once
/// (how many count, which ends become targets): a first pass without gradients renders
/// what they need; their gradient with respect to the rendered ends is then a constant
/// of the second, which adds up the gradients of the parameters.
fn in_passes(
    step: &Step<'_>,
    input: &StepInput<'_>,
    placed: (&RaySamples, &Distances),
    chunk: usize,
    device: &Device,
) -> Result<StepOutcome, AssignmentError> {
    let start = Instant::now();
    let (model, config) = (step.model, step.train);
    let parts = parts_of(input, placed.0, chunk);
    let (ends, opacity, gradient_rows) = render_ends(step, input, &parts, placed.1, device);
    let observed = input.batch.observed(input.views);
    let compared = host_segment_loss(&ends, &opacity, &observed, config.loss.segments());
    let mut sum = Sum::new(model);
    let mut losses = Losses {
        segment: f64::from(compared.loss),
        ..Losses::default()
    };
    let mut of_batch = term_input(model, input, config, None, device);
    let (mut targets, mut assignment) = (0, Duration::ZERO);
    if input.junctions_due && !compared.counted.is_empty() {
        let start = Instant::now();
        let global = model.perceiver.junctions();
        let in_world = host_points(global.clone());
        let rays = compared.rays(&ends);
        (targets, of_batch.junctions) = match_junctions(&rays, global, &in_world, input, config)?;
        assignment = start.elapsed();
    }
    if let Some(loss) = add_terms(&of_batch, None, &mut losses) {
        sum.add(loss);
    }

    let (mut rows, mut color) = (StepRows::default(), Vec::new());
    let mut of_ends = compared.gradient.chunks(6);
    for part in &parts {
        let part_input = part.input(input, placed.1);
        let beta = step.beta(device);
        let (rendering, part_rows) = render(model, &part_input, beta, config, true, device);
        rows += part_rows;
        color.extend(rendering.color.clone().map(Tensor::detach));
        // Means over a part become their share of the mean over all.
        let of_rays = part.batch.rays.len() as f64 / input.batch.rays.len() as f64;
        let part_gradients = config.eikonal_rows(&part_rows);
        let of_gradients = part_gradients as f64 / gradient_rows.max(1) as f64;
        let of_part = term_input(model, &part_input, config, Some(&rendering), device);
        let terms = add_terms(&of_part, Some([of_rays, of_gradients]), &mut losses);
        let of_segments = segments(&rendering).map(|(ends, _)| {
            let gradient = of_ends.by_ref().take(ends.dims()[0]).flatten().copied();
            linear_in(ends, gradient.collect()).mul_scalar(config.loss.segment)
        });
        // What the gradients do not need is given back before they are taken.
        drop(rendering);
        if let Some(loss) = terms
            .into_iter()
            .chain(of_segments)
            .reduce(|sum, term| sum + term)
        {
            sum.add(loss);
        }
    }
    let (gradients, backward) = sum.finish();
    losses.total = losses.weighted_sum(&config.loss);
    Ok(StepOutcome {
        losses,
        color,
        segment_errors: compared.error_in_pixels,
        rows,
        targets,
        beta: None,
        finite: GradientCheck::of(model, &gradients).all_finite(),
        gradients,
        timings: StepTimings {
            forward: start.elapsed().saturating_sub(assignment + backward),
            assignment,
            backward,
            ..StepTimings::default()
        },
    })
}

/// The terms that a part of a batch has shares in (of rays and of gradients), or those of
/// the whole batch: their values added to `losses`, and weighted and added up.
fn add_terms(
    input: &TermInput<'_>,
    of_part: Option<[f64; 2]>,
    losses: &mut Losses,
) -> Option<Tensor<1>> {
    let shares = input.shares(of_part);
    let mut transfer = Transfer::default();
    let places: Vec<_> = (shares.iter())
        .map(|(_, _, value)| transfer.add(value.clone().detach()))
        .collect();
    if places.is_empty() {
        return None;
    }
    let numbers = transfer.read();
    let weighted = shares
        .into_iter()
        .zip(places)
        .map(|((term, share, value), place)| {
            *(term.value)(losses) += f64::from(numbers[place.start]) * share;
            value.mul_scalar((term.weight)(input.weights) * share)
        });
    weighted.reduce(|sum, term| sum + term)
}

/// Some rays of a batch.
struct Part<'a> {
    batch: Batch,
    samples: RaySamples,
    eikonal_points: &'a [[f32; 3]],
}

impl Part<'_> {
    fn input<'a>(&'a self, whole: &StepInput<'a>, distances: &'a Distances) -> StepInput<'a> {
        StepInput {
            batch: &self.batch,
            samples: PlacedSamples::OnHost(&self.samples, distances),
            eikonal_points: self.eikonal_points,
            ..*whole
        }
    }
}

/// The batch cut into parts of at most `chunk` rays.
fn parts_of<'a>(input: &StepInput<'a>, samples: &RaySamples, chunk: usize) -> Vec<Part<'a>> {
    let (rays, chunk) = (input.batch.rays.len(), chunk.max(1));
    let ranges: Vec<Range<usize>> = (0..rays)
        .step_by(chunk)
        .map(|start| start..rays.min(start + chunk))
        .collect();
    let points = input.eikonal_points.len().div_ceil(ranges.len().max(1));
    let mut eikonal_points = input.eikonal_points.chunks(points.max(1));
    let part = |range: &Range<usize>| Part {
        batch: input.batch.part(range),
        samples: samples.of_rays(range.clone()),
        eikonal_points: eikonal_points.next().unwrap_or_default(),
    };
    ranges.iter().map(part).collect()
}

/// Without gradients: the rendered ends `[R' · 6]` of all parts, the accumulated weights
/// of their rays, and how many gradients the eikonal term is the mean over.
fn render_ends(
    step: &Step<'_>,
    input: &StepInput<'_>,
    parts: &[Part<'_>],
    distances: &Distances,
    device: &Device,
) -> (Vec<f32>, Vec<f32>, usize) {
    let (fixed, plain) = (step.model.valid(), device.clone().inner());
    let beta = step.beta(device).inner();
    let (mut ends, mut opacity, mut gradient_rows) = (Vec::new(), Vec::new(), 0);
    for part in parts {
        let input = part.input(input, distances);
        let (rendering, rows) = render(&fixed, &input, beta.clone(), step.train, false, &plain);
        gradient_rows += step.train.eikonal_rows(&rows);
        if let Some((part_ends, part_opacity)) = segments(&rendering) {
            ends.extend(host_vec(part_ends));
            opacity.extend(host_vec(part_opacity));
        }
    }
    (ends, opacity, gradient_rows)
}

/// Gradients of the parameters, added up.
struct Sum<'a> {
    model: &'a NeatModel,
    gradients: GradientsAccumulator<NeatModel>,
    time: Duration,
}

impl<'a> Sum<'a> {
    fn new(model: &'a NeatModel) -> Self {
        Self {
            model,
            gradients: GradientsAccumulator::new(),
            time: Duration::ZERO,
        }
    }

    fn add(&mut self, loss: Tensor<1>) {
        let start = Instant::now();
        let gradients = GradientsParams::from_grads(loss.backward(), self.model);
        self.gradients.accumulate(self.model, gradients);
        self.time += start.elapsed();
    }

    fn finish(mut self) -> (GradientsParams, Duration) {
        (self.gradients.grads(), self.time)
    }
}

/// Renders the rays, with or without colour; and what goes through the networks for
/// all terms of them.
fn render(
    model: &NeatModel,
    input: &StepInput<'_>,
    beta: Tensor<1>,
    config: &TrainConfig,
    color: bool,
    device: &Device,
) -> (Rendering, StepRows) {
    let batch = input.batch;
    let request = RenderRequest {
        rays: &batch.rays,
        samples: input.samples,
        beta,
        min_sample_weight: config.min_sample_weight,
        segment_rays: batch.segment_of_ray.len(),
        color,
    };
    let rendering = model.render(&request, device);
    let samples = batch.rays.len() * input.samples.per_ray();
    let eikonal_samples = input.eikonal_samples.map_or(0, |points| points.dims()[0]);
    let rows = StepRows {
        sampler: 0,
        samples,
        full: rendering.evaluated.as_ref().map_or(samples, Vec::len),
        segment: rendering.segment_samples,
        eikonal: input.eikonal_points.len() + eikonal_samples,
    };
    (rendering, rows)
}

/// What terms are made of, before segments and junctions are compared.
fn term_input<'a>(
    model: &'a NeatModel,
    step: &'a StepInput<'a>,
    config: &'a TrainConfig,
    rendering: Option<&'a Rendering>,
    device: &'a Device,
) -> TermInput<'a> {
    TermInput {
        model,
        step,
        weights: &config.loss,
        eikonal: &config.eikonal,
        rendering,
        segment: None,
        junctions: None,
        device,
    }
}

/// Rendered ends `[R', 6]` and the accumulated weight `[R', 1]` of their rays, if any
/// ray carries a segment.
fn segments(rendering: &Rendering) -> Option<(Tensor<2>, Tensor<2>)> {
    let ends = rendering.segments.clone()?;
    let rays = ends.dims()[0];
    Some((ends, rendering.opacity.clone().narrow(0, 0, rays)))
}

/// The loss of the global junctions, `[N, 3]`, against what the rendered ends suggest.
fn match_junctions(
    rays: &[ComparedRay],
    global: Tensor<2>,
    global_in_world: &[[f32; 3]],
    input: &StepInput<'_>,
    config: &TrainConfig,
) -> Result<(usize, Option<JunctionLoss>), AssignmentError> {
    let batch = input.batch;
    let of_rays = batch.view_of_ray.iter().zip(&batch.segment_of_ray);
    let segments: Vec<RenderedSegment> = rays
        .iter()
        .zip(of_rays)
        .filter(|(ray, _)| !config.only_counted_ends || ray.counted)
        .map(
            |(ComparedRay { ends: e, .. }, (view, detected))| RenderedSegment {
                view: *view,
                ends_in_world: [[e[0], e[1], e[2]], [e[3], e[4], e[5]]],
                detected: detected.segment,
            },
        )
        .collect();
    let matching = JunctionMatching {
        candidates: &config.candidates,
        matching: &config.matching,
        in_image: config.loss.junction_2d > 0.0,
        views: input.views,
    };
    matching.loss(&segments, global, global_in_world)
}
