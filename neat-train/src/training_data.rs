//! What training needs of a scene, prepared once: attraction regions, segments
//! and the pixels to draw rays through.

use crate::batch::{Batch, push_ray};
use crate::config::{BatchViews, TrainConfig, TrainingConfig};
use nalgebra::Vector2;
use neat_core::{Camera, Scene, SceneError, ScoredSegment2, ViewImage};
use neat_field::region_pixels::RegionPixels;
use neat_tensor::random::{Purpose, stream};
use rand::{Rng, RngExt};

/// Pixels whose largest channel exceeds this belong to the object, where the
/// background is black.
const SILHOUETTE_THRESHOLD: f32 = 0.08;

/// A view as training sees it.
#[derive(Clone, Debug)]
pub struct TrainingView {
    /// Intrinsics and pose.
    pub camera: Camera,
    /// Detected segments above the score threshold.
    pub segments: Vec<ScoredSegment2>,
    /// All detected junctions, in image coordinates.
    pub junctions: Vec<Vector2<f64>>,
    regions: RegionPixels,
    image: ViewImage,
}

/// All views, and where each view's region pixels begin in the sequence of all.
#[derive(Clone, Debug)]
pub struct TrainingData {
    /// The views of the scene, in its order.
    pub views: Vec<TrainingView>,
    pixel_center: f64,
    first_region_pixel: Vec<usize>,
}

impl TrainingData {
    /// Prepares a scene: segments, attraction regions, pixels.
    pub fn new(scene: &Scene, config: &TrainingConfig) -> Self {
        let min_score = config.min_segment_score;
        let regions = RegionPixels::of_scene(scene, min_score, config.attraction_distance);
        let views: Vec<TrainingView> = scene
            .views
            .iter()
            .zip(regions)
            .map(|(view, regions)| TrainingView {
                camera: view.camera,
                segments: view.wireframe.segments(min_score),
                junctions: view.wireframe.vertices.clone(),
                regions,
                image: view.image.clone(),
            })
            .collect();
        let mut first_region_pixel = vec![0];
        for view in &views {
            first_region_pixel
                .push(first_region_pixel[first_region_pixel.len() - 1] + view.regions.len());
        }
        Self {
            views,
            pixel_center: scene.pixel_center,
            first_region_pixel,
        }
    }

    /// Number of pixels in all attraction regions.
    pub fn region_pixels(&self) -> usize {
        self.first_region_pixel[self.views.len()]
    }

    /// The rays of iteration `iteration`.
    ///
    /// # Errors
    /// If an image lies in a file that cannot be read.
    pub fn batch(
        &self,
        train: &TrainConfig,
        seed: u64,
        iteration: u64,
    ) -> Result<Batch, SceneError> {
        let mut rng = stream(seed, Purpose::Rays, iteration);
        let background = (train.rays as f64 * train.background_share) as usize;
        let through_regions = train.rays - background;
        let mut batch = Batch::default();
        match train.views {
            BatchViews::All => {
                for _ in 0..through_regions {
                    let pixel = rng.random_range(0..self.region_pixels());
                    let view = self.first_region_pixel.partition_point(|f| *f <= pixel) - 1;
                    self.push_region_ray(&mut batch, view, pixel - self.first_region_pixel[view])?;
                }
            }
            BatchViews::One => {
                let view = self.view_of_iteration(seed, iteration);
                let available = self.views[view].regions.len();
                if train.with_replacement {
                    for _ in 0..through_regions {
                        let entry = rng.random_range(0..available);
                        self.push_region_ray(&mut batch, view, entry)?;
                    }
                } else {
                    let wanted = through_regions.min(available);
                    for entry in rand::seq::index::sample(&mut rng, available, wanted) {
                        self.push_region_ray(&mut batch, view, entry)?;
                    }
                }
            }
        }
        for _ in 0..background {
            let view = match train.views {
                BatchViews::All => rng.random_range(0..self.views.len()),
                BatchViews::One => self.view_of_iteration(seed, iteration),
            };
            self.push_any_ray(&mut batch, view, &mut rng)?;
        }
        Ok(batch)
    }

    /// Every view once per epoch, in an order drawn for the epoch; views without
    /// a region pixel are passed over.
    fn view_of_iteration(&self, seed: u64, iteration: u64) -> usize {
        let mut order: Vec<usize> = (0..self.views.len())
            .filter(|v| !self.views[*v].regions.is_empty())
            .collect();
        let views = order.len() as u64;
        let mut rng = stream(seed, Purpose::ViewOrder, iteration / views);
        for i in (1..order.len()).rev() {
            order.swap(i, rng.random_range(0..=i));
        }
        order[(iteration % views) as usize]
    }

    fn push_region_ray(
        &self,
        batch: &mut Batch,
        view: usize,
        entry: usize,
    ) -> Result<(), SceneError> {
        let from = &self.views[view];
        let (pixel, label) = from.regions.get(entry);
        let width = from.camera.width;
        self.push_pixel(batch, view, pixel % width, pixel / width)?;
        batch.view_of_ray.push(view);
        batch.segment_of_ray.push(from.segments[label as usize]);
        Ok(())
    }

    fn push_any_ray(
        &self,
        batch: &mut Batch,
        view: usize,
        rng: &mut impl Rng,
    ) -> Result<(), SceneError> {
        let camera = &self.views[view].camera;
        let x = rng.random_range(0..camera.width);
        let y = rng.random_range(0..camera.height);
        self.push_pixel(batch, view, x, y)
    }

    fn push_pixel(&self, batch: &mut Batch, view: usize, x: u32, y: u32) -> Result<(), SceneError> {
        let view = &self.views[view];
        push_ray(&mut batch.rays, &view.camera, self.pixel_center, x, y);
        let color = view.image.pixel(x, y)?.0.map(|c| f32::from(c) / 255.0);
        let largest = color.into_iter().fold(0.0, f32::max);
        batch.colors.push(color);
        batch.silhouette.push(if largest > SILHOUETTE_THRESHOLD {
            1.0
        } else {
            0.0
        });
        Ok(())
    }
}
