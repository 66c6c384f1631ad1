//! The positional encoding and its Jacobian, one kernel each.
//!
//! Of a row `x` with `W` numbers the encoding has the columns `x`, `sin x`,
//! `cos x`, `sin 2x`, `cos 2x`, …, `W` numbers each. Tensors are float32 matrices of the
//! same number of rows.

use super::{elementwise, empty_of, launch_elementwise};
use burn::backend::TensorMetadata;
use burn_cubecl::cubecl::{self, prelude::*};
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

/// `sin(x + half_turns · π)`, by the series of [`crate::sine`]: what drivers offer
/// may be off by 10⁻⁴.
#[cube]
fn sine(x: f32, half_turns: f32) -> f32 {
    let k = f32::round(x * 0.318_309_87 + half_turns);
    let turns = k - half_turns;
    let r = x - turns * 3.140_625;
    let r = r - turns * 9.675_026e-4;
    let r = r - turns * 1.509_958e-7;
    let odd = k - f32::floor(k * 0.5) * 2.0;
    let square = r * r;
    let series = square * 1.605_904_4e-10 - 2.505_210_8e-8;
    let series = series * square + 2.755_731_9e-6;
    let series = series * square - 1.984_127e-4;
    let series = series * square + 8.333_333e-3;
    let series = series * square - 1.666_666_7e-1;
    (1.0 - 2.0 * odd) * r * (series * square + 1.0)
}

/// `2^octave`.
#[cube]
fn frequency(octave: usize) -> f32 {
    let mut frequency = 1.0f32;
    for _ in 0..octave {
        frequency *= 2.0;
    }
    frequency
}

#[cube(launch)]
fn encode_kernel(x: &Tensor<f32>, out: &mut Tensor<f32>, width: usize, columns: usize) {
    if ABSOLUTE_POS < out.len() {
        let row = ABSOLUTE_POS / columns;
        let column = ABSOLUTE_POS % columns;
        let x = x[row * width + column % width];
        let block = column / width;
        let mut value = x;
        if block > 0 {
            let wave = (block - 1) % 2;
            let angle = x * frequency((block - 1) / 2);
            value = sine(angle, if wave == 0 { 0.0f32 } else { 0.5f32 });
        }
        out[ABSOLUTE_POS] = value;
    }
}

#[cube(launch)]
fn pull_back_kernel(
    x: &Tensor<f32>,
    gradient: &Tensor<f32>,
    out: &mut Tensor<f32>,
    width: usize,
    octaves: usize,
) {
    if ABSOLUTE_POS < out.len() {
        let row = ABSOLUTE_POS / width;
        let first = row * width * (1 + 2 * octaves) + ABSOLUTE_POS % width;
        let x = x[ABSOLUTE_POS];
        let mut sum = gradient[first];
        let mut frequency = 1.0f32;
        for octave in 0..octaves {
            let of_sin = gradient[first + width * (1 + 2 * octave)];
            let of_cos = gradient[first + width * (2 + 2 * octave)];
            let angle = x * frequency;
            sum += (of_sin * sine(angle, 0.5) - of_cos * sine(angle, 0.0)) * frequency;
            frequency *= 2.0;
        }
        out[ABSOLUTE_POS] = sum;
    }
}

#[cube(launch)]
fn push_forward_kernel(
    x: &Tensor<f32>,
    a: &Tensor<f32>,
    out: &mut Tensor<f32>,
    width: usize,
    columns: usize,
) {
    if ABSOLUTE_POS < out.len() {
        let row = ABSOLUTE_POS / columns;
        let column = ABSOLUTE_POS % columns;
        let source = row * width + column % width;
        let block = column / width;
        let mut value = a[source];
        if block > 0 {
            let wave = (block - 1) % 2;
            let frequency = frequency((block - 1) / 2);
            let angle = x[source] * frequency;
            // cos, or −sin: a quarter turn ahead of the wave.
            let slope = if wave == 0 {
                sine(angle, 0.5)
            } else {
                -sine(angle, 0.0)
            };
            value *= slope * frequency;
        }
        out[ABSOLUTE_POS] = value;
    }
}

#[cube(launch)]
fn pull_back_slope_kernel(
    x: &Tensor<f32>,
    a: &Tensor<f32>,
    gradient: &Tensor<f32>,
    out: &mut Tensor<f32>,
    width: usize,
    octaves: usize,
) {
    if ABSOLUTE_POS < out.len() {
        let row = ABSOLUTE_POS / width;
        let first = row * width * (1 + 2 * octaves) + ABSOLUTE_POS % width;
        let x = x[ABSOLUTE_POS];
        let mut sum = 0.0f32;
        let mut frequency = 1.0f32;
        for octave in 0..octaves {
            let of_sin = gradient[first + width * (1 + 2 * octave)];
            let of_cos = gradient[first + width * (2 + 2 * octave)];
            let angle = x * frequency;
            let wave = of_sin * sine(angle, 0.0) + of_cos * sine(angle, 0.5);
            sum -= wave * frequency * frequency;
            frequency *= 2.0;
        }
        out[ABSOLUTE_POS] = a[ABSOLUTE_POS] * sum;
    }
}

/// The encoding `[N, W (1 + 2 octaves)]` of `x` `[N, W]`.
pub(super) fn encode(inputs: [CubeTensor; 1], octaves: usize) -> CubeTensor {
    let [x] = inputs.map(into_contiguous);
    let [rows, width] = x.shape().dims();
    let columns = width * (1 + 2 * octaves);
    let out = empty_of(&x, [rows, columns]);
    launch_elementwise!(encode_kernel, out, [x], width, columns)
}

/// `gradient`, with respect to the encoding of `x`, times its Jacobian.
pub(super) fn pull_back(inputs: [CubeTensor; 2], octaves: usize) -> CubeTensor {
    let [x, gradient] = inputs.map(into_contiguous);
    let [rows, width] = x.shape().dims();
    let out = empty_of(&x, [rows, width]);
    launch_elementwise!(pull_back_kernel, out, [x, gradient], width, octaves)
}

/// The Jacobian of the encoding at `x` times `a` `[N, W]`.
pub(super) fn push_forward(inputs: [CubeTensor; 2], octaves: usize) -> CubeTensor {
    let [x, a] = inputs.map(into_contiguous);
    let [rows, width] = x.shape().dims();
    let columns = width * (1 + 2 * octaves);
    let out = empty_of(&x, [rows, columns]);
    launch_elementwise!(push_forward_kernel, out, [x, a], width, columns)
}

/// `a` times the derivative of the pulled back `gradient` with respect to `x`.
pub(super) fn pull_back_slope(inputs: [CubeTensor; 3], octaves: usize) -> CubeTensor {
    let [x, a, gradient] = inputs.map(into_contiguous);
    let [rows, width] = x.shape().dims();
    let out = empty_of(&x, [rows, width]);
    launch_elementwise!(
        pull_back_slope_kernel,
        out,
        [x, a, gradient],
        width,
        octaves
    )
}
