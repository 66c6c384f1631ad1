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

/// Where a point lies along one axis.
#[derive(CubeType, Clone, Copy)]
struct Axis {
    cell: u32,
    /// Weight of the far side of the cell, and its first and second derivative.
    far: f32,
    slope: f32,
    bend: f32,
}

/// Where a point lies in a level.
#[derive(CubeType, Clone, Copy)]
struct Place {
    x: Axis,
    y: Axis,
    z: Axis,
}

/// Of one corner of a cell along one axis: its weight, and the derivatives of that.
#[derive(CubeType, Clone, Copy)]
struct Side {
    weight: f32,
    slope: f32,
    bend: f32,
}

/// A corner of a cell.
#[derive(CubeType, Clone, Copy)]
struct Corner {
    x: Side,
    y: Side,
    z: Side,
    /// Its entry in the table.
    entry: usize,
}

#[cube]
fn along(x: f32, half_side: f32, cells: u32) -> Axis {
    let scale = f32::cast_from(cells) / (2.0 * half_side);
    let position = (x + half_side) * scale;
    let corner = f32::floor(f32::clamp(position, 0.0, f32::cast_from(cells - 1)));
    let unbounded = position - corner;
    let t = f32::clamp(unbounded, 0.0, 1.0);
    // Outside the weight is constant.
    let inside = if unbounded == t { 1.0f32 } else { 0.0f32 };
    Axis {
        cell: u32::cast_from(corner),
        far: t * t * (3.0 - 2.0 * t),
        slope: 6.0 * t * (1.0 - t) * scale,
        bend: inside * (6.0 - 12.0 * t) * (scale * scale),
    }
}

/// Where point `row` lies in level `l`.
#[cube]
fn place(
    points: &Tensor<f32>,
    row: usize,
    levels: &Tensor<u32>,
    l: usize,
    half_side: f32,
) -> Place {
    let cells = levels[l * LEVEL];
    Place {
        x: along(points[3 * row], half_side, cells),
        y: along(points[3 * row + 1], half_side, cells),
        z: along(points[3 * row + 2], half_side, cells),
    }
}

#[cube]
fn side(axis: &Axis, far: u32) -> Side {
    let mut side = Side {
        weight: axis.far,
        slope: axis.slope,
        bend: axis.bend,
    };
    if far == 0 {
        side.weight = 1.0 - axis.far;
        side.slope = -axis.slope;
        side.bend = -axis.bend;
    }
    side
}

/// Corner `c`, whose bit `k` is its side on axis `k`.
#[cube]
fn corner(place: &Place, levels: &Tensor<u32>, l: usize, c: u32) -> Corner {
    let (i, j, k) = (c & 1, (c >> 1) & 1, c >> 2);
    let (x, y, z) = (place.x.cell + i, place.y.cell + j, place.z.cell + k);
    let side_length = levels[l * LEVEL] + 1;
    let mask = levels[l * LEVEL + 2];
    let mut within = (z * side_length + y) * side_length + x;
    if mask > 0 {
        within = (x ^ (y * OF_Y) ^ (z * OF_Z)) & mask;
    }
    Corner {
        x: side(&place.x, i),
        y: side(&place.y, j),
        z: side(&place.z, k),
        entry: (levels[l * LEVEL + 1] + within) as usize,
    }
}

/// Weight of a corner, or, `sloping`, its derivative along tangent `row`.
#[cube]
fn weight(corner: &Corner, tangents: &Tensor<f32>, row: usize, #[comptime] sloping: bool) -> f32 {
    let (x, y, z) = (corner.x.weight, corner.y.weight, corner.z.weight);
    if comptime![sloping] {
        tangents[3 * row] * corner.x.slope * y * z
            + tangents[3 * row + 1] * x * corner.y.slope * z
            + tangents[3 * row + 2] * x * y * corner.z.slope
    } else {
        x * y * z
    }
}

