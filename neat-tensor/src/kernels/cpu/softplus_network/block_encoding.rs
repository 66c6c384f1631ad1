//! The encoding of a block's points: coordinates and sines, then the features of the grid,
//! where there is one; and the ways through its Jacobian.

use super::{POINT, SoftplusNetwork};
use crate::kernels::cpu::arena::Arena;
use crate::kernels::cpu::grid::GridAdjoint;
use crate::kernels::cpu::{BLOCK_ROWS, block, padded};
use std::ops::Range;

/// The encoded points of a block.
pub(super) struct BlockEncoding<'a> {
    /// `[rows, padded(encoded)]`.
    pub values: &'a mut [f32],
    /// Derivatives of the grid's features, `[rows, 3, width]`; empty where not wanted.
    jacobian: &'a mut [f32],
}

/// What reaches the encoding of a block.
pub(super) struct EncodingAdjoint<'a> {
    /// Its adjoint.
    pub encoding: &'a [f32],
    /// `g_E`.
    pub sweep: &'a [f32],
    /// The adjoint of the gradient `[rows, 3]`, where it has one.
    pub gradient: Option<&'a [f32]>,
}

impl SoftplusNetwork<'_> {
    /// The encoding of a block's points, with its derivatives where wanted; rows beyond
    /// them repeat the origin.
    pub(super) fn encode<'a>(
        &self,
        points: &[f32],
        derivatives: bool,
        arena: &mut Arena<'a>,
    ) -> BlockEncoding<'a> {
        let shape = &self.shape;
        let mut block = [0.0; BLOCK_ROWS * POINT];
        block[..points.len()].copy_from_slice(points);
        let (arch, octaves, stride) = (self.arch, shape.octaves, padded(shape.encoded()));
        let values = arena.take(BLOCK_ROWS * stride);
        let features = if derivatives { shape.grid_width() } else { 0 };
        let jacobian = arena.take(BLOCK_ROWS * POINT * features);
        block::encode(arch, BLOCK_ROWS, &block, POINT, octaves, values, stride, 0);
        for row in values.chunks_exact_mut(stride) {
            row[shape.encoded()..].fill(0.0);
        }
        if let Some(grid) = &shape.grid {
            let wanted = (features > 0).then_some(&mut *jacobian);
            let at = shape.waves();
            grid.encode(arch, &block, &self.table, values, stride, at, wanted);
        }
        BlockEncoding { values, jacobian }
    }

    /// Adds the transposed Jacobian of the encoding times `gradient`
    /// `[rows, padded(encoded)]` to `out` `[rows, 3]`.
    pub(super) fn pull_back(
        &self,
        encoding: &BlockEncoding<'_>,
        gradient: &[f32],
        out: &mut [f32],
    ) {
        let (shape, width) = (&self.shape, self.shape.grid_width());
        let stride = padded(shape.encoded());
        for (r, out) in out.chunks_exact_mut(POINT).enumerate() {
            let at = r * stride..(r + 1) * stride;
            let (values, gradient) = (&encoding.values[at.clone()], &gradient[at]);
            block::add_pull_back(values, gradient, POINT, shape.octaves, out);
            if width > 0 {
                let gradient = &gradient[shape.waves()..][..width];
                let jacobian = encoding.jacobian[r * POINT * width..].chunks_exact(width);
                for (out, derivative) in out.iter_mut().zip(jacobian) {
                    *out += derivative
                        .iter()
                        .zip(gradient)
                        .map(|(d, g)| d * g)
                        .sum::<f32>();
                }
            }
        }
    }

    /// The Jacobian of the encoding times `tangents` `[rows, 3]`, into `out`
    /// `[BLOCK_ROWS, padded(encoded)]`; zero in rows beyond them.
    pub(super) fn push_forward(
        &self,
        encoding: &BlockEncoding<'_>,
        tangents: &[f32],
        out: &mut [f32],
    ) {
        let (shape, width) = (&self.shape, self.shape.grid_width());
        let stride = padded(shape.encoded());
        out.fill(0.0);
        for (r, (out, tangent)) in out
            .chunks_exact_mut(stride)
            .zip(tangents.chunks_exact(POINT))
            .enumerate()
        {
            let values = &encoding.values[r * stride..(r + 1) * stride];
            block::push_forward(values, tangent, shape.octaves, out);
            if width > 0 {
                let out = &mut out[shape.waves()..][..width];
                let jacobian = encoding.jacobian[r * POINT * width..].chunks_exact(width);
                for (tangent, derivative) in tangent.iter().zip(jacobian) {
                    for (out, d) in out.iter_mut().zip(derivative) {
                        *out += tangent * d;
                    }
                }
            }
        }
    }

    /// The adjoint of the points.
    pub(super) fn to_points(
        &self,
        encoding: &BlockEncoding<'_>,
        adjoint: &EncodingAdjoint<'_>,
        points: &[f32],
        of_points: &mut [f32],
    ) {
        let (shape, stride) = (&self.shape, padded(self.shape.encoded()));
        self.pull_back(encoding, adjoint.encoding, of_points);
        let Some(gradient) = adjoint.gradient else {
            return;
        };
        for (r, out) in of_points.chunks_exact_mut(POINT).enumerate() {
            let at = r * stride..(r + 1) * stride;
            let (values, sweep) = (&encoding.values[at.clone()], &adjoint.sweep[at]);
            let n = &gradient[r * POINT..(r + 1) * POINT];
            block::add_curvature(values, sweep, n, shape.octaves, out);
        }
        if let Some(grid) = &shape.grid {
            let (arch, at) = (self.arch, shape.waves());
            let (table, sweep) = (&self.table, adjoint.sweep);
            grid.add_curvature(
                arch,
                [points, gradient],
                table,
                sweep,
                stride,
                at,
                of_points,
            );
        }
    }

    /// Leaves what the grid's table is owed by the first `rows` rows of a block.
    pub(super) fn to_grid(&self, adjoint: &EncodingAdjoint<'_>, rows: usize, out: &mut [f32]) {
        let Some(grid) = &self.shape.grid else {
            return;
        };
        let (stride, at) = (padded(self.shape.encoded()), self.shape.waves());
        let sweep = adjoint.gradient.map(|_| adjoint.sweep);
        grid.gather_adjoint(rows, adjoint.encoding, sweep, stride, at, out);
    }

    /// The gradient of the grid's table, from what the blocks `ranges` of the rows have
    /// left in `of_grid`; `tangents` are those of the first rows.
    pub(super) fn table_gradient(
        &self,
        points: &[f32],
        tangents: &[f32],
        ranges: &[Range<usize>],
        of_grid: &[f32],
    ) -> Option<Vec<f32>> {
        let grid = self.shape.grid.as_ref()?;
        let of_block = grid.adjoint_size(BLOCK_ROWS, true);
        let adjoints: Vec<GridAdjoint<'_>> = ranges
            .iter()
            .zip(of_grid.chunks(of_block))
            .map(|(range, of_features)| {
                let at = range.start * POINT..range.end * POINT;
                let tangents = tangents.get(at.clone());
                GridAdjoint {
                    points: &points[at],
                    of_features: &of_features[..grid.adjoint_size(range.len(), tangents.is_some())],
                    tangents,
                }
            })
            .collect();
        Some(grid.scatter(self.arch, &adjoints))
    }
}
