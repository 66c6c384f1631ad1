//! Importance sampling of a cached grid as one kernel. The host's version is
//! `neat_sdf::ray_sampler::GridCachedConfig`.

use super::columns::{between, count_up_to, cumulate, laplace_density, sort_almost_sorted};
use super::{empty_of, launch_size};
use crate::sampling::{GRID_FLAT_STEP, GridNumbers, MIN_HALF_CHORD_SQUARED, MIN_NEAR};
use burn_cubecl::cubecl::{self, prelude::*};
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

#[cube]
fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// Place of a coordinate among the nodes of a grid: the node below, and how far
/// beyond it.
#[cube]
fn place(x: f32, radius: f32, nodes: usize) -> (usize, f32) {
    let last = f32::cast_from(nodes - 1);
    let scale = f32::cast_from(nodes) / (2.0 * radius);
    let x = f32::clamp((x + radius) * scale - 0.5, 0.0, last);
    let base = u32::cast_from(x) as usize;
    let base = if base + 2 > nodes { nodes - 2 } else { base };
    (base, x - f32::cast_from(base))
}

/// Trilinear interpolation among `nodes³` values; beyond the outer nodes their
/// value holds.
#[cube]
fn lookup(grid: &Tensor<f32>, nodes: usize, radius: f32, x: f32, y: f32, z: f32) -> f32 {
    let (bx, fx) = place(x, radius, nodes);
    let (by, fy) = place(y, radius, nodes);
    let (bz, fz) = place(z, radius, nodes);
    let corner = (bx * nodes + by) * nodes + bz;
    let back = corner + nodes;
    let right = corner + nodes * nodes;
    let diagonal = right + nodes;
    let left_face = mix(
        mix(grid[corner], grid[corner + 1], fz),
        mix(grid[back], grid[back + 1], fz),
        fy,
    );
    let right_face = mix(
        mix(grid[right], grid[right + 1], fz),
        mix(grid[diagonal], grid[diagonal + 1], fz),
        fy,
    );
    mix(left_face, right_face, fx)
}

/// The intervals `deltas` that begin at `count` sorted positions from `start` on; the
/// last one ends at `end`.
#[cube]
fn measure(z: &mut Tensor<f32>, deltas: &mut Tensor<f32>, start: usize, count: usize, end: f32) {
    for i in 0..count {
        let next = if i + 1 < count {
            z[start + i + 1]
        } else {
            f32::max(end, z[start + i])
        };
        deltas[start + i] = next - z[start + i];
    }
}

/// Samples `out` `[R, drawn + even]` of rays `[R, 6]` (origin and direction), and
/// their intervals `deltas`.
///
/// `noise` `[lookups + drawn + even, R]` moves each within its stratum; `edges`
/// `[2 (lookups + 1), R]` is scratch for the edges and the cumulative distribution.
#[cube(launch)]
#[expect(
    clippy::too_many_arguments,
    reason = "a kernel's arguments are its bindings"
)]
fn grid_kernel(
    ray_columns: &Tensor<f32>,
    grid: &Tensor<f32>,
    beta: &Tensor<f32>,
    noise: &Tensor<f32>,
    edges: &mut Tensor<f32>,
    out: &mut Tensor<f32>,
    deltas: &mut Tensor<f32>,
    rays: usize,
    nodes: usize,
    lookups: usize,
    drawn: usize,
    even: usize,
    radius: f32,
    min_beta: f32,
    weight_floor: f32,
) {
    let ray = ABSOLUTE_POS;
    if ray < rays {
        let ox = ray_columns[6 * ray];
        let oy = ray_columns[6 * ray + 1];
        let oz = ray_columns[6 * ray + 2];
        let dx = ray_columns[6 * ray + 3];
        let dy = ray_columns[6 * ray + 4];
        let dz = ray_columns[6 * ray + 5];
        let beta = f32::max(beta[0], min_beta);

        let b = ox * dx + oy * dy + oz * dz;
        let square = b * b - (ox * ox + oy * oy + oz * oz) + radius * radius;
        let half = f32::sqrt(f32::max(square, MIN_HALF_CHORD_SQUARED));
        let near = f32::max(-b - half, MIN_NEAR);
        let end = -b + half;
        let chord = end - near;

        for i in 0..lookups {
            let t = (f32::cast_from(i) + noise[i * rays + ray]) / f32::cast_from(lookups);
            edges[i * rays + ray] = near + chord * t;
        }
        edges[lookups * rays + ray] = end;
        let first = lookups + 1;
        let mut transmittance = 1.0f32;
        for i in 0..lookups {
            let t = edges[i * rays + ray];
            let length = f32::max(edges[(i + 1) * rays + ray] - t, 0.0);
            let sdf = lookup(grid, nodes, radius, ox + t * dx, oy + t * dy, oz + t * dz);
            let passed = f32::exp(-length * laplace_density(sdf, beta));
            edges[(first + i + 1) * rays + ray] = transmittance * (1.0 - passed) + weight_floor;
            transmittance *= passed;
        }
        cumulate(edges, first, lookups, ray, rays);

        let start = ray * (drawn + even);
        let mut above = 0usize;
        for i in 0..drawn {
            let jitter = noise[(lookups + i) * rays + ray];
            let u = (f32::cast_from(i) + jitter) / f32::cast_from(drawn);
            above = count_up_to(edges, first, lookups + 1, above, u, ray, rays);
            let below = if above > 0 { above - 1 } else { 0usize };
            let upper = if above < lookups + 1 { above } else { lookups };
            out[start + i] = between(
                edges[below * rays + ray],
                edges[upper * rays + ray],
                edges[(first + below) * rays + ray],
                edges[(first + upper) * rays + ray],
                GRID_FLAT_STEP,
                u,
            );
        }
        for i in 0..even {
            let jitter = noise[(lookups + drawn + i) * rays + ray];
            let t = (f32::cast_from(i) + jitter) / f32::cast_from(even);
            out[start + drawn + i] = near + chord * t;
        }
        sort_almost_sorted(out, start, 1, drawn + even);
        measure(out, deltas, start, drawn + even, end);
    }
}

pub(crate) fn sample(
    [ray_columns, grid, beta, noise]: [CubeTensor; 4],
    numbers: GridNumbers,
) -> (CubeTensor, CubeTensor) {
    let [ray_columns, grid, beta, noise] = [ray_columns, grid, beta, noise].map(into_contiguous);
    let edges = empty_of(&noise, [2 * (numbers.lookups + 1), numbers.rays]);
    let [out, deltas] =
        std::array::from_fn(|_| empty_of(&noise, [numbers.rays, numbers.drawn + numbers.even]));
    let (count, dim) = launch_size(numbers.rays);
    grid_kernel::launch(
        &out.client,
        count,
        dim,
        ray_columns.into_tensor_arg(),
        grid.into_tensor_arg(),
        beta.into_tensor_arg(),
        noise.into_tensor_arg(),
        edges.into_tensor_arg(),
        out.clone().into_tensor_arg(),
        deltas.clone().into_tensor_arg(),
        numbers.rays,
        numbers.nodes,
        numbers.lookups,
        numbers.drawn,
        numbers.even,
        numbers.radius,
        numbers.min_beta,
        numbers.weight_floor,
    );
    (out, deltas)
}
