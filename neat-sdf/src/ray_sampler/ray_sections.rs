//! Samples drawn by the rendering weights of the sections of a ray.

use super::inverse_cdf::{cumulate, invert};
use neat_tensor::kernels::cpu::density::passed_shares;
use neat_tensor::sampling::GRID_FLAT_STEP;

/// The sections of one ray, kept from ray to ray for their memory.
#[derive(Default)]
pub(super) struct RaySections {
    /// Where sections begin, and the last one ends.
    pub edges: Vec<f32>,
    /// The distance that stands for each section.
    pub sdf: Vec<f32>,
    lengths: Vec<f32>,
    cdf: Vec<f32>,
}

impl RaySections {
    /// Weighs the sections by a density of scale `beta`, and each by `weight_floor` more.
    pub fn weigh(&mut self, beta: f32, weight_floor: f32) {
        let Self {
            edges,
            sdf,
            lengths,
            cdf,
        } = self;
        lengths.clear();
        lengths.extend(edges.windows(2).map(|e| (e[1] - e[0]).max(0.0)));
        cdf.resize(edges.len(), 0.0);
        passed_shares(sdf, lengths, beta, &mut cdf[1..]);
        let mut transmittance = 1.0f32;
        for mass in &mut cdf[1..] {
            let passed = *mass;
            *mass = transmittance * (1.0 - passed) + weight_floor;
            transmittance *= passed;
        }
        cumulate(cdf);
    }

    /// Fills `z`, ascending: the first `drawn` by the weights, the others evenly between `near`
    /// and `far`. `jitter(i)` in [0, 1) says where in its stratum sample `i` lies.
    pub fn draw(
        &self,
        z: &mut [f32],
        drawn: usize,
        (near, far): (f32, f32),
        jitter: impl Fn(usize) -> f32,
    ) {
        let even = z.len() - drawn;
        for (i, z) in z.iter_mut().enumerate() {
            *z = if i < drawn {
                let u = (i as f32 + jitter(i)) / drawn as f32;
                invert(&self.edges, &self.cdf, GRID_FLAT_STEP, u)
            } else {
                near + (far - near) * (((i - drawn) as f32 + jitter(i)) / even as f32)
            };
        }
        z.sort_unstable_by(f32::total_cmp);
    }
}
