//! All networks of NEAT together, and the rendering of rays with them.

use crate::selection::{Selection, select};
use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use neat_field::{AttractionNetwork, AttractionNetworkConfig};
use neat_gjp::{JunctionPerceiver, PerceiverConfig};
use neat_sdf::density::laplace_density;
use neat_sdf::volume_rendering::{integrate, integrate_selected, rendering_weights};
use neat_sdf::{
    BackgroundConfig, BackgroundNetwork, DensityConfig, DeviceSamples, Distances, ImplicitNetwork,
    ImplicitNetworkConfig, ImplicitOutput, LaplaceDensity, RayBundle, RaySamples, RenderingNetwork,
    RenderingNetworkConfig,
};
use neat_tensor::host::{constant_on, host_vec, point_tensor};
use neat_tensor::random::{Purpose, stream};
use neat_tensor::{Kernels, NetworkSizeError, RowChoice};
use serde::{Deserialize, Serialize};

/// The networks; by default as published for ABC.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelConfig {
    /// Signed distance and features.
    pub implicit: ImplicitNetworkConfig,
    /// Radiance.
    pub rendering: RenderingNetworkConfig,
    /// 3D segments.
    pub attraction: AttractionNetworkConfig,
    /// From signed distance to density.
    pub density: DensityConfig,
    /// Global junctions.
    pub perceiver: PerceiverConfig,
    /// Outside of the scene ball.
    #[serde(default)]
    pub background: BackgroundConfig,
}

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
    /// Light from outside the scene ball, if any.
    pub background_network: Option<BackgroundNetwork>,
}

impl NeatModel {
    /// Initial networks: the same for a seed on every device.
    ///
    /// # Errors
    /// If a network cannot have the size that is asked for.
    pub fn new(
        config: &ModelConfig,
        scene_radius: f64,
        seed: u64,
        device: &Device,
    ) -> Result<Self, NetworkSizeError> {
        let mut rng = stream(seed, Purpose::Weights, 0);
        let features = config.implicit.features;
        let model = Self {
            implicit_network: config.implicit.init(scene_radius, &mut rng, device)?,
            rendering_network: (config.rendering).init(features, scene_radius, &mut rng, device)?,
            attraction_network: (config.attraction).init(
                features,
                scene_radius,
                &mut rng,
                device,
            )?,
            density: config.density.init(device),
            perceiver: config.perceiver.init(&mut rng, device)?,
            background_network: config.background.init(scene_radius, &mut rng, device)?,
        };
        Ok(model.with_kernels(Kernels::default()))
    }

    /// The same with all networks running these operations.
    pub fn with_kernels(mut self, kernels: Kernels) -> Self {
        self.rendering_network.mlp.kernels = kernels.clone();
        self.attraction_network.mlp.kernels = kernels.clone();
        self.perceiver.decoder.kernels = kernels.clone();
        if let Some(background) = &mut self.background_network {
            background.mlp.kernels = kernels.clone();
        }
        self.implicit_network.mlp.kernels = kernels;
        self
    }

    /// Which operations the networks run.
    pub fn kernels(&self) -> &Kernels {
        &self.implicit_network.mlp.kernels
    }
}

/// Where rays are sampled.
#[derive(Clone, Copy, Debug)]
pub enum PlacedSamples<'a> {
    /// Placed on the host; and the distances of the model that renders, to tell
    /// which samples matter.
    OnHost(&'a RaySamples, &'a Distances),
    /// Placed where the networks are. All samples are evaluated there, and those
    /// that do not matter count nothing: to leave them out, the host would have to
    /// know them.
    OnDevice(&'a DeviceSamples),
}

impl PlacedSamples<'_> {
    /// Samples per ray.
    pub fn per_ray(&self) -> usize {
        match self {
            Self::OnHost(samples, _) => samples.per_ray,
            Self::OnDevice(samples) => samples.z.dims()[1],
        }
    }
}

