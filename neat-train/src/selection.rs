//! Which samples and rays of a batch need more than their distances.

use neat_sdf::volume_rendering::rendering_weights_on_host;
use neat_sdf::{Distances, RaySamples};
use neat_tensor::KnownRows;
use std::sync::Arc;

/// Samples heavier than `min_weight`; never none (the heaviest stays), so that no
/// tensor is empty.
pub(crate) fn select(
    samples: &RaySamples,
    network: &Distances,
    beta: f32,
    points: &[[f32; 3]],
    min_weight: f64,
) -> Selection {
    let (mut distances, pass) = network.pass(points);
    network.cap(points, &mut distances);
    let weights = rendering_weights_on_host(&distances, samples, beta);
    let opacities = weights.chunks(samples.per_ray).map(|ray| ray.iter().sum());
    let open = (opacities.enumerate())
        .filter(|(_, opacity): &(usize, f32)| 1.0 - opacity > min_weight as f32)
        .map(|(ray, _)| ray);
    let open = open.collect();
    let samples = 0..weights.len() as u32;
    let weight = |i: u32| weights[i as usize];
    let (mut full, mut light): (Vec<u32>, Vec<u32>) = samples
        .clone()
        .partition(|i| weight(*i) > min_weight as f32);
    if full.is_empty() {
        let heaviest = samples.max_by(|a, b| weight(*a).total_cmp(&weight(*b)));
        full = heaviest.into_iter().collect();
        light.retain(|i| Some(*i) != heaviest);
    }
    let order: Arc<[u32]> = full.iter().chain(&light).copied().collect();
    Selection {
        full,
        open,
        known: pass.map(|pass| KnownRows {
            pass,
            rows: Arc::clone(&order),
        }),
        order,
    }
}

/// Which samples all networks are evaluated at.
pub(crate) struct Selection {
    /// Their indices, ascending.
    pub full: Vec<u32>,
    /// All indices: those of `full`, then the others.
    pub order: Arc<[u32]>,
    /// What the pass that told the weights knows of the samples in that order.
    pub known: Option<KnownRows>,
    /// Rays of which more than the least weight is left behind the last sample.
    pub open: Vec<usize>,
}
