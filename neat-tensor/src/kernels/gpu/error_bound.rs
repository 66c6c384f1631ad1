//! VolSDF's Algorithm 1 as kernels: one iteration, and the final draw. The host's
//! version is `neat_sdf::ray_sampler::ErrorBoundConfig`; running sums are float32
//! here and float64 there.

use super::columns::{
    between, count_up_to, cumulate, laplace_density, linspace, sort_almost_sorted,
};
use super::{empty_of, launch_size};
use crate::sampling::{
    DrawNumbers, FINAL_MASS_FLOOR, FLAT_STEP, MAX_ERROR_FACTOR, RefineNumbers, SATURATED,
};
use burn_cubecl::cubecl::{self, prelude::*};
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

/// Lower bound of the distance to the surface within a section (VolSDF Theorem 1).
#[cube]
fn nearest_distance(length: f32, d0: f32, d1: f32) -> f32 {
    let mut nearest = 0.0f32;
    if d0 * d1 > 0.0 {
        let b = f32::abs(d0);
        let c = f32::abs(d1);
        if length * length + b * b <= c * c {
            nearest = b;
        } else if length * length + c * c <= b * b {
            nearest = c;
        } else if b + c - length > 0.0 {
            let s = (length + b + c) / 2.0;
            let square = s * (s - length) * (s - b) * (s - c);
            nearest = 2.0 * f32::sqrt(f32::max(square, 0.0)) / length;
        }
    }
    nearest
}

/// Error of one section's density integral (VolSDF eq. 14).
#[cube]
fn section_error(length: f32, d_star: f32, beta: f32) -> f32 {
    f32::exp(-d_star / beta) * length * length / (4.0 * beta * beta)
}

/// The bound on the opacity's error behind sections with the given integrals.
#[cube]
fn opacity_error(error: f32, energy: f32) -> f32 {
    let factor = f32::min(f32::exp(f32::min(error, SATURATED)), MAX_ERROR_FACTOR);
    (factor - 1.0) * f32::exp(-energy)
}

/// Whether the bound is at most `epsilon` at all sections of a ray. `samples` holds
/// positions and, from row `room` on, distances; `nearest` the bounds of the
/// distance.
#[cube]
#[expect(clippy::too_many_arguments, reason = "one column of two matrices")]
fn holds(
    samples: &mut Tensor<f32>,
    nearest: &mut Tensor<f32>,
    room: usize,
    len: usize,
    beta: f32,
    epsilon: f32,
    opaque: f32,
    ray: usize,
    rays: usize,
) -> bool {
    let mut holds = true;
    let mut error = 0.0f32;
    let mut energy = 0.0f32;
    let mut i = 0usize;
    while i + 1 < len {
        let length = samples[(i + 1) * rays + ray] - samples[i * rays + ray];
        error += section_error(length, nearest[i * rays + ray], beta);
        let bound = opacity_error(error, energy);
        energy += length * laplace_density(samples[(room + i) * rays + ray], beta);
        i += 1;
        if bound > epsilon {
            holds = false;
            i = len;
        } else if energy >= opaque {
            // From here on it holds whatever the error integral is.
            i = len;
        }
    }
    holds
}

/// Merges a ray's `old` samples and `step` fresh ones, positions with their distances.
#[cube]
#[expect(clippy::too_many_arguments, reason = "one column of three matrices")]
fn merge(
    samples: &Tensor<f32>,
    fresh: &Tensor<f32>,
    merged: &mut Tensor<f32>,
    old: usize,
    len: usize,
    step: usize,
    ray: usize,
    rays: usize,
) {
    let room = len + step;
    let mut from_old = 0usize;
    let mut from_new = 0usize;
    for i in 0..old + step {
        let mut takes_old = from_old < old;
        if takes_old && from_new < step {
            takes_old = samples[from_old * rays + ray] <= fresh[from_new * rays + ray];
        }
        if takes_old {
            merged[i * rays + ray] = samples[from_old * rays + ray];
            merged[(room + i) * rays + ray] = samples[(len + from_old) * rays + ray];
            from_old += 1;
        } else {
            merged[i * rays + ray] = fresh[from_new * rays + ray];
            merged[(room + i) * rays + ray] = fresh[(step + from_new) * rays + ray];
            from_new += 1;
        }
    }
}

