//! What the samplers' kernels share.
//!
//! One unit serves one ray. What it works on is a column of a matrix with one
//! column per ray, so that neighbouring units touch neighbouring numbers; the
//! functions take the matrix, the row where the column's part begins, and the ray.

use burn_cubecl::cubecl::{self, prelude::*};

/// Density of scale `beta` at distance `sdf`.
#[cube]
pub(super) fn laplace_density(sdf: f32, beta: f32) -> f32 {
    let tail = 0.5 * f32::exp(-f32::abs(sdf) / beta);
    let psi = if sdf > 0.0 { tail } else { 1.0 - tail };
    psi / beta
}

/// The `i`-th of `n` evenly spaced numbers from 0 to 1.
#[cube]
pub(super) fn linspace(i: usize, n: usize) -> f32 {
    let step = 1.0 / f32::cast_from(n - 1);
    let from_start = f32::cast_from(i) * step;
    let from_end = 1.0 - f32::cast_from(n - 1 - i) * step;
    if i < n / 2 { from_start } else { from_end }
}

/// Turns the `masses` masses after row `first` into the cumulative distribution
/// from row `first` on; without any mass, all are alike.
#[cube]
pub(super) fn cumulate(
    cdf: &mut Tensor<f32>,
    first: usize,
    masses: usize,
    ray: usize,
    rays: usize,
) {
    let mut total = 0.0f32;
    for i in 1..masses + 1 {
        total += cdf[(first + i) * rays + ray];
    }
    let even = 1.0 / f32::cast_from(masses);
    let mut sum = 0.0f32;
    cdf[first * rays + ray] = 0.0;
    for i in 1..masses + 1 {
        let mass = cdf[(first + i) * rays + ray];
        let share = if total > 0.0 { mass / total } else { even };
        sum += share;
        cdf[(first + i) * rays + ray] = sum;
    }
}

/// How many of the `len` cumulative numbers from row `first` on are at most `u`,
/// given that at least `above` are.
#[cube]
pub(super) fn count_up_to(
    cdf: &mut Tensor<f32>,
    first: usize,
    len: usize,
    above: usize,
    u: f32,
    ray: usize,
    rays: usize,
) -> usize {
    let mut count = above;
    let mut counting = count < len;
    while counting {
        if cdf[(first + count) * rays + ray] <= u {
            count += 1;
            counting = count < len;
        } else {
            counting = false;
        }
    }
    count
}

/// The position between two edges at which the cumulative distribution reaches
/// `u`; steps below `flat` count as 1.
#[cube]
pub(super) fn between(
    lower_edge: f32,
    upper_edge: f32,
    lower_cdf: f32,
    upper_cdf: f32,
    flat: f32,
    u: f32,
) -> f32 {
    let step = upper_cdf - lower_cdf;
    let step = if step < flat { 1.0f32 } else { step };
    lower_edge + (u - lower_cdf) / step * (upper_edge - lower_edge)
}

/// Insertion sort of `count` numbers, the first at `first`, `stride` apart: for
/// numbers that are almost sorted.
#[cube]
pub(super) fn sort_almost_sorted(z: &mut Tensor<f32>, first: usize, stride: usize, count: usize) {
    for end in 1..count {
        let value = z[first + end * stride];
        let mut i = end;
        let mut moving = true;
        while moving {
            let before = z[first + (i - 1) * stride];
            if before > value {
                z[first + i * stride] = before;
                i -= 1;
                moving = i > 0;
            } else {
                moving = false;
            }
        }
        z[first + i * stride] = value;
    }
}
