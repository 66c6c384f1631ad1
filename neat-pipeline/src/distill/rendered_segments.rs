//! What the field renders in the thin regions of all views.

use super::thin_regions::{Query, paper_regions};
use super::{Cancelled, OnProgress};
use crate::config::Config;
use nalgebra::Vector3;
use neat_core::{LineSegment3, Scene};
use neat_sdf::RayBundle;
use neat_tensor::host::host_vec;
use neat_train::TrainedField;
use neat_wireframe::paper::SupportedSegment;

/// Rays per rendering call: bounds the memory.
const RAY_CHUNK: usize = 2048;

/// The rendered segments of each view: along all rays of its thin regions, or along as many
/// of them as make `rays_per_segment` in the mean.
pub(super) fn rendered_segments(
    scene: &Scene,
    field: &TrainedField,
    config: &Config,
    rays_per_segment: usize,
    progress: OnProgress<'_>,
) -> Result<Vec<Vec<SupportedSegment>>, Cancelled> {
    let mut by_view = Vec::with_capacity(scene.views.len());
    for (index, view) in scene.views.iter().enumerate() {
        let regions = paper_regions(&view.wireframe, scene.pixel_center, config);
        let segments = view.wireframe.segments(config.data.min_segment_score).len();
        let most = rays_per_segment.saturating_mul(segments).max(1);
        let step = regions.pixels.len().div_ceil(most).max(1);
        let query = Query::new(&view.camera, scene.pixel_center, &regions, step);
        by_view.push(supported_segments(field, &query));
        progress((index + 1) as f64 / scene.views.len() as f64)?;
    }
    Ok(by_view)
}

fn supported_segments(field: &TrainedField, query: &Query) -> Vec<SupportedSegment> {
    let rendered = render_rays(field, &query.rays);
    let points: Vec<[f32; 3]> = rendered
        .iter()
        .map(|r| r.point.map(|c| c as f32).into())
        .collect();
    let surface = field.distances_and_gradients(&points);
    rendered
        .iter()
        .zip(surface)
        .enumerate()
        .map(|(i, (ray, (_, gradient)))| SupportedSegment {
            segment: ray.segment,
            support_point: support_point(
                &Vector3::from(query.feet.origins[i]).map(f64::from),
                &Vector3::from(query.feet.directions[i]).map(f64::from),
                &ray.point,
                &Vector3::from(gradient).map(f64::from),
            ),
        })
        .collect()
}

/// One rendered ray.
struct RenderedRay {
    segment: LineSegment3,
    /// Rendered point `Σ w x`.
    point: Vector3<f64>,
}

fn render_rays(field: &TrainedField, rays: &RayBundle) -> Vec<RenderedRay> {
    let mut rendered = Vec::with_capacity(rays.len());
    for start in (0..rays.len()).step_by(RAY_CHUNK) {
        let end = (start + RAY_CHUNK).min(rays.len());
        let chunk = RayBundle {
            origins: rays.origins[start..end].to_vec(),
            directions: rays.directions[start..end].to_vec(),
        };
        let samples = field.samples(&chunk);
        let rendering = field.render(&chunk, &samples, false);
        let ends = host_vec(rendering.segments.expect("segments of all rays"));
        let weights = host_vec(rendering.weights);
        for (ray, ends) in ends.chunks_exact(6).enumerate() {
            let range = ray * samples.per_ray..(ray + 1) * samples.per_ray;
            let mut point = Vector3::zeros();
            for i in range {
                let weight = f64::from(weights[i]);
                point += Vector3::from(chunk.point(ray, samples.z[i])).map(f64::from) * weight;
            }
            let end = |k: usize| Vector3::new(ends[k], ends[k + 1], ends[k + 2]).map(f64::from);
            rendered.push(RenderedRay {
                segment: LineSegment3::new(end(0), end(3)),
                point,
            });
        }
    }
    rendered
}

/// Where the ray through the foot meets the tangent plane at the rendered point
/// (published `l3d`; denominators are kept 1e-6 off zero, as there).
pub fn support_point(
    origin: &Vector3<f64>,
    direction: &Vector3<f64>,
    point: &Vector3<f64>,
    gradient: &Vector3<f64>,
) -> Vector3<f64> {
    let along = direction.dot(gradient);
    let guard = if along < 0.0 { -1e-6 } else { 1e-6 };
    origin + direction * ((point - origin).dot(gradient) / (along + guard))
}
