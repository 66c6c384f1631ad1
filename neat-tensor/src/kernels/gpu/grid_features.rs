//! Features of learned grids, their pull-back, and how both change, one kernel each. The CPU's
//! version, which says what is interpolated how, is [`crate::kernels::cpu::grid`].
//!
//! What reaches an entry of the table from all points is added as integers: then their order
//! does not matter, and runs repeat.

use super::{elementwise, empty_of, launch_elementwise, units};
use crate::kernels::cpu::grid::{GridShape, HASH};
use burn::backend::TensorMetadata;
use burn::backend::ops::IntTensorOps;
use burn::tensor::{DType, TensorData};
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl::{self, prelude::*};
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::ops::numeric::zeros_client;
use burn_cubecl::tensor::CubeTensor;

const OF_Y: u32 = HASH[0];
const OF_Z: u32 = HASH[1];

/// Numbers that kernels get of a level: cells along a side, first entry, mask of the hash or 0.
const LEVEL: usize = 3;

/// Along one axis: the cell of `x`, and the weight of its far side with its first and second
/// derivative.
#[cube]
fn along(x: f32, half_side: f32, cells: u32) -> (u32, f32, f32, f32) {
    let scale = f32::cast_from(cells) / (2.0 * half_side);
    let position = (x + half_side) * scale;
    let corner = f32::floor(f32::clamp(position, 0.0, f32::cast_from(cells - 1)));
    let unbounded = position - corner;
    let t = f32::clamp(unbounded, 0.0, 1.0);
    // Outside the weight is constant.
    let inside = if unbounded == t { 1.0f32 } else { 0.0f32 };
    let bend = inside * (6.0 - 12.0 * t) * (scale * scale);
    let slope = 6.0 * t * (1.0 - t) * scale;
    (u32::cast_from(corner), t * t * (3.0 - 2.0 * t), slope, bend)
}

/// On which side of each axis corner `c` of a cell lies.
#[cube]
fn sides(c: u32) -> (u32, u32, u32) {
    (c & 1, (c >> 1) & 1, c >> 2)
}

/// The entry of the corner `x`, `y`, `z` of level `l`.
#[cube]
fn entry(levels: &Tensor<u32>, l: usize, x: u32, y: u32, z: u32) -> usize {
    let side = levels[l * LEVEL] + 1;
    let mask = levels[l * LEVEL + 2];
    let within = if mask == 0 {
        (z * side + y) * side + x
    } else {
        (x ^ (y * OF_Y) ^ (z * OF_Z)) & mask
    };
    (levels[l * LEVEL + 1] + within) as usize
}

/// The weight of a side: that of the far one, or what it leaves.
#[cube]
fn weight(far: f32, side: u32) -> f32 {
    if side == 1 { far } else { 1.0 - far }
}

/// A derivative of that weight.
#[cube]
fn signed(slope: f32, side: u32) -> f32 {
    if side == 1 { slope } else { -slope }
}

/// What `gradient` says of an entry of the table, from `first` on.
#[cube]
fn spoken(
    table: &Tensor<f32>,
    entry: usize,
    gradient: &Tensor<f32>,
    first: usize,
    features: usize,
) -> f32 {
    let mut sum = 0.0f32;
    for f in 0..features {
        sum += table[entry * features + f] * gradient[first + f];
    }
    sum
}

/// What `points` `[N, 3]` see of the table: features, or, `sloping`, how they change along
/// `tangents` `[N, 3]`. One unit per feature of a point.
#[cube(launch)]
fn features_kernel(
    points: &Tensor<f32>,
    tangents: &Tensor<f32>,
    table: &Tensor<f32>,
    levels: &Tensor<u32>,
    out: &mut Tensor<f32>,
    width: usize,
    features: usize,
    half_side: f32,
    #[comptime] sloping: bool,
) {
    if ABSOLUTE_POS < out.len() {
        let row = 3 * (ABSOLUTE_POS / width);
        let column = ABSOLUTE_POS % width;
        let l = column / features;
        let cells = levels[l * LEVEL];
        let (x, far_x, slope_x, _bend_x) = along(points[row], half_side, cells);
        let (y, far_y, slope_y, _bend_y) = along(points[row + 1], half_side, cells);
        let (z, far_z, slope_z, _bend_z) = along(points[row + 2], half_side, cells);
        let mut sum = 0.0f32;
        for c in 0..8u32 {
            let (i, j, k) = sides(c);
            let at = entry(levels, l, x + i, y + j, z + k);
            let (a, b, c) = (weight(far_x, i), weight(far_y, j), weight(far_z, k));
            let factor = if comptime![sloping] {
                tangents[row] * signed(slope_x, i) * b * c
                    + tangents[row + 1] * signed(slope_y, j) * a * c
                    + tangents[row + 2] * signed(slope_z, k) * a * b
            } else {
                a * b * c
            };
            sum += factor * table[at * features + column % features];
        }
        out[ABSOLUTE_POS] = sum;
    }
}

