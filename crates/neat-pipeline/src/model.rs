//! All networks of NEAT together, and the rendering of rays with them.

use crate::config::ModelConfig;
use burn::module::Module;
use burn::tensor::{Device, Int, Tensor, TensorData};
use neat_field::AttractionNetwork;
use neat_gjp::JunctionPerceiver;
use neat_sdf::density::laplace_density;
use neat_sdf::volume_rendering::{integrate, integrate_selected, rendering_weights};
use neat_sdf::{ImplicitNetwork, LaplaceDensity, RayBundle, RaySamples, RenderingNetwork};
use neat_tensor::random::{Purpose, stream};

/// Signed distance, radiance, attraction field, density scale and junctions.
#[derive(Module, Debug)]
pub struct NeatModel {
    /// Points → signed distance and features.
    pub implicit_network: ImplicitNetwork,
    /// … → colour.
    pub rendering_network: RenderingNetwork,
    /// … → 3D segment.
    pub attraction_network: AttractionNetwork,
    /// Scale of the density.
    pub density: LaplaceDensity,
    /// Global junctions.
    pub perceiver: JunctionPerceiver,
}

impl NeatModel {
    /// Initial networks: the same for a seed on every device.
    pub fn new(config: &ModelConfig, scene_radius: f64, seed: u64, device: &Device) -> Self {
        let mut rng = stream(seed, Purpose::Weights, 0);
        let features = config.implicit.features;
        Self {
            implicit_network: config.implicit.init(scene_radius, &mut rng, device),
            rendering_network: config.rendering.init(features, &mut rng, device),
            attraction_network: config.attraction.init(features, &mut rng, device),
            density: config.density.init(device),
            perceiver: config.perceiver.init(&mut rng, device),
        }
    }
}

/// What to render along which rays.
#[derive(Clone, Debug)]
pub struct RenderRequest<'a> {
    /// The rays.
    pub rays: &'a RayBundle,
    /// Where they are sampled.
    pub samples: &'a RaySamples,
    /// Scale of the density, `[1]`.
    pub beta: Tensor<1>,
    /// Networks other than the distance are evaluated only at samples with a
    /// larger weight; `None` evaluates all.
    pub min_sample_weight: Option<f64>,
    /// Segments are rendered for so many first rays.
    pub segment_rays: usize,
    /// Whether colour is rendered.
    pub color: bool,
}

/// What came out, for `R` rays.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Weights of the samples `[R, S]`.
    pub weights: Tensor<2>,
    /// Their sum `[R, 1]`.
    pub opacity: Tensor<2>,
    /// Colour `[R, 3]`.
    pub color: Option<Tensor<2>>,
    /// Both ends of the segments `[segment_rays, 6]`. The weights act without
    /// gradient, as published, and are not normalised.
    pub segments: Option<Tensor<2>>,
    /// Gradient of the distance `[M, 3]` at the samples that were evaluated.
    pub gradients: Tensor<2>,
    /// Index `ray · S + sample` of those samples; `None` where it is all.
    pub evaluated: Option<Vec<u32>>,
}

/// Points as a tensor `[N, 3]`.
pub fn point_tensor(points: &[[f32; 3]], device: &Device) -> Tensor<2> {
    Tensor::from_data(
        TensorData::new(points.as_flattened().to_vec(), [points.len(), 3]),
        device,
    )
}

fn index_tensor(indices: impl Iterator<Item = usize>, device: &Device) -> Tensor<1, Int> {
    let indices: Vec<i64> = indices.map(|i| i as i64).collect();
    let len = indices.len();
    Tensor::from_data(TensorData::new(indices, [len]), device)
}

