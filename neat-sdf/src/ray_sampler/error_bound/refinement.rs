//! All rays while they are refined, in memory that is kept between calls.
//!
//! A ray has at most as many samples as all iterations give it, so that every ray
//! owns a stretch of each buffer and nothing is allocated while rays are refined.

use super::opacity_error::{Sections, nearest_distance};
use crate::RayBundle;
use crate::ray_sampler::inverse_cdf::{cumulate, invert, linspace};
use neat_tensor::sampling::{FINAL_MASS_FLOOR, FLAT_STEP};
use rayon::prelude::*;

/// The rays of a call. Buffers are `[R · capacity]`, `new_z` is `[R · step]`.
#[derive(Default)]
pub(super) struct Refinement {
    /// Samples that a ray gets per iteration.
    step: usize,
    /// Samples that a ray can get in all.
    capacity: usize,
    rays: Vec<RayState>,
    z: Vec<f32>,
    sdf: Vec<f32>,
    d_star: Vec<f32>,
    cdf: Vec<f32>,
    new_z: Vec<f32>,
    /// Where distances are wanted.
    points: Vec<[f32; 3]>,
}

/// The numbers of one ray.
#[derive(Clone, Copy)]
pub(super) struct RayState {
    /// Whether it gets more samples.
    pub refining: bool,
    /// Iterations it took part in.
    pub iterations: usize,
    /// Smallest β found for which the bound holds.
    pub beta: f32,
    /// Which of the rays that ask it is.
    slot: usize,
}

/// One ray and its stretches of the buffers.
pub(super) struct Ray<'a> {
    pub state: &'a mut RayState,
    samples: Samples<'a>,
    /// Cumulative distribution over the sections.
    cdf: &'a mut [f32],
    /// Sorted positions that still need a distance.
    new_z: &'a mut [f32],
}

/// What is known along a ray, with room for more.
struct Samples<'a> {
    z: &'a mut [f32],
    sdf: &'a mut [f32],
    /// Lower bounds of the distance within the sections.
    d_star: &'a mut [f32],
}

impl Refinement {
    /// Begins with the positions `first`, `step` per ray.
    pub fn begin(&mut self, first: &[f32], step: usize, iterations: usize, epsilon: f32) {
        let rays = first.len() / step;
        self.step = step;
        self.capacity = step * iterations;
        for buffer in [&mut self.z, &mut self.sdf, &mut self.d_star, &mut self.cdf] {
            buffer.resize(rays * self.capacity, 0.0);
        }
        self.new_z.clear();
        self.new_z.extend_from_slice(first);
        self.rays.clear();
        self.rays.extend(first.chunks(step).map(|z| RayState {
            refining: true,
            iterations: 0,
            beta: initial_beta(z, epsilon),
            slot: 0,
        }));
    }

    /// The new positions of all rays that are refined, ray after ray.
    pub fn wanted(&mut self, bundle: &RayBundle) -> &[[f32; 3]] {
        self.points.clear();
        let rays = self.rays.iter_mut().zip(self.new_z.chunks(self.step));
        for (ray, (state, new_z)) in rays.enumerate().filter(|(_, (state, _))| state.refining) {
            state.slot = self.points.len() / self.step;
            let points = new_z.iter().map(|z| bundle.point(ray, *z));
            self.points.extend(points);
        }
        &self.points
    }

    /// Calls `refine` with every ray that is refined and its share of `distances`,
    /// the answer to [`Self::wanted`].
    pub fn merge_each(&mut self, distances: &[f32], refine: impl Fn(&mut Ray) + Sync) {
        let step = self.step;
        self.each()
            .filter(|ray| ray.state.refining)
            .for_each(|mut ray| {
                let start = ray.state.slot * step;
                ray.merge(&distances[start..start + step]);
                refine(&mut ray);
            });
    }

    /// New positions for every ray that is refined.
    pub fn upsample_each(&mut self) {
        self.each()
            .filter(|ray| ray.state.refining)
            .for_each(|mut ray| ray.upsample());
    }

    /// All rays, side by side.
    pub fn each(&mut self) -> impl IndexedParallelIterator<Item = Ray<'_>> {
        let capacity = self.capacity.max(1);
        (
            &mut self.rays,
            self.z.par_chunks_mut(capacity),
            self.sdf.par_chunks_mut(capacity),
            self.d_star.par_chunks_mut(capacity),
            self.cdf.par_chunks_mut(capacity),
            self.new_z.par_chunks_mut(self.step.max(1)),
        )
            .into_par_iter()
            .map(|(state, z, sdf, d_star, cdf, new_z)| Ray {
                state,
                samples: Samples { z, sdf, d_star },
                cdf,
                new_z,
            })
    }

    /// The numbers of all rays.
    pub fn states(&mut self) -> &mut [RayState] {
        &mut self.rays
    }

    /// The sections of ray `ray`.
    pub fn sections(&self, ray: usize) -> Sections<'_> {
        let len = self.rays[ray].iterations * self.step;
        let start = ray * self.capacity;
        Sections {
            z: &self.z[start..start + len],
            sdf: &self.sdf[start..start + len],
            d_star: &self.d_star[start..start + len - 1],
        }
    }
}