/// `gradient` `[N, width]` pulled back to `points` `[N, 3]`, one unit per point.
#[cube(launch)]
fn pull_back_kernel(
    points: &Tensor<f32>,
    table: &Tensor<f32>,
    gradient: &Tensor<f32>,
    levels: &Tensor<u32>,
    out: &mut Tensor<f32>,
    width: usize,
    features: usize,
    half_side: f32,
) {
    let row = 3 * ABSOLUTE_POS;
    if row < out.len() {
        let mut to_x = 0.0f32;
        let mut to_y = 0.0f32;
        let mut to_z = 0.0f32;
        for l in 0..width / features {
            let cells = levels[l * LEVEL];
            let (x, far_x, slope_x, _bend_x) = along(points[row], half_side, cells);
            let (y, far_y, slope_y, _bend_y) = along(points[row + 1], half_side, cells);
            let (z, far_z, slope_z, _bend_z) = along(points[row + 2], half_side, cells);
            let first = ABSOLUTE_POS * width + l * features;
            for c in 0..8u32 {
                let (i, j, k) = sides(c);
                let at = entry(levels, l, x + i, y + j, z + k);
                let spoken = spoken(table, at, gradient, first, features);
                let (a, b, c) = (weight(far_x, i), weight(far_y, j), weight(far_z, k));
                to_x += spoken * signed(slope_x, i) * b * c;
                to_y += spoken * signed(slope_y, j) * a * c;
                to_z += spoken * signed(slope_z, k) * a * b;
            }
        }
        out[row] = to_x;
        out[row + 1] = to_y;
        out[row + 2] = to_z;
    }
}

/// How the pulled back `gradient`, times `tangents`, changes with the points: `[N, 3]`, one unit
/// per point.
#[cube(launch)]
fn curvature_kernel(
    points: &Tensor<f32>,
    tangents: &Tensor<f32>,
    table: &Tensor<f32>,
    gradient: &Tensor<f32>,
    levels: &Tensor<u32>,
    out: &mut Tensor<f32>,
    width: usize,
    features: usize,
    half_side: f32,
) {
    let row = 3 * ABSOLUTE_POS;
    if row < out.len() {
        let (u, v, w) = (tangents[row], tangents[row + 1], tangents[row + 2]);
        let mut to_x = 0.0f32;
        let mut to_y = 0.0f32;
        let mut to_z = 0.0f32;
        for l in 0..width / features {
            let cells = levels[l * LEVEL];
            let (x, far_x, slope_x, bend_x) = along(points[row], half_side, cells);
            let (y, far_y, slope_y, bend_y) = along(points[row + 1], half_side, cells);
            let (z, far_z, slope_z, bend_z) = along(points[row + 2], half_side, cells);
            let first = ABSOLUTE_POS * width + l * features;
            for c in 0..8u32 {
                let (i, j, k) = sides(c);
                let at = entry(levels, l, x + i, y + j, z + k);
                let spoken = spoken(table, at, gradient, first, features);
                let (a, b, c) = (weight(far_x, i), weight(far_y, j), weight(far_z, k));
                let (p, q, r) = (signed(slope_x, i), signed(slope_y, j), signed(slope_z, k));
                to_x += spoken * (u * signed(bend_x, i) * b * c + p * (v * q * c + w * r * b));
                to_y += spoken * (v * signed(bend_y, j) * a * c + q * (u * p * c + w * r * a));
                to_z += spoken * (w * signed(bend_z, k) * a * b + r * (u * p * b + v * q * a));
            }
        }
        out[row] = to_x;
        out[row + 1] = to_y;
        out[row + 2] = to_z;
    }
}

