//! An imitation of a trained field over a scene of blocks: proposals that are
//! right up to noise, mostly along the line of sight, and sometimes wrong.

use nalgebra::{Vector2, Vector3};
use neat_core::synthetic::{BlockData, Blocks};
use neat_core::{Camera, LineSegment3, Wireframe3d};
use neat_wireframe::{SegmentProposal, SignedDistance, ViewObservation};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::{BTreeMap, BTreeSet};

/// Standard deviation of a proposed end along the line of sight …
const DEPTH_NOISE: f64 = 0.03;
/// … and of each coordinate, in world units: 0.033 in all.
const NOISE: f64 = 0.008;
/// Share of the proposals that lie anywhere along the lines of sight, as all do
/// that belong to false detections.
const OUTLIERS: f64 = 0.05;

/// The exact surface.
pub struct BlockSurface<'a>(pub &'a Blocks);

impl SignedDistance for BlockSurface<'_> {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        points.iter().map(|point| self.0.sdf(point)).collect()
    }

    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        let answer = |point| self.0.sdf_and_gradient(point);
        points.iter().map(answer).collect()
    }
}

/// The true wireframe without the edges that fewer than `required_views` show
/// from end to end: what the 2D input supports.
pub fn supported_truth(data: &BlockData, required_views: usize) -> Wireframe3d {
    let mut views = vec![0; data.truth.edges.len()];
    for source in data
        .views
        .iter()
        .flat_map(|view| view.sources.iter().flatten())
    {
        views[source.edge] += usize::from(source.is_whole);
    }
    let is_supported = |edge: usize| views[edge] >= required_views;
    let kept: Vec<usize> = (0..views.len())
        .filter(|edge| is_supported(*edge))
        .collect();
    let ends: BTreeSet<usize> = kept
        .iter()
        .flat_map(|edge| data.truth.edges[*edge])
        .collect();
    let new_index: BTreeMap<usize, usize> = ends.iter().copied().zip(0..).collect();
    Wireframe3d {
        junctions: ends.iter().map(|end| data.truth.junctions[*end]).collect(),
        edges: kept
            .iter()
            .map(|edge| data.truth.edges[*edge].map(|end| new_index[&end]))
            .collect(),
    }
}

/// The 2D evidence of all views.
pub fn observations(data: &BlockData) -> Vec<ViewObservation> {
    data.views
        .iter()
        .map(|view| ViewObservation {
            camera: view.camera,
            segments: view.segments.clone(),
            junctions: Vec::new(),
        })
        .collect()
}

/// One proposal for every detection.
pub fn proposals(data: &BlockData, seed: u64) -> Vec<SegmentProposal> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut proposals = Vec::new();
    for (view_index, view) in data.views.iter().enumerate() {
        for (segment_in_view, detection) in view.segments.iter().enumerate() {
            let detected = &detection.segment;
            let seen = view.sources[segment_in_view].filter(|_| rng.random::<f64>() >= OUTLIERS);
            let segment = match seen {
                Some(source) => {
                    let mut moved = |end| noisy(end, &view.camera, &mut rng);
                    LineSegment3::new(moved(source.segment.start), moved(source.segment.end))
                }
                None => {
                    let mut end = |pixel| anywhere_on_ray(pixel, &view.camera, &mut rng);
                    LineSegment3::new(end(detected.start), end(detected.end))
                }
            };
            let projected = segment.map(|end| view.camera.project(end).pixel);
            proposals.push(SegmentProposal {
                view: view_index,
                segment_in_view,
                segment,
                end_error_in_pixels: detected.end_distances(&projected),
                end_spread: [0.01; 2],
            });
        }
    }
    proposals
}

fn noisy(point: Vector3<f64>, camera: &Camera, rng: &mut ChaCha8Rng) -> Vector3<f64> {
    let line_of_sight = (point - camera.center_in_world).normalize();
    let mut normal = || standard_normal(rng);
    let along = DEPTH_NOISE * normal();
    point + line_of_sight * along + Vector3::from_fn(|_, _| NOISE * normal())
}

/// Within 0.8 of the plane through the origin that faces the camera.
fn anywhere_on_ray(pixel: Vector2<f64>, camera: &Camera, rng: &mut ChaCha8Rng) -> Vector3<f64> {
    let ray = camera.ray_through(&pixel);
    let depth = camera.center_in_world.norm() + 1.6 * (rng.random::<f64>() - 0.5);
    ray.origin + ray.direction * depth
}

/// Box and Muller 1958.
fn standard_normal(rng: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}
