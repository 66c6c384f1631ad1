//! One iteration in several passes over some of its rays each: the same
//! gradients in less memory.
//!
//! The segment and junction terms look at all rays at once (how many count, which
//! ends become targets). A first pass without gradients renders what they need;
//! their gradient with respect to the rendered ends is then a constant of the
//! second, which adds up the gradients of the parameters chunk by chunk.

use crate::config::TrainConfig;
use crate::flops::StepRows;
use crate::losses::{
    GlobalJunctions, Losses, RayTerms, RenderedSegments, StepInput, compared_rays,
    compared_with_observed, eikonal_rows, junction_terms, point_term, ray_terms, render_batch,
    segment_gradient,
};
use crate::model::{NeatModel, PlacedSamples, host_vec};
use crate::training_data::Batch;
use burn::module::Module;
use burn::optim::{GradientsAccumulator, GradientsParams};
use burn::tensor::{Device, Tensor};
use neat_core::assignment::AssignmentError;
use neat_gjp::junction_loss::JunctionLoss;
use neat_sdf::{RayBundle, RaySamples};
use neat_tensor::parameters::GradientCheck;
use std::ops::Range;
use std::time::{Duration, Instant};

/// What an iteration did, with the gradients of the parameters.
pub(crate) struct StepGradients {
    pub losses: Losses,
    /// Mean pixel error of each rendered segment.
    pub segment_errors: Vec<f32>,
    pub rows: StepRows,
    /// Matched pairs of local and global junctions.
    pub targets: usize,
    pub assignment: Duration,
    /// Time spent on gradients.
    pub backward: Duration,
    pub gradients: GradientsParams,
    /// Whether they are numbers.
    pub finite: bool,
}

/// Rays `range` of a batch; those through attraction regions come first in it too.
fn chunk_of(batch: &Batch, range: &Range<usize>) -> Batch {
    let segments = batch.segment_of_ray.len();
    let with_segment = range.start.min(segments)..range.end.min(segments);
    Batch {
        rays: RayBundle {
            origins: batch.rays.origins[range.clone()].to_vec(),
            directions: batch.rays.directions[range.clone()].to_vec(),
        },
        colors: batch.colors[range.clone()].to_vec(),
        silhouette: batch.silhouette[range.clone()].to_vec(),
        view_of_ray: batch.view_of_ray[with_segment.clone()].to_vec(),
        segment_of_ray: batch.segment_of_ray[with_segment].to_vec(),
    }
}