/// What to render along which rays.
#[derive(Clone, Debug)]
pub struct RenderRequest<'a> {
    /// The rays.
    pub rays: &'a RayBundle,
    /// Where they are sampled.
    pub samples: PlacedSamples<'a>,
    /// Scale of the density, `[1]`.
    pub beta: Tensor<1>,
    /// Networks other than the distance are evaluated, or count, only at samples
    /// with a larger weight; `None` takes all.
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
    /// The same without the bounding sphere, `[M, 3]`.
    pub gradients_uncapped: Tensor<2>,
    /// Index `ray · S + sample` of those samples; `None` where it is all.
    pub evaluated: Option<Vec<u32>>,
    /// 1 for those of them that count, else 0, `[M, 1]`; `None` where all do.
    pub counts: Option<Tensor<2>>,
    /// How many samples the segments were rendered from.
    pub segment_samples: usize,
    /// How many points of shells outside the ball were evaluated.
    pub background_points: usize,
}

impl NeatModel {
    /// Renders rays (paper eq. 1 and 4).
    pub fn render(&self, request: &RenderRequest<'_>, device: &Device) -> Rendering {
        match request.samples {
            PlacedSamples::OnHost(samples, distances) => {
                self.render_on_host(request, samples, distances, device)
            }
            PlacedSamples::OnDevice(samples) => self.render_on_device(request, samples, device),
        }
    }

    /// [`Self::render`] of samples that the host knows.
    fn render_on_host(
        &self,
        request: &RenderRequest<'_>,
        samples: &RaySamples,
        distances: &Distances,
        device: &Device,
    ) -> Rendering {
        let rays = request.rays;
        let per_ray = samples.per_ray;
        let count = rays.len();
        let total = count * per_ray;
        let points = rays.points(&samples.z, per_ray);

        // Which samples are evaluated in full has to be known before; the
        // distances that tell it are not computed again for the others.
        let selection = request.min_sample_weight.map(|min_weight| {
            let beta = host_vec(request.beta.clone())[0];
            select(samples, distances, beta, &points, min_weight)
        });
        let (sdf, output) = match &selection {
            None => self
                .implicit_network
                .evaluate_rows(point_tensor(&points, device), 0, None),
            Some(Selection {
                full, order, known, ..
            }) => {
                let ordered: Vec<[f32; 3]> = order.iter().map(|i| points[*i as usize]).collect();
                let (sdf, output) = self.implicit_network.evaluate_rows(
                    point_tensor(&ordered, device),
                    total - full.len(),
                    known.clone(),
                );
                // In the order of their rays again.
                let order = RowChoice::new(order.iter().copied(), total);
                (self.kernels().of(&sdf).add_up_rows(&order, sdf), output)
            }
        };
        let deltas = TensorData::new(samples.deltas.clone(), [count, per_ray]);
        let deltas = Tensor::<2>::from_data(deltas, device);
        let density = laplace_density(sdf.reshape([count, per_ray]), request.beta.clone());
        let weights = rendering_weights(density, deltas);

        // From here on only full samples; they are in the order of their rays.
        let (full, open) = selection.map(|s| (s.full, s.open)).unzip();
        let evaluated = full.as_ref().map_or(total, Vec::len);
        let index = |i: usize| full.as_ref().map_or(i, |full| full[i] as usize);
        let ray_columns = ray_columns(rays, &points, (0..evaluated).map(index), per_ray, device);
        let of_segments = request.segment_rays * per_ray;
        let segment_rows = full.as_ref().map_or(of_segments, |full| {
            full.partition_point(|i| (*i as usize) < of_segments)
        });
        let integral = |values: Tensor<2>, weights: Tensor<2>, ray_count: usize| match &full {
            None => integrate(weights.narrow(0, 0, ray_count), values),
            Some(full) => {
                let full = &full[..values.dims()[0]];
                let rows = RowChoice::new(full.iter().copied(), total);
                let weights = weights.reshape([total, 1]);
                let weights = self.kernels().of(&weights).pick_rows(&rows, weights);
                let rays = full.iter().map(|i| i / per_ray as u32);
                let rays = RowChoice::new(rays, ray_count);
                integrate_selected(self.kernels(), weights, values, &rays)
            }
        };
        let evaluated = Evaluated {
            ray_columns,
            output,
            weights,
            segment_rows,
            open,
        };
        Rendering {
            evaluated: full.clone(),
            ..self.integrals(request, evaluated, integral, device)
        }
    }

