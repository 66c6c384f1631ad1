//! Configuration and assembly of synthetic scenes.

use super::detection::detect;
use super::viewpoints::{min_distance, viewpoints};
use super::visible_edges::{VisiblePart, visible_parts};
use super::{Frustum, Solid, render};
use crate::scene_sphere::visible_radius;
use crate::{Camera, Scene, Similarity, View, ViewImage, Wireframe3d};
use nalgebra::Vector2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What to generate.
///
/// ```
/// use neat_core::synthetic::{Solid, SyntheticScene, generate};
///
/// let config = SyntheticScene {
///     solid: Solid::Box,
///     views: 4,
///     image_size: 64,
///     ..SyntheticScene::default()
/// };
/// let data = generate(&config)?;
/// assert_eq!(data.scene.views.len(), 4);
/// assert_eq!(data.truth.junctions.len(), 8);
/// # Ok::<(), neat_core::synthetic::SyntheticError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SyntheticScene {
    /// The object.
    pub solid: Solid,
    /// Number of views.
    pub views: usize,
    /// Width of the images, in pixels, and their height unless [`Self::image_height`]
    /// says otherwise.
    pub image_size: u32,
    /// Height of the images, in pixels, where they are not square.
    pub image_height: Option<u32>,
    /// Distance of the cameras from the origin, the object's centre.
    pub camera_distance: f64,
    /// Seed of all randomness.
    pub seed: u64,
    /// Standard deviation of each coordinate of a detected vertex, in pixels.
    pub noise_in_pixels: f64,
    /// Probability that a visible part of an edge is detected.
    pub detection_rate: f64,
    /// False segments in every view.
    pub false_segments: usize,
    /// Visible parts shorter than this are never detected, in pixels.
    pub min_visible_length: f64,
    /// Lambertian shading; without it faces show their plain albedo.
    pub shading: bool,
}

impl Default for SyntheticScene {
    /// As many views as the published toy scene has, in its geometry, with
    /// detections about as good as HAWP's.
    fn default() -> Self {
        Self {
            solid: Solid::default(),
            views: 100,
            image_size: 512,
            image_height: None,
            camera_distance: 2.0,
            seed: 0,
            noise_in_pixels: 0.5,
            detection_rate: 0.8,
            false_segments: 2,
            min_visible_length: 6.0,
            shading: true,
        }
    }
}

/// Why a synthetic scene cannot be generated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("synthetic scene: {field} is {value}; choose a value from {min} to {max}")]
pub struct SyntheticError {
    /// The field of [`SyntheticScene`].
    pub field: &'static str,
    /// Its value.
    pub value: f64,
    /// Smallest possible value.
    pub min: f64,
    /// Largest possible value.
    pub max: f64,
}

impl SyntheticScene {
    /// Width and height of the images, in pixels.
    pub fn size(&self) -> (u32, u32) {
        let height = self.image_height.unwrap_or(self.image_size);
        (self.image_size, height)
    }

    /// Checks every field against its range.
    ///
    /// # Errors
    /// The first field outside its range, or not a number.
    pub fn validate(&self) -> Result<(), SyntheticError> {
        let (width, height) = self.size();
        let size = f64::from(width);
        let aspect = f64::from(height) / size;
        let nearest = min_distance(Solid::BOUNDING_RADIUS, aspect.min(1.0));
        let ranges = [
            ("views", self.views as f64, 1.0, 10_000.0),
            ("image_size", size, 16.0, 8192.0),
            ("image_height", f64::from(height), 16.0, 8192.0),
            ("camera_distance", self.camera_distance, nearest, 100.0),
            ("noise_in_pixels", self.noise_in_pixels, 0.0, size),
            ("detection_rate", self.detection_rate, 0.0, 1.0),
            ("false_segments", self.false_segments as f64, 0.0, 100_000.0),
            (
                "min_visible_length",
                self.min_visible_length,
                0.0,
                2.0 * size,
            ),
        ];
        SyntheticError::first_outside(&ranges)
    }
}

