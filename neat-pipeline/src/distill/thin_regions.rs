//! The rays that are asked: those through the thin attraction regions.

use crate::config::Config;
use nalgebra::Vector2;
use neat_core::{Camera, LineSegment2, Wireframe2d};
use neat_field::attraction_region::AttractionRegions;
use neat_sdf::RayBundle;
use neat_train::batch::{push_ray, push_ray_through};

/// Half the width of the thin regions that are queried, in pixels (paper §4.3).
const THIN_REGION: f64 = 1.0;

/// The pixels of one view that the paper's back end asks for: the thin regions of
/// the segments that training knew, whose score is above `data.min_segment_score`.
/// Lines are then gathered from weaker segments too (`initial_recon` of the
/// published code).
pub fn paper_regions(
    wireframe: &Wireframe2d,
    pixel_center: f64,
    config: &Config,
) -> AttractionRegions {
    let segments: Vec<LineSegment2> = (wireframe.segments(config.data.min_segment_score).iter())
        .map(|scored| scored.segment)
        .collect();
    let (width, height) = (wireframe.width, wireframe.height);
    AttractionRegions::compute(&segments, width, height, pixel_center, THIN_REGION)
}

/// Rays of one view.
pub(super) struct Query {
    /// Rays through the centres of the pixels.
    pub rays: RayBundle,
    /// Rays through the feet of the pixels on their segments.
    pub feet: RayBundle,
}

impl Query {
    /// Through every `step`-th pixel of `regions`, in their order.
    pub fn new(
        camera: &Camera,
        pixel_center: f64,
        regions: &AttractionRegions,
        step: usize,
    ) -> Self {
        let mut query = Self {
            rays: RayBundle::default(),
            feet: RayBundle::default(),
        };
        for (pixel, foot) in regions.pixels.iter().zip(&regions.feet).step_by(step) {
            push_ray(
                &mut query.rays,
                camera,
                pixel_center,
                pixel % camera.width,
                pixel / camera.width,
            );
            let foot = Vector2::from(*foot).map(f64::from);
            push_ray_through(&mut query.feet, camera, &foot);
        }
        query
    }
}