/// Units of a sum's upper 32 bits per 1; its lower bits are 2³² times as fine. So it holds
/// numbers to 32 768 in steps of 4·10⁻¹⁵: derivatives of losses are below the one, and Adam's ε
/// of 10⁻⁸ makes what is near the other nothing.
const UNITS: f32 = 65_536.0;
/// 2³².
const LOWER: f32 = 4_294_967_296.0;

/// Adds `value` to number `at` of `sums`, upper and lower bits of each.
#[cube]
fn add(sums: &mut Tensor<Atomic<u32>>, at: usize, value: f32) {
    // Of the magnitude, as a small negative number is not far below 0 but far above -1.
    let scaled = f32::min(f32::abs(value) * UNITS, 2_147_483_000.0);
    let whole = f32::floor(scaled);
    let mut upper = u32::cast_from(whole);
    let mut lower = u32::cast_from((scaled - whole) * LOWER);
    if value < 0.0 {
        upper = 0xFFFF_FFFFu32 - upper;
        if lower == 0 {
            upper += 1;
        } else {
            lower = 0xFFFF_FFFFu32 - lower + 1;
        }
    }
    let before = sums[2 * at + 1].fetch_add(lower);
    // Whoever makes the lower bits run over carries: how often that happens does not depend
    // on the order.
    let carry = if before > 0xFFFF_FFFFu32 - lower {
        1u32
    } else {
        0u32
    };
    sums[2 * at].fetch_add(upper + carry);
}

/// Adds to each entry of the table what `gradient` `[N, width]` says of it, by the weights of
/// the points or, `sloping`, by how these change along `tangents`. One unit per number.
#[cube(launch)]
fn scatter_kernel(
    points: &Tensor<f32>,
    tangents: &Tensor<f32>,
    gradient: &Tensor<f32>,
    levels: &Tensor<u32>,
    sums: &mut Tensor<Atomic<u32>>,
    width: usize,
    features: usize,
    half_side: f32,
    #[comptime] sloping: bool,
) {
    if ABSOLUTE_POS < gradient.len() {
        let row = 3 * (ABSOLUTE_POS / width);
        let column = ABSOLUTE_POS % width;
        let l = column / features;
        let cells = levels[l * LEVEL];
        let (x, far_x, slope_x, _bend_x) = along(points[row], half_side, cells);
        let (y, far_y, slope_y, _bend_y) = along(points[row + 1], half_side, cells);
        let (z, far_z, slope_z, _bend_z) = along(points[row + 2], half_side, cells);
        for c in 0..8u32 {
            let (i, j, k) = sides(c);
            let at = entry(levels, l, x + i, y + j, z + k);
            let (a, b, c) = (weight(far_x, i), weight(far_y, j), weight(far_z, k));
            let factor = if comptime![sloping] {
                tangents[row] * signed(slope_x, i) * b * c
                    + tangents[row + 1] * signed(slope_y, j) * a * c
                    + tangents[row + 2] * signed(slope_z, k) * a * b
            } else {
                a * b * c
            };
            add(
                sums,
                at * features + column % features,
                factor * gradient[ABSOLUTE_POS],
            );
        }
    }
}

/// The sums as numbers.
#[cube(launch)]
fn sums_kernel(sums: &Tensor<u32>, out: &mut Tensor<f32>) {
    if ABSOLUTE_POS < out.len() {
        let mut upper = sums[2 * ABSOLUTE_POS];
        let mut lower = sums[2 * ABSOLUTE_POS + 1];
        // Of a negative sum the magnitude, as small numbers have many leading ones.
        let mut sign = 1.0f32;
        if upper >= 0x8000_0000u32 {
            sign = -1.0f32;
            upper = 0xFFFF_FFFFu32 - upper;
            lower = 0xFFFF_FFFFu32 - lower;
            if lower == 0xFFFF_FFFFu32 {
                upper += 1;
            }
            lower += 1;
        }
        let value = f32::cast_from(upper) + f32::cast_from(lower) / LOWER;
        out[ABSOLUTE_POS] = sign * value / UNITS;
    }
}

/// The levels as kernels read them.
fn levels_of(shape: &GridShape, like: &CubeTensor) -> CubeTensor {
    let numbers = shape.levels.iter().flat_map(|level| {
        let first =
            u32::try_from(level.first).expect("GridConfig::validate allows 32 · 2²⁰ entries");
        [level.cells, first, level.mask.unwrap_or(0)]
    });
    let numbers: Vec<u32> = numbers.collect();
    let count = numbers.len();
    CubeBackend::int_from_data(TensorData::new(numbers, [count]), &like.device)
}

