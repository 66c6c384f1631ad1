//! Rays of one iteration, with what was observed along them.

use nalgebra::Vector2;
use neat_core::{Camera, LineSegment2, ScoredSegment2};
use neat_field::host_segment_loss::ObservedSegment;
use neat_gjp::candidates::JunctionView;
use neat_sdf::RayBundle;
use std::ops::Range;

/// Rays of one iteration with what was observed along them. Rays through
/// attraction regions come first.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// The rays.
    pub rays: RayBundle,
    /// Colour of each pixel, in [0, 1].
    pub colors: Vec<[f32; 3]>,
    /// 1 where the pixel belongs to the object, else 0.
    pub silhouette: Vec<f32>,
    /// View of each ray through an attraction region.
    pub view_of_ray: Vec<usize>,
    /// The 2D segment of each such ray.
    pub segment_of_ray: Vec<ScoredSegment2>,
}

impl Batch {
    /// Rays `range`; those through attraction regions come first in it too.
    pub(crate) fn part(&self, range: &Range<usize>) -> Self {
        let segments = self.segment_of_ray.len();
        let with_segment = range.start.min(segments)..range.end.min(segments);
        Self {
            rays: RayBundle {
                origins: self.rays.origins[range.clone()].to_vec(),
                directions: self.rays.directions[range.clone()].to_vec(),
            },
            colors: self.colors[range.clone()].to_vec(),
            silhouette: self.silhouette[range.clone()].to_vec(),
            view_of_ray: self.view_of_ray[with_segment.clone()].to_vec(),
            segment_of_ray: self.segment_of_ray[with_segment].to_vec(),
        }
    }

    /// What is observed along each ray that carries a segment, in calibrated
    /// coordinates of its view.
    pub(crate) fn observed<'a>(&self, views: &[JunctionView<'a>]) -> Vec<ObservedSegment<'a>> {
        self.segment_of_ray
            .iter()
            .zip(&self.view_of_ray)
            .map(|(segment, view)| {
                let camera = views[*view].camera;
                let LineSegment2 { start, end } =
                    segment.segment.map(|p| camera.intrinsics.calibrate(p));
                ObservedSegment {
                    camera,
                    ends_calibrated: [start.x, start.y, end.x, end.y].map(|c| c as f32),
                    score: segment.score as f32,
                }
            })
            .collect()
    }
}

/// Appends the ray through the centre of pixel `(x, y)`.
pub fn push_ray(rays: &mut RayBundle, camera: &Camera, pixel_center: f64, x: u32, y: u32) {
    let point = Vector2::new(f64::from(x) + pixel_center, f64::from(y) + pixel_center);
    push_ray_through(rays, camera, &point);
}

/// Appends the ray through a point in image coordinates.
pub fn push_ray_through(rays: &mut RayBundle, camera: &Camera, point_in_image: &Vector2<f64>) {
    let ray = camera.ray_through(point_in_image);
    rays.origins.push(ray.origin.map(|c| c as f32).into());
    rays.directions.push(ray.direction.map(|c| c as f32).into());
}
