//! A step in several passes over some of the rays each, in less memory.

use super::loss::{match_junctions, render, segments, term_input};
use super::{Step, StepOutcome, StepTimings};
use crate::batch::Batch;
use crate::flops::StepRows;
use crate::losses::{Losses, StepInput, TermInput};
use crate::model::{NeatModel, PlacedSamples};
use burn::module::Module;
use burn::optim::{GradientsAccumulator, GradientsParams};
use burn::tensor::{Device, Tensor};
use neat_core::assignment::AssignmentError;
use neat_field::host_segment_loss::host_segment_loss;
use neat_field::segment_comparison::linear_in;
use neat_sdf::Distances;
use neat_sdf::ray_sampler::RaySamples;
use neat_tensor::host::{Transfer, host_points, host_vec};
use neat_tensor::parameters::GradientCheck;
use std::ops::Range;
use std::time::{Duration, Instant};

/// Some rays after the others. The segment and junction terms look at all rays at once
/// (how many count, which ends become targets): a first pass without gradients renders
/// what they need; their gradient with respect to the rendered ends is then a constant
/// of the second, which adds up the gradients of the parameters.
pub(super) fn in_passes(
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
    let (mut gradients, backward) = sum.finish();
    losses.total = losses.weighted_sum(&config.loss);
    Ok(StepOutcome {
        losses,
        color,
        segment_errors: compared.error_in_pixels,
        rows,
        targets,
        beta: None,
        finite: GradientCheck::of(model, &mut gradients).all_finite(),
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