impl NeatModel {
    /// Renders rays (paper eq. 1 and 4).
    pub fn render(&self, request: &RenderRequest<'_>, device: &Device) -> Rendering {
        let RenderRequest { rays, samples, .. } = *request;
        let per_ray = samples.per_ray;
        let count = rays.len();
        let points = point_tensor(&rays.points(&samples.z, per_ray), device); // [R S, 3]
        let deltas = Tensor::<2>::from_data(
            TensorData::new(samples.deltas.clone(), [count, per_ray]),
            device,
        );
        let weights_of = |sdf: Tensor<2>| {
            let density = laplace_density(sdf.reshape([count, per_ray]), request.beta.clone());
            rendering_weights(density, deltas.clone())
        };

        let Some(min_weight) = request.min_sample_weight else {
            let output = self.implicit_network.evaluate(points.clone());
            let weights = weights_of(output.sdf);
            let gradients = output.gradient;
            let directions = index_tensor((0..count * per_ray).map(|i| i / per_ray), device);
            let directions = point_tensor(&rays.directions, device).select(0, directions);
            let color = request.color.then(|| {
                let color = self.rendering_network.forward(
                    points.clone(),
                    directions.clone(),
                    gradients.clone(),
                    output.features.clone(),
                );
                integrate(weights.clone(), color)
            });
            let rows = request.segment_rays * per_ray;
            let segments = (rows > 0).then(|| {
                let first = |t: &Tensor<2>| t.clone().narrow(0, 0, rows);
                let ends = self.attraction_network.forward(
                    first(&points),
                    first(&directions),
                    first(&gradients),
                    first(&output.features),
                );
                let weights = weights.clone().detach().narrow(0, 0, request.segment_rays);
                integrate(weights, ends)
            });
            return Rendering {
                opacity: weights.clone().sum_dim(1),
                weights,
                color,
                segments,
                gradients,
                evaluated: None,
            };
        };

        // The weights need distances only, but which samples matter is known
        // after that: one forward pass serves both, and its recorded
        // pre-activations give the gradient where it is wanted.
        let distances = self.implicit_network.record(points.clone());
        let weights = weights_of(distances.sdf());
        let evaluated = heavy_samples(&weights, min_weight);
        let rows = index_tensor(evaluated.iter().map(|i| *i as usize), device);
        let output = distances.at_rows(&self.implicit_network, rows.clone());
        let gradients = output.gradient;
        let ray_of_sample = index_tensor(evaluated.iter().map(|i| *i as usize / per_ray), device);
        let points = points.select(0, rows.clone());
        let directions = point_tensor(&rays.directions, device).select(0, ray_of_sample.clone());
        let weight = weights
            .clone()
            .reshape([count * per_ray, 1])
            .select(0, rows);
        let color = request.color.then(|| {
            let color = self.rendering_network.forward(
                points.clone(),
                directions.clone(),
                gradients.clone(),
                output.features.clone(),
            );
            integrate_selected(weight.clone(), color, ray_of_sample.clone(), count)
        });
        // Samples are ordered by ray, so those of the first rays come first.
        let first = evaluated.partition_point(|i| (*i as usize) < request.segment_rays * per_ray);
        let segments = (request.segment_rays > 0).then(|| {
            let head = |t: &Tensor<2>| t.clone().narrow(0, 0, first);
            if first == 0 {
                return Tensor::zeros([request.segment_rays, 6], device);
            }
            let ends = self.attraction_network.forward(
                head(&points),
                head(&directions),
                head(&gradients),
                head(&output.features),
            );
            integrate_selected(
                head(&weight).detach(),
                ends,
                ray_of_sample.clone().narrow(0, 0, first),
                request.segment_rays,
            )
        });
        Rendering {
            opacity: weights.clone().sum_dim(1),
            weights,
            color,
            segments,
            gradients,
            evaluated: Some(evaluated),
        }
    }
}

/// Indices of the samples heavier than `min_weight`, ascending; never empty
/// (the heaviest stays), so that no tensor is.
fn heavy_samples(weights: &Tensor<2>, min_weight: f64) -> Vec<u32> {
    let weights = host_vec(weights.clone());
    let min_weight = min_weight as f32;
    let heavy: Vec<u32> = (0..weights.len() as u32)
        .filter(|i| weights[*i as usize] > min_weight)
        .collect();
    if heavy.is_empty() {
        let heaviest = (0..weights.len())
            .max_by(|a, b| weights[*a].total_cmp(&weights[*b]))
            .unwrap_or(0);
        return vec![heaviest as u32];
    }
    heavy
}

/// The values of a tensor on the host, row-major, as float32.
pub fn host_vec<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor
        .detach()
        .into_data()
        .convert::<f32>()
        .try_into_vec_as()
        .expect("host_vec: just converted to float32")
}

/// The rows of a tensor `[N, 3]` on the host.
pub fn host_points(tensor: Tensor<2>) -> Vec<[f32; 3]> {
    host_vec(tensor)
        .chunks_exact(3)
        .map(|p| [p[0], p[1], p[2]])
        .collect()
}
