//! A trained field: what distillation and rendering ask.

use crate::checkpoint_metadata::metadata;
use crate::config::TrainingConfig;
use crate::error::TrainError;
use crate::model::{NeatModel, PlacedSamples, RenderRequest, Rendering};
use burn::tensor::{Device, Tensor};
use nalgebra::Vector3;
use neat_sdf::ray_sampler::{Deterministic, DistanceGrid, RaySampler, RaySamples};
use neat_sdf::{Distances, RayBundle};
use neat_tensor::checkpoint::Checkpoint;
use neat_tensor::host::{host_points, host_vec, point_tensor};
use neat_tensor::parameters::load_parameters;
use neat_wireframe::SignedDistance;
use std::collections::BTreeMap;

/// Points per network call: bounds the memory of a query.
const POINT_CHUNK: usize = 16_384;
/// Nodes along each axis of the grid that answers coarse distance queries.
const SURFACE_RESOLUTION: usize = 64;

/// Networks without gradients, on their device.
#[derive(Debug)]
pub struct TrainedField {
    model: NeatModel,
    distances: Distances,
    sampler: RaySampler,
    /// Scale of the density.
    pub beta: f32,
    /// Radius of the modelled ball.
    pub scene_radius: f64,
    min_sample_weight: Option<f64>,
    device: Device,
}

impl TrainedField {
    pub(crate) fn new(
        model: NeatModel,
        sampler: RaySampler,
        beta: f32,
        scene_radius: f64,
        min_sample_weight: Option<f64>,
        device: Device,
    ) -> Self {
        let mut field = Self {
            distances: model.implicit_network.distances(&device),
            model,
            sampler,
            beta,
            scene_radius,
            min_sample_weight,
            device,
        };
        let mut sampler = field.sampler.clone();
        sampler.refresh_all(&mut |points: &[[f32; 3]]| field.distances(points));
        field.sampler = sampler;
        field
    }

    /// The field of a checkpoint.
    ///
    /// # Errors
    /// If the checkpoint does not fit the configuration.
    pub fn load(
        config: &TrainingConfig,
        checkpoint: &Checkpoint,
        device: &Device,
    ) -> Result<Self, TrainError> {
        let scene_radius = metadata(checkpoint, "scene_radius")?;
        let beta: f64 = metadata(checkpoint, "beta")?;
        let parameters: BTreeMap<_, _> = checkpoint
            .tensors
            .iter()
            .filter_map(|(name, data)| {
                Some((name.strip_prefix("model.")?.to_owned(), data.clone()))
            })
            .collect();
        let model = NeatModel::new(&config.model, scene_radius, 0, device)?;
        let model = model.with_kernels(config.kernels.clone());
        let model = load_parameters(model, parameters, None)?;
        let initial_radius = config.model.implicit.initial_sphere * scene_radius;
        Ok(Self::new(
            model,
            config.train.sampler.init(scene_radius, initial_radius),
            beta as f32,
            scene_radius,
            config.train.min_sample_weight,
            device.clone(),
        ))
    }

    /// Where the samples of `rays` lie, without randomness.
    pub fn samples(&self, rays: &RayBundle) -> RaySamples {
        let mut query = |points: &[[f32; 3]]| self.distances(points);
        self.sampler
            .sample(rays, self.beta, &mut query, &mut Deterministic)
    }

    /// Renders rays without randomness: segments of all, and colour if asked for.
    pub fn render(&self, rays: &RayBundle, samples: &RaySamples, color: bool) -> Rendering {
        let request = RenderRequest {
            rays,
            samples: PlacedSamples::OnHost(samples, &self.distances),
            beta: Tensor::from_data([self.beta], &self.device),
            min_sample_weight: self.min_sample_weight,
            segment_rays: rays.len(),
            color,
        };
        self.model.render(&request, &self.device)
    }

    /// The global junctions in the world.
    pub fn junctions(&self) -> Vec<Vector3<f64>> {
        host_points(self.model.perceiver.junctions())
            .into_iter()
            .map(|p| Vector3::from(p).map(f64::from))
            .collect()
    }

    /// The capped signed distance at each point.
    pub fn distances(&self, points: &[[f32; 3]]) -> Vec<f32> {
        self.distances.capped(points)
    }

    /// The capped signed distance and its raw gradient at each point.
    pub fn distances_and_gradients(&self, points: &[[f32; 3]]) -> Vec<(f32, [f32; 3])> {
        points
            .chunks(POINT_CHUNK)
            .flat_map(|chunk| {
                let points = point_tensor(chunk, &self.device);
                let output = self.model.implicit_network.evaluate(points);
                host_vec(output.sdf)
                    .into_iter()
                    .zip(host_points(output.gradient))
            })
            .collect()
    }

    /// The 3D segment that the attraction field holds at each point, seen along the unit vector
    /// of the same index in `directions`: both ends one after the other. A network without
    /// viewing directions does not look at these.
    ///
    /// # Panics
    /// If there are not as many directions as points.
    pub fn segments(&self, points: &[[f32; 3]], directions: &[[f32; 3]]) -> Vec<[f32; 6]> {
        assert_eq!(
            points.len(),
            directions.len(),
            "TrainedField::segments: points and directions"
        );
        let chunks = points.chunks(POINT_CHUNK);
        (chunks.zip(directions.chunks(POINT_CHUNK)))
            .flat_map(|(points, directions)| {
                let points = point_tensor(points, &self.device);
                let rays = vec![points.clone(), point_tensor(directions, &self.device)];
                let output = self.model.implicit_network.evaluate(points);
                let ends = self.model.attraction_network.forward(
                    Tensor::cat(rays, 1),
                    output.gradient,
                    output.features,
                );
                host_vec(ends).as_chunks().0.to_vec()
            })
            .collect()
    }

    /// A coarse copy of the surface on the host, for many cheap queries.
    pub fn surface_grid(&self) -> SurfaceGrid<'_> {
        let mut grid = DistanceGrid::sphere(SURFACE_RESOLUTION, self.scene_radius as f32, 0.0);
        grid.update_interleaved(0, 1, &mut |points: &[[f32; 3]]| self.distances(points));
        SurfaceGrid { field: self, grid }
    }
}

fn to_f32(points: &[Vector3<f64>]) -> Vec<[f32; 3]> {
    points.iter().map(|p| p.map(|c| c as f32).into()).collect()
}

impl SignedDistance for TrainedField {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        self.distances(&to_f32(points))
            .into_iter()
            .map(f64::from)
            .collect()
    }

    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        self.distances_and_gradients(&to_f32(points))
            .into_iter()
            .map(|(sdf, g)| (f64::from(sdf), Vector3::from(g).map(f64::from)))
            .collect()
    }
}

/// Distances interpolated in a grid; gradients still from the network.
#[derive(Debug)]
pub struct SurfaceGrid<'a> {
    field: &'a TrainedField,
    grid: DistanceGrid,
}

impl SignedDistance for SurfaceGrid<'_> {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        to_f32(points)
            .into_iter()
            .map(|p| f64::from(self.grid.lookup(p)))
            .collect()
    }

    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        self.field.sdf_and_gradient(points)
    }
}