/// Losses and gradients of an iteration, at most `chunk` rays at a time.
///
/// `beta` gives the scale of the density anew for every pass.
///
/// # Errors
/// If rendered end points are so far out that they cannot be matched.
pub(crate) fn chunked_step(
    model: &NeatModel,
    input: &StepInput<'_>,
    beta: impl Fn() -> Tensor<1>,
    config: &TrainConfig,
    device: &Device,
    chunk: usize,
) -> Result<StepGradients, AssignmentError> {
    let PlacedSamples::OnHost(samples, distances) = input.samples else {
        unreachable!("chunked_step: samples of steps in passes are placed on the host");
    };
    let rays = input.batch.rays.len();
    let ranges: Vec<Range<usize>> = (0..rays)
        .step_by(chunk.max(1))
        .map(|start| start..rays.min(start + chunk.max(1)))
        .collect();
    let points_per_chunk = input
        .eikonal_points
        .len()
        .div_ceil(ranges.len().max(1))
        .max(1);
    let mut eikonal_points = input.eikonal_points.chunks(points_per_chunk);
    let parts: Vec<(Batch, RaySamples, &[[f32; 3]])> = ranges
        .iter()
        .map(|range| {
            (
                chunk_of(input.batch, range),
                samples.of_rays(range.clone()),
                eikonal_points.next().unwrap_or_default(),
            )
        })
        .collect();
    let of_part = |i: usize| {
        let (batch, samples, eikonal_points) = &parts[i];
        StepInput {
            batch,
            samples: PlacedSamples::OnHost(samples, distances),
            eikonal_points,
            ..*input
        }
    };

    // Without gradients: the ends, and how many numbers each mean is over.
    let fixed = model.valid();
    let plain = device.clone().inner();
    let fixed_beta = beta().inner();
    let (mut ends, mut opacity, mut all_eikonal_rows) = (Vec::new(), Vec::new(), 0);
    for i in 0..parts.len() {
        let (input, beta) = (of_part(i), fixed_beta.clone());
        let (rendering, rows) = render_batch(&fixed, &input, beta, config, false, &plain);
        all_eikonal_rows += eikonal_rows(&rows, config);
        if let Some(segments) = RenderedSegments::of(&rendering) {
            ends.extend(host_vec(segments.ends));
            opacity.extend(host_vec(segments.opacity));
        }
    }
    let compared = compared_with_observed(&ends, &opacity, input, config);
    let mut sum = GradientsAccumulator::new();
    let mut losses = Losses {
        segment: f64::from(compared.loss),
        ..Losses::default()
    };
    let (mut targets, mut assignment, mut backward) = (0, Duration::ZERO, Duration::ZERO);
    let mut add = |loss: Tensor<1>| {
        let start = Instant::now();
        sum.accumulate(model, GradientsParams::from_grads(loss.backward(), model));
        backward += start.elapsed();
    };
    if input.junctions_due && !compared.counted.is_empty() {
        let start = Instant::now();
        let rays = compared_rays(&ends, &compared);
        let global = GlobalJunctions::of(model);
        let matched = junction_terms(global, input, config, &rays, device)?;
        assignment = start.elapsed();
        targets = matched.0;
        if let Some(JunctionLoss {
            in_world,
            calibrated,
        }) = matched.1
        {
            losses.junction_3d = f64::from(host_vec(in_world.clone())[0]);
            let mut loss = in_world.mul_scalar(config.loss.junction_3d);
            if let Some(calibrated) = calibrated {
                losses.junction_2d = f64::from(host_vec(calibrated.clone())[0]);
                loss = loss + calibrated.mul_scalar(config.loss.junction_2d);
            }
            add(loss);
        }
    }

    if let Some(points) = point_term(model, input, device) {
        losses.points = f64::from(host_vec(points.clone())[0]);
        add(points.mul_scalar(config.loss.points));
    }

    let mut rows = StepRows::default();
    let mut first_end = 0;
    for (i, range) in ranges.iter().enumerate() {
        let RayTerms {
            rgb,
            eikonal,
            mask,
            segments,
            rows: part_rows,
            ..
        } = ray_terms(model, &of_part(i), beta(), config, device);
        rows += part_rows;
        // Means over a part become their share of the mean over all.
        let of_rays = range.len() as f64 / rays as f64;
        let of_eikonal = eikonal_rows(&part_rows, config) as f64 / all_eikonal_rows.max(1) as f64;
        let terms = host_vec(Tensor::cat(
            vec![rgb.clone(), eikonal.clone(), mask.clone()],
            0,
        ));
        losses.rgb += f64::from(terms[0]) * of_rays;
        losses.eikonal += f64::from(terms[1]) * of_eikonal;
        losses.mask += f64::from(terms[2]) * of_rays;
        let mut loss = rgb.mul_scalar(config.loss.rgb * of_rays)
            + eikonal.mul_scalar(config.loss.eikonal * of_eikonal)
            + mask.mul_scalar(config.loss.mask * of_rays);
        if let Some(RenderedSegments { ends, .. }) = segments {
            let count = ends.dims()[0] * 6;
            let gradient = compared.gradient[first_end..first_end + count].to_vec();
            first_end += count;
            loss = loss + segment_gradient(ends, gradient).mul_scalar(config.loss.segment);
        }
        add(loss);
    }
    let gradients = sum.grads();
    let finite = GradientCheck::of(model, &gradients).all_finite();
    let weights = &config.loss;
    losses.total = weights.rgb * losses.rgb
        + weights.eikonal * losses.eikonal
        + weights.mask * losses.mask
        + weights.segment * losses.segment
        + weights.junction_3d * losses.junction_3d
        + weights.junction_2d * losses.junction_2d
        + weights.points * losses.points;
    Ok(StepGradients {
        losses,
        segment_errors: compared.error_in_pixels,
        rows,
        targets,
        assignment,
        backward,
        gradients,
        finite,
    })
}
