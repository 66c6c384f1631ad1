//! A whole view, rendered.

use image::RgbImage;
use neat_core::Camera;
use neat_sdf::RayBundle;
use neat_tensor::host::{host_points, host_vec};
use neat_train::TrainedField;
use neat_train::batch::push_ray;

/// Rays per rendering call: bounds the memory.
const RAY_CHUNK: usize = 2048;

/// Colour, depth and normals of a view, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedView {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Colour in [0, 1].
    pub color: Vec<[f32; 3]>,
    /// Expected distance along the ray `Σ w z`; 0 where nothing is.
    pub depth: Vec<f32>,
    /// Unit normal in the world, weighted over the samples; 0 where nothing is.
    pub normal: Vec<[f32; 3]>,
}

/// Renders every `downscale`-th pixel of a view along both axes.
///
/// `progress` receives the share that is done.
pub fn render_view(
    field: &TrainedField,
    camera: &Camera,
    pixel_center: f64,
    downscale: u32,
    progress: &mut dyn FnMut(f64),
) -> RenderedView {
    let step = downscale.max(1);
    let pixels: Vec<(u32, u32)> = (0..camera.height)
        .step_by(step as usize)
        .flat_map(|y| {
            (0..camera.width)
                .step_by(step as usize)
                .map(move |x| (x, y))
        })
        .collect();
    let mut view = RenderedView {
        width: camera.width.div_ceil(step),
        height: camera.height.div_ceil(step),
        color: Vec::with_capacity(pixels.len()),
        depth: Vec::with_capacity(pixels.len()),
        normal: Vec::with_capacity(pixels.len()),
    };
    for chunk in pixels.chunks(RAY_CHUNK) {
        let mut rays = RayBundle::default();
        for (x, y) in chunk {
            push_ray(&mut rays, camera, pixel_center, *x, *y);
        }
        view.append(field, &rays);
        progress(view.color.len() as f64 / pixels.len() as f64);
    }
    view
}

impl RenderedView {
    fn append(&mut self, field: &TrainedField, rays: &RayBundle) {
        let samples = field.samples(rays);
        let rendering = field.render(rays, &samples, true);
        self.color
            .extend(host_points(rendering.color.expect("colour was asked for")));
        let weights = host_vec(rendering.weights);
        let gradients = host_points(rendering.gradients);
        let mut normals = vec![[0.0f32; 3]; rays.len()];
        let evaluated: Vec<u32> = rendering
            .evaluated
            .unwrap_or_else(|| (0..weights.len() as u32).collect());
        for (sample, gradient) in evaluated.into_iter().zip(gradients) {
            let sample = sample as usize;
            let normal = &mut normals[sample / samples.per_ray];
            for axis in 0..3 {
                normal[axis] += weights[sample] * gradient[axis];
            }
        }
        self.normal.extend(normals.into_iter().map(|n| {
            let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
            if length > 1e-6 {
                n.map(|c| c / length)
            } else {
                [0.0; 3]
            }
        }));
        self.depth.extend(
            weights
                .chunks(samples.per_ray)
                .zip(samples.z.chunks(samples.per_ray))
                .map(|(w, z)| w.iter().zip(z).map(|(w, z)| w * z).sum::<f32>()),
        );
    }
}

/// Every `step`-th pixel of a photograph along both axes, beginning with the
/// first one: those that [`render_view`] renders.
pub fn every_nth_pixel(photo: &RgbImage, step: u32) -> RgbImage {
    let step = step.max(1);
    let (width, height) = (photo.width().div_ceil(step), photo.height().div_ceil(step));
    RgbImage::from_fn(width, height, |x, y| *photo.get_pixel(x * step, y * step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn every_nth_pixel_begins_with_the_first() {
        let photo = RgbImage::from_fn(5, 4, |x, y| Rgb([x as u8, y as u8, 7]));
        let third = every_nth_pixel(&photo, 3);
        assert_eq!(third.dimensions(), (2, 2));
        assert_eq!(third.get_pixel(0, 0).0, [0, 0, 7]);
        assert_eq!(third.get_pixel(1, 1).0, [3, 3, 7]);
        assert_eq!(every_nth_pixel(&photo, 1), photo);
    }
}