impl Ray<'_> {
    /// Samples it has so far.
    fn len(&self) -> usize {
        self.state.iterations * self.new_z.len()
    }

    /// Its sorted positions.
    pub fn positions(&self) -> &[f32] {
        &self.samples.z[..self.len()]
    }

    /// Merges the new positions with their distances into the old ones, from the
    /// last on, so that they need no other memory.
    fn merge(&mut self, new_sdf: &[f32]) {
        let Samples { z, sdf, d_star } = &mut self.samples;
        let (mut old, mut new) = (self.state.iterations * new_sdf.len(), new_sdf.len());
        let len = old + new;
        while new > 0 {
            let to = old + new - 1;
            if old > 0 && z[old - 1] > self.new_z[new - 1] {
                old -= 1;
                (z[to], sdf[to]) = (z[old], sdf[old]);
            } else {
                new -= 1;
                (z[to], sdf[to]) = (self.new_z[new], new_sdf[new]);
            }
        }
        for i in 0..len - 1 {
            d_star[i] = nearest_distance(z[i + 1] - z[i], sdf[i], sdf[i + 1]);
        }
        self.state.iterations += 1;
    }

    /// The line search of Algorithm 1: the wanted β if the bound holds with it,
    /// otherwise the smallest found by bisection.
    pub fn search_beta(&mut self, beta0: f32, epsilon: f32, bisections: usize) {
        // Once reached, β stays.
        if self.state.beta == beta0 {
            return;
        }
        let sections = self.samples.sections(self.len());
        if sections.holds(beta0, epsilon) {
            self.state.beta = beta0;
            return;
        }
        let (mut low, mut high) = (beta0, self.state.beta);
        for _ in 0..bisections {
            let middle = (low + high) / 2.0;
            if sections.holds(middle, epsilon) {
                high = middle;
            } else {
                low = middle;
            }
        }
        self.state.beta = high;
    }

    /// New positions where the bound is large.
    fn upsample(&mut self) {
        let (len, n, beta) = (self.len(), self.new_z.len(), self.state.beta);
        let sections = self.samples.sections(len);
        let cdf = &mut self.cdf[..len];
        fill(&mut cdf[1..], sections.bounds(beta));
        cumulate(cdf);
        let drawn = (0..n).map(|i| invert(sections.z, cdf, FLAT_STEP, linspace(i, n)));
        fill(self.new_z, drawn);
        sort_almost_sorted(self.new_z);
    }

    /// Draws positions from the rendering weights into `out`, at `u` or evenly.
    pub fn draw(&mut self, u: Option<&[f32]>, out: &mut [f32]) {
        let (len, n, beta) = (self.len(), out.len(), self.state.beta);
        let sections = self.samples.sections(len);
        let cdf = &mut self.cdf[..len];
        let masses = sections.weights(beta).map(|w| w + FINAL_MASS_FLOOR);
        fill(&mut cdf[1..], masses);
        cumulate(cdf);
        let u = (0..n).map(|i| u.map_or_else(|| linspace(i, n), |u| u[i]));
        fill(out, u.map(|u| invert(sections.z, cdf, FLAT_STEP, u)));
    }
}

impl Samples<'_> {
    /// The sections between the first `len` samples.
    fn sections(&self, len: usize) -> Sections<'_> {
        Sections {
            z: &self.z[..len],
            sdf: &self.sdf[..len],
            d_star: &self.d_star[..len - 1],
        }
    }
}

/// β large enough for the bound to hold with any distances (VolSDF, Lemma 2).
pub(crate) fn initial_beta(z: &[f32], epsilon: f32) -> f32 {
    let squares: f32 = z.windows(2).map(|p| (p[1] - p[0]) * (p[1] - p[0])).sum();
    (squares / (4.0 * (epsilon + 1.0).ln())).sqrt()
}

fn fill(out: &mut [f32], values: impl Iterator<Item = f32>) {
    for (out, value) in out.iter_mut().zip(values) {
        *out = value;
    }
}

/// Insertion sort: positions drawn at ascending numbers are in order but for the
/// rounding at the borders of intervals.
fn sort_almost_sorted(z: &mut [f32]) {
    for end in 1..z.len() {
        let mut i = end;
        while i > 0 && z[i - 1] > z[i] {
            z.swap(i - 1, i);
            i -= 1;
        }
    }
}
