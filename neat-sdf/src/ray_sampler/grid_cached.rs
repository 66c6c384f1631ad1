//! Importance sampling of a cached grid of distances.
//!
//! A coarse copy of the distance field on the host replaces the many network
//! evaluations of the error-bounded sampler: a share of its nodes is refreshed
//! every few iterations.

use super::ray_sections::RaySections;
use super::redrawn::Redraw;
use super::{DistanceQuery, RayBundle, RaySamples, SamplingNoise};
use neat_tensor::sampling::{MIN_HALF_CHORD_SQUARED, MIN_NEAR};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Numbers of the grid-cached sampler.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GridCachedConfig {
    /// Nodes of the grid along each axis.
    pub resolution: usize,
    /// Nodes are refreshed every so many iterations …
    pub refresh_interval: u64,
    /// … one in so many of them, in turn.
    pub refresh_stride: usize,
    /// Look-ups in the grid per ray.
    pub lookups: usize,
    /// Samples drawn from the grid's rendering weights.
    pub importance_samples: usize,
    /// Samples spread evenly over the ray.
    pub uniform_samples: usize,
    /// Added to every look-up's weight.
    pub weight_floor: f64,
    /// Whether samples are drawn once more, by the network's distances at the first ones: the
    /// grid places them to a cell, which may be wide beside the density's scale.
    pub redraw: bool,
}

impl Default for GridCachedConfig {
    fn default() -> Self {
        Self {
            resolution: 48,
            refresh_interval: 8,
            refresh_stride: 8,
            lookups: 64,
            importance_samples: 8,
            uniform_samples: 4,
            weight_floor: 1e-4,
            redraw: false,
        }
    }
}

/// Signed distances at the centres of the cells of a cube around the origin.
#[derive(Clone, Debug)]
pub struct DistanceGrid {
    resolution: usize,
    radius: f32,
    /// `[x][y][z]`, row-major.
    values: Vec<f32>,
}

impl DistanceGrid {
    /// The distances to a sphere of `sphere_radius`, over the cube that encloses
    /// the ball of `radius`.
    pub fn sphere(resolution: usize, radius: f32, sphere_radius: f32) -> Self {
        let mut grid = Self {
            resolution,
            radius,
            values: Vec::new(),
        };
        grid.values = (0..resolution.pow(3))
            .map(|i| {
                let [x, y, z] = grid.node(i);
                (x * x + y * y + z * z).sqrt() - sphere_radius
            })
            .collect();
        grid
    }

    /// Edge length of a cell.
    pub fn cell(&self) -> f32 {
        2.0 * self.radius / self.resolution as f32
    }

    /// Nodes along each axis.
    pub fn resolution(&self) -> usize {
        self.resolution
    }

    /// Radius of the ball that the grid encloses.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// The distances at all nodes, `[x][y][z]`.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Replaces the distances at all nodes; `false` if their number is wrong.
    pub fn set_values(&mut self, values: Vec<f32>) -> bool {
        let fits = values.len() == self.values.len();
        if fits {
            self.values = values;
        }
        fits
    }

    /// Position of node `index`.
    fn node(&self, index: usize) -> [f32; 3] {
        let n = self.resolution;
        let coordinate = |i: usize| ((i as f32 + 0.5) / n as f32 * 2.0 - 1.0) * self.radius;
        [
            coordinate(index / (n * n)),
            coordinate(index / n % n),
            coordinate(index % n),
        ]
    }

    fn interleaved(&self, offset: usize, stride: usize) -> impl Iterator<Item = usize> {
        (offset..self.values.len()).step_by(stride)
    }

    /// Positions of the nodes `offset`, `offset + stride`, ….
    pub fn interleaved_nodes(&self, offset: usize, stride: usize) -> Vec<[f32; 3]> {
        let nodes = self.interleaved(offset, stride);
        nodes.map(|node| self.node(node)).collect()
    }

    /// Evaluates the nodes `offset`, `offset + stride`, ….
    pub fn update_interleaved(
        &mut self,
        offset: usize,
        stride: usize,
        query: &mut DistanceQuery<'_>,
    ) {
        let nodes: Vec<usize> = self.interleaved(offset, stride).collect();
        for nodes in nodes.chunks(QUERY_CHUNK) {
            let points: Vec<[f32; 3]> = nodes.iter().map(|i| self.node(*i)).collect();
            for (node, value) in nodes.iter().zip(query(&points)) {
                self.values[*node] = value;
            }
        }
    }