impl SyntheticError {
    /// Checks fields given as name, value, smallest and largest possible value.
    pub(super) fn first_outside(
        ranges: &[(&'static str, f64, f64, f64)],
    ) -> Result<(), SyntheticError> {
        ranges
            .iter()
            .find(|(_, value, min, max)| !(min..=max).contains(&value))
            .map_or(Ok(()), |&(field, value, min, max)| {
                Err(SyntheticError {
                    field,
                    value,
                    min,
                    max,
                })
            })
    }
}

/// A generated scene and everything that is true about it.
#[derive(Clone, Debug)]
pub struct SyntheticData {
    /// The posed images with their detected 2D wireframes.
    pub scene: Scene,
    /// The 3D wireframe that a perfect reconstruction would find.
    pub truth: Wireframe3d,
    /// The solid, with its exact signed distance.
    pub solid: Frustum,
    /// One for each view.
    pub view_truths: Vec<ViewTruth>,
}

/// What is truly to be seen in one view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewTruth {
    /// The visible parts of all edges, without noise, that are long enough.
    pub visible: Vec<VisiblePart>,
    /// For each edge of the view's 2D wireframe, the index into `visible` of
    /// the part it shows; `None` for a false segment.
    pub sources: Vec<Option<usize>>,
}

/// Generates a scene: the world is centred on the object,
/// [`Scene::original_from_world`] is the identity and [`Scene::pixel_center`] 0.5.
///
/// # Errors
/// See [`SyntheticScene::validate`].
pub fn generate(config: &SyntheticScene) -> Result<SyntheticData, SyntheticError> {
    generate_with(config, |solid, camera| {
        render(solid, camera, config.shading).into()
    })
}

/// The same scene, its images made whenever they are wanted: for scenes that are written
/// and are larger than the memory.
///
/// # Errors
/// See [`SyntheticScene::validate`].
pub fn generate_on_demand(config: &SyntheticScene) -> Result<SyntheticData, SyntheticError> {
    let solid = Arc::new(config.solid.frustum());
    generate_with(config, |_, camera| {
        let (solid, camera, shading) = (solid.clone(), *camera, config.shading);
        ViewImage::on_demand(config.size(), move || render(&solid, &camera, shading))
    })
}

fn generate_with(
    config: &SyntheticScene,
    image: impl Fn(&Frustum, &Camera) -> ViewImage + Sync,
) -> Result<SyntheticData, SyntheticError> {
    config.validate()?;
    let solid = config.solid.frustum();
    let (views, view_truths): (Vec<View>, Vec<ViewTruth>) = viewpoints(
        config.views,
        config.camera_distance,
        config.size(),
        config.seed,
    )
    .into_par_iter()
    .enumerate()
    .map(|(index, camera)| {
        let mut visible = visible_parts(&solid, &camera);
        visible.retain(|part| part.segment.length() >= config.min_visible_length);
        let (width, height) = config.size();
        let whole_image = [
            Vector2::zeros(),
            Vector2::new(f64::from(width), f64::from(height)),
        ];
        let bounds = solid.bounds_in_image(&camera).unwrap_or(whole_image);
        let (wireframe, sources) = detect(&visible, config, index, bounds);
        let view = View {
            name: format!("image_{index:04}"),
            camera,
            wireframe,
            image: image(&solid, &camera),
        };
        (view, ViewTruth { visible, sources })
    })
    .unzip();
    let sphere_radius = visible_radius(views.iter().map(|view| &view.camera));
    Ok(SyntheticData {
        scene: Scene {
            name: config.solid.name().to_owned(),
            views,
            original_from_world: Similarity::identity(),
            pixel_center: 0.5,
            sphere_radius,
            sparse_points: Vec::new(),
        },
        truth: solid.wireframe().clone(),
        solid,
        view_truths,
    })
}