/// Features `[N, width]` of `table` `[entries, features]` at `points` `[N, 3]`.
pub(super) fn encode([points, table]: [CubeTensor; 2], shape: &GridShape) -> CubeTensor {
    features([points.clone(), points, table], shape, false)
}

/// How they change along `tangents` `[N, 3]`: the Jacobian times these.
pub(super) fn push_forward(inputs: [CubeTensor; 3], shape: &GridShape) -> CubeTensor {
    features(inputs, shape, true)
}

fn features(inputs: [CubeTensor; 3], shape: &GridShape, sloping: bool) -> CubeTensor {
    let [points, tangents, table] = inputs.map(into_contiguous);
    let levels = levels_of(shape, &points);
    let out = empty_of(&points, [points.shape()[0], shape.width()]);
    launch_elementwise!(
        features_kernel,
        out,
        [points, tangents, table, levels],
        shape.width(),
        shape.features,
        shape.half_side,
        sloping
    )
}

/// The transposed Jacobian at `points` times `gradient` `[N, width]`.
pub(super) fn pull_back(inputs: [CubeTensor; 3], shape: &GridShape) -> CubeTensor {
    let [points, table, gradient] = inputs.map(into_contiguous);
    let levels = levels_of(shape, &points);
    let out = empty_of(&points, points.shape());
    let (count, dim) = units(&out, out.shape()[0]);
    pull_back_kernel::launch(
        &out.client,
        count,
        dim,
        points.into_tensor_arg(),
        table.into_tensor_arg(),
        gradient.into_tensor_arg(),
        levels.into_tensor_arg(),
        out.clone().into_tensor_arg(),
        shape.width(),
        shape.features,
        shape.half_side,
    );
    out
}

/// The derivative of [`pull_back`], times `tangents`, with respect to the points.
pub(super) fn curvature(inputs: [CubeTensor; 4], shape: &GridShape) -> CubeTensor {
    let [points, tangents, table, gradient] = inputs.map(into_contiguous);
    let levels = levels_of(shape, &points);
    let out = empty_of(&points, points.shape());
    let (count, dim) = units(&out, out.shape()[0]);
    curvature_kernel::launch(
        &out.client,
        count,
        dim,
        points.into_tensor_arg(),
        tangents.into_tensor_arg(),
        table.into_tensor_arg(),
        gradient.into_tensor_arg(),
        levels.into_tensor_arg(),
        out.clone().into_tensor_arg(),
        shape.width(),
        shape.features,
        shape.half_side,
    );
    out
}

/// The adjoint of the table of features `gradient` `[N, width]` at `points`.
pub(super) fn scatter([points, gradient]: [CubeTensor; 2], shape: &GridShape) -> CubeTensor {
    scattered([points.clone(), points, gradient], shape, false)
}

/// That of the table in [`pull_back`], times `tangents`.
pub(super) fn scatter_slope(inputs: [CubeTensor; 3], shape: &GridShape) -> CubeTensor {
    scattered(inputs, shape, true)
}

fn scattered(inputs: [CubeTensor; 3], shape: &GridShape, sloping: bool) -> CubeTensor {
    let [points, tangents, gradient] = inputs.map(into_contiguous);
    let levels = levels_of(shape, &points);
    let table = [shape.entries(), shape.features];
    let (client, device) = (points.client.clone(), points.device.clone());
    let size = [2 * table[0] * table[1]];
    let sums = zeros_client(client.clone(), device, size.into(), DType::U32);
    let (count, dim) = elementwise(&gradient);
    scatter_kernel::launch(
        &client,
        count,
        dim,
        points.clone().into_tensor_arg(),
        tangents.into_tensor_arg(),
        gradient.into_tensor_arg(),
        levels.into_tensor_arg(),
        sums.clone().into_tensor_arg(),
        shape.width(),
        shape.features,
        shape.half_side,
        sloping,
    );
    let out = empty_of(&points, table);
    let (count, dim) = elementwise(&out);
    sums_kernel::launch(
        &client,
        count,
        dim,
        sums.into_tensor_arg(),
        out.clone().into_tensor_arg(),
    );
    out
}