    /// Trilinear interpolation; beyond the outer nodes their value holds.
    pub fn lookup(&self, point: [f32; 3]) -> f32 {
        let n = self.resolution;
        let scale = n as f32 / (2.0 * self.radius);
        let mut base = [0usize; 3];
        let mut fraction = [0f32; 3];
        for axis in 0..3 {
            let x = ((point[axis] + self.radius) * scale - 0.5).clamp(0.0, (n - 1) as f32);
            base[axis] = (x as usize).min(n.saturating_sub(2));
            fraction[axis] = x - base[axis] as f32;
        }
        // One row of two neighbours along z for each corner in x and y.
        let [bx, by, bz] = base;
        let (right, back) = if n > 1 { (n * n, n) } else { (0, 0) };
        let along_z = |offset: usize| {
            let start = (bx * n + by) * n + bz + offset;
            let next = if n > 1 {
                self.values[start + 1]
            } else {
                self.values[start]
            };
            mix(self.values[start], next, fraction[2])
        };
        let along_y = |offset: usize| mix(along_z(offset), along_z(offset + back), fraction[1]);
        mix(along_y(0), along_y(right), fraction[0])
    }
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// Points per query while a grid is refreshed: bounds the memory of the network.
const QUERY_CHUNK: usize = 16_384;

impl GridCachedConfig {
    /// Refreshes the share of the grid that is due at `iteration`; everything at
    /// the first.
    pub(super) fn refresh(
        &self,
        grid: &mut DistanceGrid,
        iteration: u64,
        query: &mut DistanceQuery<'_>,
    ) {
        if let Some((offset, stride)) = self.due(iteration) {
            grid.update_interleaved(offset, stride, query);
        }
    }

    /// Which nodes are refreshed at `iteration`: the first, and every how many.
    pub(crate) fn due(&self, iteration: u64) -> Option<(usize, usize)> {
        if iteration == 0 {
            return Some((0, 1));
        }
        if !iteration.is_multiple_of(self.refresh_interval) {
            return None;
        }
        let turn = (iteration / self.refresh_interval) as usize % self.refresh_stride;
        Some((turn, self.refresh_stride))
    }

    pub(super) fn sample(
        &self,
        rays: &RayBundle,
        beta: f32,
        grid: &DistanceGrid,
        query: &mut DistanceQuery<'_>,
        noise: &mut impl SamplingNoise,
    ) -> RaySamples {
        let per_ray = self.importance_samples + self.uniform_samples;
        let by_grid = self.lookups + per_ray;
        let stratum = by_grid + if self.redraw { per_ray } else { 0 };
        let noise = noise.uniform(rays.len() * stratum);
        let jitter = |ray: usize, i: usize| noise.as_ref().map_or(0.5, |u| u[ray * stratum + i]);
        let samples = self.sample_by_grid(rays, beta, grid, jitter);
        if !self.redraw || rays.is_empty() {
            return samples;
        }
        let redraw = Redraw {
            sdf: &query(&rays.points(&samples.z, per_ray)),
            first: &samples,
            beta,
            weight_floor: self.weight_floor as f32,
            drawn: self.importance_samples,
        };
        redraw.samples(
            |ray| chord(rays, ray, grid.radius),
            |ray, i| jitter(ray, by_grid + i),
        )
    }

    /// Samples by the grid alone; `jitter(ray, i)` in [0, 1) says where in its stratum the
    /// look-up or sample `i` of a ray lies.
    fn sample_by_grid(
        &self,
        rays: &RayBundle,
        beta: f32,
        grid: &DistanceGrid,
        jitter: impl Fn(usize, usize) -> f32 + Sync,
    ) -> RaySamples {
        let lookups = self.lookups;
        let per_ray = self.importance_samples + self.uniform_samples;
        // A density sharper than the grid resolves would miss the surface.
        let beta = beta.max(0.5 * grid.cell());
        let mut far = vec![0.0f32; rays.len()];
        let mut z = vec![0.0f32; rays.len() * per_ray];
        z.par_chunks_mut(per_ray)
            .zip(far.par_iter_mut())
            .enumerate()
            .for_each_init(RaySections::default, |sections, (ray, (z, far))| {
                let jitter = |i: usize| jitter(ray, i);
                let (near, end) = chord(rays, ray, grid.radius);
                *far = end;
                let RaySections { edges, sdf, .. } = sections;
                edges.clear();
                edges.extend(
                    (0..lookups)
                        .map(|i| near + (end - near) * ((i as f32 + jitter(i)) / lookups as f32)),
                );
                edges.push(end);
                sdf.clear();
                sdf.extend(
                    edges[..lookups]
                        .iter()
                        .map(|t| grid.lookup(rays.point(ray, *t))),
                );
                sections.weigh(beta, self.weight_floor as f32);
                sections.draw(z, self.importance_samples, (near, end), |i| {
                    jitter(lookups + i)
                });
            });
        RaySamples::new(z, per_ray, |ray, last| (far[ray] - last).max(0.0))
    }
}

/// Where a ray enters and leaves the ball of `radius` around the origin.
fn chord(rays: &RayBundle, ray: usize, radius: f32) -> (f32, f32) {
    let (o, d) = (rays.origins[ray], rays.directions[ray]);
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let b = dot(o, d);
    let half = (b * b - dot(o, o) + radius * radius)
        .max(MIN_HALF_CHORD_SQUARED)
        .sqrt();
    ((-b - half).max(MIN_NEAR), -b + half)
}
