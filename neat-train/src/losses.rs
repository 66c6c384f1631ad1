//! The total loss of one iteration (paper eq. 8).

use crate::config::TrainConfig;
use crate::flops::StepRows;
use crate::model::{
    NeatModel, PlacedSamples, RenderRequest, Rendering, constant_on, host_points, host_vec,
    point_tensor,
};
use crate::training_data::Batch;
use burn::tensor::{DType, Device, Tensor, TensorData};
use nalgebra::Vector2;
use neat_core::assignment::{AssignmentError, assign};
use neat_core::{Camera, LineSegment2};
use neat_field::host_segment_loss::{HostSegmentLoss, ObservedSegment, host_segment_loss};
use neat_field::segment_loss::{SegmentLossConfig, segment_loss};
use neat_field::segment_rendering::{RayCameras, project_calibrated};
use neat_gjp::candidates::{JunctionView, RenderedSegment, matching_cost};
use neat_gjp::junction_loss::{JunctionLoss, MatchedJunctions, junction_loss};
use neat_sdf::losses::{eikonal_loss, eikonal_loss_where, mask_loss, point_loss, rgb_loss};
use neat_tensor::fused::is_fused;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// The loss terms of an iteration, before weighting, and their weighted sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Losses {
    /// The weighted sum that is minimised.
    pub total: f64,
    /// Colour.
    pub rgb: f64,
    /// Eikonal term.
    pub eikonal: f64,
    /// Silhouette.
    pub mask: f64,
    /// Segments, calibrated.
    pub segment: f64,
    /// Junctions in the world.
    pub junction_3d: f64,
    /// Junctions in the image, calibrated.
    pub junction_2d: f64,
    /// Distance of the surface from sparse points.
    #[serde(default)]
    pub points: f64,
}

/// Everything random or observed of one iteration: with it the loss is a plain
/// function of the parameters.
#[derive(Clone, Copy, Debug)]
pub struct StepInput<'a> {
    /// The rays and what was observed.
    pub batch: &'a Batch,
    /// Where the rays are sampled, by the model as it is now.
    pub samples: PlacedSamples<'a>,
    /// Points of the eikonal term besides rendered samples.
    pub eikonal_points: &'a [[f32; 3]],
    /// More of them that only the device knows, `[K, 3]`, without gradient.
    pub eikonal_samples: Option<&'a Tensor<2>>,
    /// Points that should lie on the surface.
    pub surface_points: &'a [[f32; 3]],
    /// The views that [`Batch::view_of_ray`] speaks of: camera and 2D junctions.
    pub views: &'a [JunctionView<'a>],
    /// Whether the junction terms are due.
    pub junctions_due: bool,
}

