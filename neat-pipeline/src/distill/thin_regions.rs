//! The rays that are asked: those through the thin attraction regions.

use crate::config::Config;
use nalgebra::Vector2;
use neat_core::{Camera, LineSegment2, Wireframe2d};
use neat_field::attraction_region::AttractionRegions;
use neat_sdf::RayBundle;
use neat_train::batch::{push_ray, push_ray_through};
use neat_wireframe::ViewObservation;

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

/// Rays of one view, with the 2D segment that each asks for.
pub(super) struct Query {
    /// Rays through the centres of the pixels.
    pub rays: RayBundle,
    /// Index into the view's segments.
    pub segments: Vec<usize>,
    /// Rays through the feet of the pixels on their segments.
    pub feet: RayBundle,
}

impl Query {
    /// Of these entries of `regions`, in their order.
    pub fn of_pixels(
        camera: &Camera,
        pixel_center: f64,
        regions: &AttractionRegions,
        entries: impl IntoIterator<Item = usize>,
    ) -> Self {
        let mut query = Self {
            rays: RayBundle::default(),
            segments: Vec::new(),
            feet: RayBundle::default(),
        };
        for entry in entries {
            let pixel = regions.pixels[entry];
            push_ray(
                &mut query.rays,
                camera,
                pixel_center,
                pixel % camera.width,
                pixel / camera.width,
            );
            let foot = Vector2::from(regions.feet[entry]).map(f64::from);
            push_ray_through(&mut query.feet, camera, &foot);
            query.segments.push(regions.labels[entry] as usize);
        }
        query
    }
}

/// At most `per_segment` rays for every segment of a view, spread evenly along it.
pub(super) fn spread_query(
    observation: &ViewObservation,
    pixel_center: f64,
    per_segment: usize,
) -> Query {
    let camera = &observation.camera;
    let segments: Vec<_> = observation.segments.iter().map(|s| s.segment).collect();
    let (width, height) = (camera.width, camera.height);
    let regions = AttractionRegions::compute(&segments, width, height, pixel_center, THIN_REGION);
    let mut by_segment = vec![Vec::new(); segments.len()];
    for entry in 0..regions.len() {
        by_segment[regions.labels[entry] as usize].push(entry);
    }
    let entries = by_segment.into_iter().flat_map(|mut entries: Vec<usize>| {
        entries.sort_by(|a, b| regions.parameters[*a].total_cmp(&regions.parameters[*b]));
        spread(&entries, per_segment)
    });
    Query::of_pixels(camera, pixel_center, &regions, entries)
}

/// At most `wanted` of `entries`, evenly spread, first and last included.
fn spread(entries: &[usize], wanted: usize) -> Vec<usize> {
    if entries.len() <= wanted || wanted < 2 {
        return entries.iter().copied().take(wanted.max(1)).collect();
    }
    (0..wanted)
        .map(|i| entries[i * (entries.len() - 1) / (wanted - 1)])
        .collect()
}
