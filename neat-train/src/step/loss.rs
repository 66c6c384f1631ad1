//! The loss of a batch, as a function of the parameters.

use crate::config::TrainConfig;
use crate::flops::StepRows;
use crate::losses::{Losses, StepInput, TermInput};
use crate::model::{NeatModel, RenderRequest, Rendering};
use burn::tensor::{Device, Tensor};
use neat_core::assignment::AssignmentError;
use neat_field::segment_comparison::{ComparedRay, compare_segments};
use neat_gjp::candidates::RenderedSegment;
use neat_gjp::junction_loss::{JunctionLoss, JunctionMatching};
use neat_tensor::host::host_vec;
use std::time::{Duration, Instant};

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

/// Renders the rays, with or without colour; and what goes through the networks for
/// all terms of them.
pub(super) fn render(
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
        background: rendering.background_points,
    };
    (rendering, rows)
}

/// What terms are made of, before segments and junctions are compared.
pub(super) fn term_input<'a>(
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
pub(super) fn segments(rendering: &Rendering) -> Option<(Tensor<2>, Tensor<2>)> {
    let ends = rendering.segments.clone()?;
    let rays = ends.dims()[0];
    Some((ends, rendering.opacity.clone().narrow(0, 0, rays)))
}

/// The loss of the global junctions, `[N, 3]`, against what the rendered ends suggest.
pub(super) fn match_junctions(
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