/// The loss as a tensor, and what is reported of its inside.
#[derive(Clone, Debug)]
pub struct StepLoss {
    /// The weighted sum, `[1]`.
    pub total: Tensor<1>,
    /// `total`, then the terms in the order of [`Losses`], `[8]`, without gradient.
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

/// The terms that every ray has, and what the segment term is made of.
pub(crate) struct RayTerms {
    pub rgb: Tensor<1>,
    pub eikonal: Tensor<1>,
    pub mask: Tensor<1>,
    /// Rendered colour `[R, 3]`.
    pub color: Tensor<2>,
    pub segments: Option<RenderedSegments>,
    pub rows: StepRows,
}

/// Segments along the rays that carry one.
pub(crate) struct RenderedSegments {
    /// Both ends `[R', 6]`.
    pub ends: Tensor<2>,
    /// Accumulated weight `[R', 1]`.
    pub opacity: Tensor<2>,
}

impl RenderedSegments {
    /// Those of a rendering, if any ray carries one.
    pub fn of(rendering: &Rendering) -> Option<Self> {
        let ends = rendering.segments.clone()?;
        let rays = ends.dims()[0];
        Some(Self {
            ends,
            opacity: rendering.opacity.clone().narrow(0, 0, rays),
        })
    }
}

/// Renders the batch, with or without colour; and what went through the networks
/// for all terms of it.
pub(crate) fn render_batch(
    model: &NeatModel,
    input: &StepInput<'_>,
    beta: Tensor<1>,
    config: &TrainConfig,
    color: bool,
    device: &Device,
) -> (Rendering, StepRows) {
    let batch = input.batch;
    let rendering = model.render(
        &RenderRequest {
            rays: &batch.rays,
            samples: input.samples,
            beta,
            min_sample_weight: config.min_sample_weight,
            segment_rays: batch.segment_of_ray.len(),
            color,
        },
        device,
    );
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

/// Gradients that the eikonal term is the mean over.
pub(crate) fn eikonal_rows(rows: &StepRows, config: &TrainConfig) -> usize {
    match config.eikonal.rendered_samples {
        true => rows.eikonal + rows.full,
        false => rows.eikonal,
    }
}

/// Colour, silhouette and gradients of the batch.
pub(crate) fn ray_terms(
    model: &NeatModel,
    input: &StepInput<'_>,
    beta: Tensor<1>,
    config: &TrainConfig,
    device: &Device,
) -> RayTerms {
    let batch = input.batch;
    let (rendering, rows) = render_batch(model, input, beta, config, true, device);
    let segments = RenderedSegments::of(&rendering);
    let zero = || Tensor::<1>::zeros([1], device);
    let rays = batch.rays.len();

    let color = rendering.color.clone().expect("colour was asked for");
    let rgb = rgb_loss(color.clone(), point_tensor(&batch.colors, device));

    let eikonal = eikonal_term(model, input, &rendering, config, device).unwrap_or_else(zero);
    let mask = match config.loss.mask > 0.0 {
        false => zero(),
        true => mask_loss(
            rendering.opacity,
            Tensor::from_data(TensorData::new(batch.silhouette.clone(), [rays, 1]), device),
        ),
    };
    RayTerms {
        rgb,
        eikonal,
        mask,
        color,
        segments,
        rows,
    }
}

/// The eikonal term; `None` where no gradient is asked for.
fn eikonal_term(
    model: &NeatModel,
    input: &StepInput<'_>,
    rendering: &Rendering,
    config: &TrainConfig,
    device: &Device,
) -> Option<Tensor<1>> {
    let mut points = Vec::new();
    if !input.eikonal_points.is_empty() {
        points.push(point_tensor(input.eikonal_points, device));
    }
    points.extend((input.eikonal_samples).map(|points| constant_on(device, points)));
    let mut gradients = Vec::new();
    if !points.is_empty() {
        let points = Tensor::cat(points, 0);
        gradients.push(model.implicit_network.gradient_uncapped(points));
    }
    // The bounding sphere has a slope of its own, which nothing can change.
    let rendered = (config.eikonal.rendered_samples).then(|| rendering.gradients_uncapped.clone());
    let counts = rendering.counts.clone().filter(|_| rendered.is_some());
    let counts = counts.map(|counts| {
        let all_count = gradients
            .iter()
            .map(|g| Tensor::ones([g.dims()[0], 1], device));
        Tensor::cat(all_count.chain([counts]).collect(), 0)
    });
    gradients.extend(rendered);
    if gradients.is_empty() {
        return None;
    }
    let gradients = Tensor::cat(gradients, 0);
    Some(match counts {
        Some(counts) => eikonal_loss_where(gradients, counts),
        None => eikonal_loss(gradients),
    })
}

/// Mean distance of the surface from the points that should lie on it; `None`
/// without such points.
pub(crate) fn point_term(
    model: &NeatModel,
    input: &StepInput<'_>,
    device: &Device,
) -> Option<Tensor<1>> {
    if input.surface_points.is_empty() {
        return None;
    }
    let points = point_tensor(input.surface_points, device);
    Some(point_loss(model.implicit_network.sdf_uncapped(points)))
}

/// Renders the batch and adds up the terms.
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
    let weights = &config.loss;
    let zero = || Tensor::<1>::zeros([1], device);
    let RayTerms {
        rgb,
        eikonal,
        mask,
        color,
        segments,
        rows,
    } = ray_terms(model, input, beta, config, device);

    let (mut segment, mut segment_errors) = (zero(), Vec::new());
    let (mut junction_3d, mut junction_2d, mut targets) = (zero(), zero(), 0);
    let mut assignment = Duration::ZERO;
    if let Some(RenderedSegments { ends, opacity }) = segments {
        let global = input.junctions_due.then(|| model.perceiver.junctions());
        let compared = match is_fused(device) && ends.dtype() == DType::F32 {
            true => compare_on_host(ends, opacity, global.as_ref(), input, config),
            false => compare_on_device(ends, opacity, global.as_ref(), input, config, device),
        };
        segment = compared.loss;
        if let (Some(global), Some(in_world)) = (global, compared.global_in_world) {
            let start = Instant::now();
            let global = GlobalJunctions { global, in_world };
            let matched = junction_terms(global, input, config, &compared.rays, device)?;
            assignment = start.elapsed();
            targets = matched.0;
            if let Some(JunctionLoss {
                in_world,
                calibrated,
            }) = matched.1
            {
                junction_3d = in_world;
                junction_2d = calibrated.unwrap_or_else(zero);
            }
        }
        segment_errors = compared
            .rays
            .iter()
            .map(|ray| ray.error_in_pixels)
            .collect();
    }

    let points = point_term(model, input, device).unwrap_or_else(zero);
    let total = rgb.clone().mul_scalar(weights.rgb)
        + eikonal.clone().mul_scalar(weights.eikonal)
        + mask.clone().mul_scalar(weights.mask)
        + segment.clone().mul_scalar(weights.segment)
        + junction_3d.clone().mul_scalar(weights.junction_3d)
        + junction_2d.clone().mul_scalar(weights.junction_2d)
        + points.clone().mul_scalar(weights.points);
    let terms = [
        total.clone(),
        rgb,
        eikonal,
        mask,
        segment,
        junction_3d,
        junction_2d,
        points,
    ];
    Ok(StepLoss {
        total,
        terms: Tensor::cat(terms.map(Tensor::detach).into(), 0),
        color: color.detach(),
        segment_errors,
        rows,
        targets,
        assignment,
    })
}

/// Rendered segments beside observed ones.
struct Compared {
    /// The segment loss, `[1]`.
    loss: Tensor<1>,
    /// One entry per ray that carries a segment.
    rays: Vec<ComparedRay>,
    /// Where the global junctions are, if they were given.
    global_in_world: Option<Vec<[f32; 3]>>,
}

/// The global junctions.
pub(crate) struct GlobalJunctions {
    /// `[N, 3]`.
    global: Tensor<2>,
    in_world: Vec<[f32; 3]>,
}

impl GlobalJunctions {
    /// Those of a model as it is.
    pub(crate) fn of(model: &NeatModel) -> Self {
        let global = model.perceiver.junctions();
        Self {
            in_world: host_points(global.clone()),
            global,
        }
    }
}

pub(crate) struct ComparedRay {
    /// Both rendered ends in the world.
    ends: [f32; 6],
    error_in_pixels: f32,
    counted: bool,
}

fn segment_loss_config(config: &TrainConfig) -> SegmentLossConfig {
    SegmentLossConfig {
        cutoff_in_pixels: config.loss.segment_cutoff_in_pixels,
        min_opacity: config.loss.segment_min_opacity,
        mean_over_all_rays: config.loss.segment_mean_over_all_rays,
    }
}

/// In tensor operations, for any device.
fn compare_on_device(
    ends: Tensor<2>,
    opacity: Tensor<2>,
    global: Option<&Tensor<2>>,
    input: &StepInput<'_>,
    config: &TrainConfig,
    device: &Device,
) -> Compared {
    let cameras = ray_cameras(input, device);
    let (observed, score) = observed_segments(input, device);
    let projected = project_calibrated(ends.clone(), &cameras);
    let loss = segment_loss(
        projected,
        observed,
        score,
        opacity,
        &cameras,
        segment_loss_config(config),
    );
    // The one transfer before the assignment: ends, error, counted or not; and the
    // global junctions.
    const COLUMNS: usize = 8;
    let columns = vec![ends.detach(), loss.error_in_pixels, loss.counted];
    let flat = |t: Tensor<2>| {
        let numbers = t.shape().num_elements();
        t.detach().reshape([numbers])
    };
    let rays = Tensor::cat(columns, 1);
    let of_rays = rays.dims()[0] * COLUMNS;
    let both = std::iter::once(rays).chain(global.cloned());
    let gathered = host_vec(Tensor::<1>::cat(both.map(flat).collect(), 0));
    let (rays, junctions) = gathered.split_at(of_rays);
    let rays = rays.chunks_exact(COLUMNS).map(|row| ComparedRay {
        ends: std::array::from_fn(|i| row[i]),
        error_in_pixels: row[6],
        counted: row[7] > 0.0,
    });
    Compared {
        loss: loss.loss,
        rays: rays.collect(),
        global_in_world: global.map(|_| junctions.as_chunks().0.to_vec()),
    }
}

/// In one pass on the host, where the tensors are there anyway.
fn compare_on_host(
    ends: Tensor<2>,
    opacity: Tensor<2>,
    global: Option<&Tensor<2>>,
    input: &StepInput<'_>,
    config: &TrainConfig,
) -> Compared {
    let values = host_vec(ends.clone());
    let compared = compared_with_observed(&values, &host_vec(opacity), input, config);
    let rays = compared_rays(&values, &compared);
    let linear = segment_gradient(ends, compared.gradient);
    let offset = compared.loss - host_vec(linear.clone())[0];
    Compared {
        loss: linear.add_scalar(offset),
        rays,
        global_in_world: global.map(|global| host_points(global.clone())),
    }
}

/// The segment loss of rendered ends `[R' · 6]`, with its gradient.
pub(crate) fn compared_with_observed(
    ends: &[f32],
    opacity: &[f32],
    input: &StepInput<'_>,
    config: &TrainConfig,
) -> HostSegmentLoss {
    let batch = input.batch;
    let observed: Vec<ObservedSegment<'_>> = batch
        .segment_of_ray
        .iter()
        .zip(&batch.view_of_ray)
        .map(|(segment, view)| {
            let camera = input.views[*view].camera;
            let LineSegment2 { start, end } =
                segment.segment.map(|p| camera.intrinsics.calibrate(p));
            ObservedSegment {
                camera,
                ends_calibrated: [start.x, start.y, end.x, end.y].map(|c| c as f32),
                score: segment.score as f32,
            }
        })
        .collect();
    host_segment_loss(ends, opacity, &observed, segment_loss_config(config))
}

/// What junctions are made of.
pub(crate) fn compared_rays(ends: &[f32], compared: &HostSegmentLoss) -> Vec<ComparedRay> {
    let of_rays = compared.error_in_pixels.iter().zip(&compared.counted);
    ends.chunks_exact(6)
        .zip(of_rays)
        .map(|(ends, (error, counted))| ComparedRay {
            ends: std::array::from_fn(|i| ends[i]),
            error_in_pixels: *error,
            counted: *counted,
        })
        .collect()
}

/// A tensor `[1]` whose gradient with respect to `ends` is the given one.
pub(crate) fn segment_gradient(ends: Tensor<2>, gradient: Vec<f32>) -> Tensor<1> {
    let (shape, device) = (ends.dims(), ends.device());
    (ends * Tensor::from_data(TensorData::new(gradient, shape), &device)).sum()
}

impl Losses {
    /// From the numbers of [`StepLoss::terms`].
    pub fn from_terms(terms: &[f32]) -> Self {
        let term = |i: usize| f64::from(terms[i]);
        Self {
            total: term(0),
            rgb: term(1),
            eikonal: term(2),
            mask: term(3),
            segment: term(4),
            junction_3d: term(5),
            junction_2d: term(6),
            points: term(7),
        }
    }
}

impl StepLoss {
    /// The terms on the host.
    pub fn losses(&self) -> Losses {
        Losses::from_terms(&host_vec(self.terms.clone()))
    }
}

/// Local junctions from the rendered ends, matched with the global ones.
pub(crate) fn junction_terms(
    GlobalJunctions {
        global,
        in_world: global_in_world,
    }: GlobalJunctions,
    input: &StepInput<'_>,
    config: &TrainConfig,
    rays: &[ComparedRay],
    device: &Device,
) -> Result<(usize, Option<JunctionLoss>), AssignmentError> {
    let batch = input.batch;
    let segments: Vec<RenderedSegment> = rays
        .iter()
        .zip(batch.view_of_ray.iter().zip(&batch.segment_of_ray))
        .filter(|(ray, _)| !config.only_counted_ends || ray.counted)
        .map(
            |(ComparedRay { ends: e, .. }, (view, detected))| RenderedSegment {
                view: *view,
                ends_in_world: [[e[0], e[1], e[2]], [e[3], e[4], e[5]]],
                detected: detected.segment,
            },
        )
        .collect();
    let local = config.candidates.local_junctions(&segments, input.views)?;
    if local.is_empty() {
        return Ok((0, None));
    }
    let local_in_world: Vec<[f32; 3]> = local.iter().map(|l| l.in_world).collect();

    // The 2D terms need a view per junction: they are those of a batch from one
    // view (as published), and rest in batches over many.
    let camera = match batch.view_of_ray.first() {
        Some(view) if batch.view_of_ray.iter().all(|v| v == view) => {
            Some(input.views[*view].camera)
        }
        _ => None,
    };
    let in_image = config.matching.weight_2d > 0.0 || config.loss.junction_2d > 0.0;
    let camera = camera.filter(|_| in_image);
    let calibrated = |camera: &Camera, points: &[[f32; 3]]| -> Vec<[f32; 2]> {
        points
            .iter()
            .map(|p| {
                let point = nalgebra::Vector3::from(*p).map(f64::from);
                camera.project(&point).calibrated.map(|c| c as f32).into()
            })
            .collect()
    };
    let (local_calibrated, global_calibrated, weight_2d) = match camera {
        Some(camera) => (
            calibrated(camera, &local_in_world),
            calibrated(camera, &global_in_world),
            config.matching.weight_2d,
        ),
        None => (Vec::new(), Vec::new(), 0.0),
    };
    let cost = matching_cost(
        &local_in_world,
        &local_calibrated,
        &global_in_world,
        &global_calibrated,
        weight_2d,
        config.matching.norm,
    );
    let pairs = assign(&cost, local.len(), global_in_world.len())?;
    let mut matched = MatchedJunctions::default();
    for (l, g) in pairs.pairs() {
        matched.targets.push(local_in_world[l]);
        matched.junction_of_target.push(g);
        if camera.is_some() {
            matched.targets_calibrated.push(local_calibrated[l]);
        }
    }
    let projected = camera.map(|camera| {
        let junctions = global.dims()[0];
        let cameras = camera_tensors(std::iter::repeat_n(camera, junctions), device);
        let twice = Tensor::cat(vec![global.clone(), global.clone()], 1);
        project_calibrated(twice, &cameras).narrow(1, 0, 2)
    });
    Ok((
        matched.targets.len(),
        junction_loss(global, projected, &matched),
    ))
}

fn ray_cameras(input: &StepInput<'_>, device: &Device) -> RayCameras {
    let batch = input.batch;
    camera_tensors(
        batch.view_of_ray.iter().map(|v| input.views[*v].camera),
        device,
    )
}

/// One camera per row.
fn camera_tensors<'a>(cameras: impl Iterator<Item = &'a Camera>, device: &Device) -> RayCameras {
    let (mut rotation, mut center, mut focal) = (Vec::new(), Vec::new(), Vec::new());
    let mut rows = 0;
    for camera in cameras {
        rows += 1;
        // Columns of world_from_camera are rows of camera_from_world.
        rotation.extend(camera.world_from_camera.iter().map(|c| *c as f32));
        center.extend(camera.center_in_world.iter().map(|c| *c as f32));
        let k = camera.intrinsics;
        focal.extend([k.fx, k.fy, k.skew].map(|f| f as f32));
    }
    let tensor = |values: Vec<f32>, columns: usize| {
        Tensor::from_data(TensorData::new(values, [rows, columns]), device)
    };
    RayCameras {
        camera_from_world: tensor(rotation, 9),
        center: tensor(center, 3),
        focal: tensor(focal, 3),
    }
}

/// Calibrated ends `[R', 4]` and scores `[R', 1]` of the rays' 2D segments.
fn observed_segments(input: &StepInput<'_>, device: &Device) -> (Tensor<2>, Tensor<2>) {
    let batch = input.batch;
    let rows = batch.segment_of_ray.len();
    let mut ends = Vec::with_capacity(4 * rows);
    let mut scores = Vec::with_capacity(rows);
    for (segment, view) in batch.segment_of_ray.iter().zip(&batch.view_of_ray) {
        let intrinsics = &input.views[*view].camera.intrinsics;
        let calibrate = |p: &Vector2<f64>| intrinsics.calibrate(p);
        let LineSegment2 { start, end } = segment.segment.map(calibrate);
        ends.extend([start.x, start.y, end.x, end.y].map(|c| c as f32));
        scores.push(segment.score as f32);
    }
    (
        Tensor::from_data(TensorData::new(ends, [rows, 4]), device),
        Tensor::from_data(TensorData::new(scores, [rows, 1]), device),
    )
}