/// The smallest β between `beta0` and `beta` that bisections find the bound to hold with.
#[cube]
#[expect(clippy::too_many_arguments, reason = "one column of two matrices")]
fn search_beta(
    merged: &mut Tensor<f32>,
    nearest: &mut Tensor<f32>,
    room: usize,
    count: usize,
    beta0: f32,
    beta: f32,
    bisections: usize,
    epsilon: f32,
    opaque: f32,
    ray: usize,
    rays: usize,
) -> f32 {
    let mut found = beta;
    if holds(
        merged, nearest, room, count, beta0, epsilon, opaque, ray, rays,
    ) {
        found = beta0;
    } else {
        let mut low = beta0;
        for _ in 0..bisections {
            let middle = (low + found) / 2.0;
            if holds(
                merged, nearest, room, count, middle, epsilon, opaque, ray, rays,
            ) {
                found = middle;
            } else {
                low = middle;
            }
        }
    }
    found
}

/// The next `step` positions, at even shares of the cumulative bound, which `scratch`
/// holds from row `room` on.
#[cube]
#[expect(clippy::too_many_arguments, reason = "one column of three matrices")]
fn place_evenly(
    merged: &mut Tensor<f32>,
    scratch: &mut Tensor<f32>,
    next_z: &mut Tensor<f32>,
    room: usize,
    count: usize,
    step: usize,
    ray: usize,
    rays: usize,
) {
    let mut above = 0usize;
    for i in 0..step {
        let u = linspace(i, step);
        above = count_up_to(scratch, room, count, above, u, ray, rays);
        let below = if above > 0 { above - 1 } else { 0usize };
        let upper = if above < count { above } else { count - 1 };
        next_z[i * rays + ray] = between(
            merged[below * rays + ray],
            merged[upper * rays + ray],
            scratch[(room + below) * rays + ray],
            scratch[(room + upper) * rays + ray],
            FLAT_STEP,
            u,
        );
    }
}

/// One iteration: new samples are merged in, β is searched, and the next samples
/// are placed where the bound is large.
///
/// Matrices have one column per ray. `samples` `[2 · len, R]` holds positions, then
/// distances; `fresh` `[2 · step, R]` the same of the new samples; `control` β₀,
/// whether samples are still wanted, and the iterations so far. `merged` and
/// `scratch` are `[2 · (len + step), R]`; `state` is β, then whether the bound
/// holds, `[2, R]`.
#[cube(launch)]
#[expect(
    clippy::too_many_arguments,
    reason = "a kernel's arguments are its bindings"
)]
fn refine_kernel(
    samples: &Tensor<f32>,
    fresh: &Tensor<f32>,
    betas: &Tensor<f32>,
    control: &Tensor<f32>,
    merged: &mut Tensor<f32>,
    scratch: &mut Tensor<f32>,
    next_z: &mut Tensor<f32>,
    state: &mut Tensor<f32>,
    len: usize,
    step: usize,
    rays: usize,
    bisections: usize,
    epsilon: f32,
    opaque: f32,
) {
    let ray = ABSOLUTE_POS;
    if ray < rays {
        let room = len + step;
        let beta0 = control[0];
        let old = u32::cast_from(control[2]) as usize * step;
        let mut beta = betas[ray];
        if control[1] < 0.5 {
            // Nothing more is wanted: everything stays.
            for i in 0..old {
                merged[i * rays + ray] = samples[i * rays + ray];
                merged[(room + i) * rays + ray] = samples[(len + i) * rays + ray];
            }
            for i in 0..step {
                next_z[i * rays + ray] = fresh[i * rays + ray];
            }
        } else {
            let count = old + step;
            merge(samples, fresh, merged, old, len, step, ray, rays);
            for i in 0..count - 1 {
                scratch[i * rays + ray] = nearest_distance(
                    merged[(i + 1) * rays + ray] - merged[i * rays + ray],
                    merged[(room + i) * rays + ray],
                    merged[(room + i + 1) * rays + ray],
                );
            }

            // Once reached, β stays.
            if beta != beta0 {
                beta = search_beta(
                    merged, scratch, room, count, beta0, beta, bisections, epsilon, opaque, ray,
                    rays,
                );
            }

            let mut error = 0.0f32;
            let mut energy = 0.0f32;
            for i in 0..count - 1 {
                let length = merged[(i + 1) * rays + ray] - merged[i * rays + ray];
                error += section_error(length, scratch[i * rays + ray], beta);
                scratch[(room + i + 1) * rays + ray] = opacity_error(error, energy);
                energy += length * laplace_density(merged[(room + i) * rays + ray], beta);
            }
            cumulate(scratch, room, count - 1, ray, rays);
            place_evenly(merged, scratch, next_z, room, count, step, ray, rays);
            sort_almost_sorted(next_z, ray, rays, step);
        }
        state[ray] = beta;
        state[rays + ray] = if beta <= beta0 { 1.0f32 } else { 0.0f32 };
    }
}