    /// [`Self::render`] of samples that the host does not know.
    fn render_on_device(
        &self,
        request: &RenderRequest<'_>,
        samples: &DeviceSamples,
        device: &Device,
    ) -> Rendering {
        let placed = |tensor: &Tensor<2>| constant_on(device, tensor);
        let [count, per_ray] = samples.z.dims();
        let points = placed(&samples.points);
        let (sdf, output) = self.implicit_network.evaluate_rows(points.clone(), 0, None);
        let density = laplace_density(sdf.reshape([count, per_ray]), request.beta.clone());
        let weights = rendering_weights(density, placed(&samples.deltas));
        let counts = request.min_sample_weight.map(|min_weight| {
            let heavier = weights.clone().detach().greater_elem(min_weight as f32);
            heavier.float()
        });
        let integral = |values: Tensor<2>, weights: Tensor<2>, ray_count: usize| {
            let weights = match &counts {
                Some(counts) => weights * counts.clone(),
                None => weights,
            };
            integrate(weights.narrow(0, 0, ray_count), values)
        };
        let evaluated = Evaluated {
            ray_columns: Tensor::cat(vec![points, placed(&samples.directions)], 1),
            output,
            weights,
            segment_rows: request.segment_rays * per_ray,
            open: None,
        };
        let rendering = self.integrals(request, evaluated, integral, device);
        Rendering {
            counts: counts.map(|counts| counts.reshape([count * per_ray, 1])),
            ..rendering
        }
    }

    /// Colour and segments: `integral` of what the networks say over so many rays.
    fn integrals(
        &self,
        request: &RenderRequest<'_>,
        evaluated: Evaluated,
        integral: impl Fn(Tensor<2>, Tensor<2>, usize) -> Tensor<2>,
        device: &Device,
    ) -> Rendering {
        let Evaluated {
            ray_columns,
            output,
            weights,
            segment_rows,
            open,
        } = evaluated;
        let gradients = output.gradient;
        let opacity = weights.clone().sum_dim(1);
        let mut background_points = 0;
        let color = request.color.then(|| {
            let color = self.rendering_network.forward(
                ray_columns.clone(),
                gradients.clone(),
                output.features.clone(),
            );
            let color = integral(color, weights.clone(), request.rays.len());
            let Some(background) = &self.background_network else {
                return color;
            };
            let open = open.unwrap_or_else(|| (0..request.rays.len()).collect());
            background_points = open.len() * background.shells;
            background.behind(color, opacity.clone(), request.rays, &open, device)
        });
        let segments = (request.segment_rays > 0).then(|| {
            if segment_rows == 0 {
                return Tensor::zeros([request.segment_rays, 6], device);
            }
            let head = |t: Tensor<2>| {
                if t.dims()[0] == segment_rows {
                    t
                } else {
                    t.narrow(0, 0, segment_rows)
                }
            };
            let ends = self.attraction_network.forward(
                head(ray_columns),
                head(gradients.clone()),
                head(output.features),
            );
            integral(ends, weights.clone().detach(), request.segment_rays)
        });
        Rendering {
            opacity,
            weights,
            color,
            segments,
            gradients,
            gradients_uncapped: output.gradient_uncapped,
            evaluated: None,
            counts: None,
            segment_samples: segment_rows,
            background_points,
        }
    }
}

/// What the first network says of the samples of a batch.
struct Evaluated {
    /// Points and directions `[M, 6]`.
    ray_columns: Tensor<2>,
    output: ImplicitOutput,
    /// Weights of all samples `[R, S]`.
    weights: Tensor<2>,
    /// So many first samples belong to rays that carry a segment.
    segment_rows: usize,
    /// Rays that light from outside the ball comes along; `None` where it is all.
    open: Option<Vec<usize>>,
}

/// Point and viewing direction `[N, 6]` of the samples `indices`.
fn ray_columns(
    rays: &RayBundle,
    points: &[[f32; 3]],
    indices: impl ExactSizeIterator<Item = usize>,
    per_ray: usize,
    device: &Device,
) -> Tensor<2> {
    let rows = indices.len();
    let mut columns = Vec::with_capacity(6 * rows);
    for i in indices {
        columns.extend(points[i]);
        columns.extend(rays.directions[i / per_ray]);
    }
    Tensor::from_data(TensorData::new(columns, [rows, 6]), device)
}