/// What `gradient` `[N, width]` says of an entry of the table at point `row`.
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
        let (row, column) = (ABSOLUTE_POS / width, ABSOLUTE_POS % width);
        let l = column / features;
        let place = place(points, row, levels, l, half_side);
        let mut sum = 0.0f32;
        for c in 0..8u32 {
            let corner = corner(&place, levels, l, c);
            let entry = table[corner.entry * features + column % features];
            sum += weight(&corner, tangents, row, sloping) * entry;
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
    let row = ABSOLUTE_POS;
    if 3 * row < out.len() {
        let (mut to_x, mut to_y, mut to_z) = (0.0f32, 0.0f32, 0.0f32);
        for l in 0..width / features {
            let place = place(points, row, levels, l, half_side);
            for c in 0..8u32 {
                let corner = corner(&place, levels, l, c);
                let first = row * width + l * features;
                let spoken = spoken(table, corner.entry, gradient, first, features);
                let (x, y, z) = (corner.x, corner.y, corner.z);
                to_x += spoken * x.slope * y.weight * z.weight;
                to_y += spoken * x.weight * y.slope * z.weight;
                to_z += spoken * x.weight * y.weight * z.slope;
            }
        }
        out[3 * row] = to_x;
        out[3 * row + 1] = to_y;
        out[3 * row + 2] = to_z;
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
    let row = ABSOLUTE_POS;
    if 3 * row < out.len() {
        let (u, v, w) = (
            tangents[3 * row],
            tangents[3 * row + 1],
            tangents[3 * row + 2],
        );
        let (mut to_x, mut to_y, mut to_z) = (0.0f32, 0.0f32, 0.0f32);
        for l in 0..width / features {
            let place = place(points, row, levels, l, half_side);
            for c in 0..8u32 {
                let corner = corner(&place, levels, l, c);
                let first = row * width + l * features;
                let spoken = spoken(table, corner.entry, gradient, first, features);
                let (x, y, z) = (corner.x, corner.y, corner.z);
                let (xy, xz, yz) = (x.slope * y.slope, x.slope * z.slope, y.slope * z.slope);
                let of_x = u * x.bend * y.weight + v * xy;
                let of_y = v * y.bend * x.weight + u * xy;
                let of_z = u * xz * y.weight + v * yz * x.weight;
                to_x += spoken * (of_x * z.weight + w * xz * y.weight);
                to_y += spoken * (of_y * z.weight + w * yz * x.weight);
                to_z += spoken * (of_z + w * z.bend * x.weight * y.weight);
            }
        }
        out[3 * row] = to_x;
        out[3 * row + 1] = to_y;
        out[3 * row + 2] = to_z;
    }
}

/// Units of a sum's upper 32 bits per 1; its lower bits are 2³² times as fine. So it holds
/// numbers to 8 million in steps of 10⁻¹², far below what moves Adam.
const UNITS: f32 = 256.0;
/// 2³².
const LOWER: f32 = 4_294_967_296.0;

/// Adds `value` to number `at` of `sums`, upper and lower bits of each.
#[cube]
fn add(sums: &mut Tensor<Atomic<u32>>, at: usize, value: f32) {
    let most = 2_147_483_000.0f32;
    let scaled = f32::clamp(value * UNITS, -most, most);
    let upper = f32::floor(scaled);
    let lower = u32::cast_from((scaled - upper) * LOWER);
    let before = sums[2 * at + 1].fetch_add(lower);
    // Whoever makes the lower bits run over carries: how often that happens does not depend
    // on the order.
    let carry = if before > 0xFFFF_FFFFu32 - lower {
        1u32
    } else {
        0u32
    };
    sums[2 * at].fetch_add(u32::cast_from(i32::cast_from(upper)) + carry);
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
        let (row, column) = (ABSOLUTE_POS / width, ABSOLUTE_POS % width);
        let l = column / features;
        let place = place(points, row, levels, l, half_side);
        for c in 0..8u32 {
            let corner = corner(&place, levels, l, c);
            let value = weight(&corner, tangents, row, sloping) * gradient[ABSOLUTE_POS];
            add(sums, corner.entry * features + column % features, value);
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