/// The final samples `out` `[R, S]`: near, those at the ascending `u` `[drawn, R]`
/// of the rendering weights, the columns `kept` `[iterations, extras]` of those that
/// the bound was computed with, far.
#[cube(launch)]
#[expect(
    clippy::too_many_arguments,
    reason = "a kernel's arguments are its bindings"
)]
fn draw_kernel(
    samples: &Tensor<f32>,
    betas: &Tensor<f32>,
    control: &Tensor<f32>,
    u: &Tensor<f32>,
    kept: &Tensor<f32>,
    cdf: &mut Tensor<f32>,
    out: &mut Tensor<f32>,
    len: usize,
    step: usize,
    rays: usize,
    drawn: usize,
    extras: usize,
    near: f32,
    far: f32,
) {
    let ray = ABSOLUTE_POS;
    if ray < rays {
        let iterations = u32::cast_from(control[2]) as usize;
        let count = iterations * step;
        let beta = betas[ray];
        let mut energy = 0.0f32;
        for i in 0..count - 1 {
            let length = samples[(i + 1) * rays + ray] - samples[i * rays + ray];
            let here = length * laplace_density(samples[(len + i) * rays + ray], beta);
            let weight = (1.0 - f32::exp(-here)) * f32::exp(-energy);
            cdf[(i + 1) * rays + ray] = weight + FINAL_MASS_FLOOR;
            energy += here;
        }
        cumulate(cdf, 0, count - 1, ray, rays);

        let first = ray * (drawn + extras + 2);
        out[first] = near;
        let mut above = 0usize;
        for i in 0..drawn {
            let u = u[i * rays + ray];
            above = count_up_to(cdf, 0, count, above, u, ray, rays);
            let below = if above > 0 { above - 1 } else { 0usize };
            let upper = if above < count { above } else { count - 1 };
            out[first + 1 + i] = between(
                samples[below * rays + ray],
                samples[upper * rays + ray],
                cdf[below * rays + ray],
                cdf[upper * rays + ray],
                FLAT_STEP,
                u,
            );
        }
        // Merged in from the end, where there is room.
        let mut left = drawn;
        let mut extra = extras;
        while extra > 0 {
            let column = u32::cast_from(kept[(iterations - 1) * extras + extra - 1]) as usize;
            let z = samples[column * rays + ray];
            let to = first + left + extra;
            let mut takes_drawn = false;
            if left > 0 {
                takes_drawn = out[first + left] > z;
            }
            if takes_drawn {
                out[to] = out[first + left];
                left -= 1;
            } else {
                out[to] = z;
                extra -= 1;
            }
        }
        out[first + drawn + extras + 1] = far;
        sort_almost_sorted(out, first, 1, drawn + extras + 2);
    }
}

pub(crate) fn refine(
    [samples, fresh, betas, control]: [CubeTensor; 4],
    numbers: RefineNumbers,
) -> (CubeTensor, CubeTensor, CubeTensor) {
    let [samples, fresh, betas, control] = [samples, fresh, betas, control].map(into_contiguous);
    let empty = |rows| empty_of(&fresh, [rows, numbers.rays]);
    let room = 2 * (numbers.len + numbers.step);
    let [merged, scratch, next_z, state] = [room, room, numbers.step, 2].map(empty);
    let (count, dim) = launch_size(numbers.rays);
    refine_kernel::launch(
        &merged.client,
        count,
        dim,
        samples.into_tensor_arg(),
        fresh.clone().into_tensor_arg(),
        betas.into_tensor_arg(),
        control.into_tensor_arg(),
        merged.clone().into_tensor_arg(),
        scratch.into_tensor_arg(),
        next_z.clone().into_tensor_arg(),
        state.clone().into_tensor_arg(),
        numbers.len,
        numbers.step,
        numbers.rays,
        numbers.bisections,
        numbers.epsilon,
        numbers.opaque,
    );
    (merged, next_z, state)
}

pub(crate) fn draw(
    [samples, betas, control, u, kept]: [CubeTensor; 5],
    numbers: DrawNumbers,
) -> CubeTensor {
    let [samples, betas, control, u, kept] =
        [samples, betas, control, u, kept].map(into_contiguous);
    let cdf = empty_of(&samples, [numbers.len, numbers.rays]);
    let out = empty_of(&samples, [numbers.rays, numbers.drawn + numbers.extras + 2]);
    let (count, dim) = launch_size(numbers.rays);
    draw_kernel::launch(
        &out.client,
        count,
        dim,
        samples.into_tensor_arg(),
        betas.into_tensor_arg(),
        control.into_tensor_arg(),
        u.into_tensor_arg(),
        kept.into_tensor_arg(),
        cdf.into_tensor_arg(),
        out.clone().into_tensor_arg(),
        numbers.len,
        numbers.step,
        numbers.rays,
        numbers.drawn,
        numbers.extras,
        numbers.near,
        numbers.far,
    );
    out
}
