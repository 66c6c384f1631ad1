//! The signed distance network: softplus perceptron over encoded points, with
//! the gradient of its first output with respect to the point, and the backward
//! pass of both.
//!
//! Notation of one row, layers `l = 0 … L`, the last linear:
//!
//! ```text
//! a_0 = E = encoding(x)      z_l = W_l a_l + b_l      h_l = φ(z_l)      s_l = φ'(z_l)
//! a_l = h_{l−1}, at the skip layer [h_{l−1}, E] / √2      y = W_L h_{L−1} + b_L
//! g_{L−1} = first row of W_L      u_l = g_l s_l      p_l = W_lᵀ u_l = ∂y_0/∂a_l
//! g_{l−1} = p_l, at the skip layer its head / √2      ∂y_0/∂x = (∂E/∂x)ᵀ g_E
//! ```
//!
//! The backward pass first runs up through the adjoint of the sweep (`ū_l = W_l
//! p̄_l`, which gives `W̄_l += u_l p̄_lᵀ` and an addition to `z̄_l`), then down
//! through the adjoint of the forward pass.

mod block_backward;
mod block_encoding;
mod block_forward;

use block_backward::BlockJob;
use block_forward::{BlockTape, Wanted};

use super::arena::{Arena, Pooled, with_arena};
use super::gemm::Panels;
use super::grid::GridShape;
use super::layers::{LayerShape, PackedLayers, block_size, cut_block, per_block, widest};
use super::weight_gradient::sum_over_blocks;
use super::{BLOCK_ROWS, padded};
use pulp::Arch;
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Coordinates of a point.
const POINT: usize = 3;

/// Shape of a signed distance network.
#[derive(Clone, Debug, PartialEq)]
pub struct SoftplusShape {
    /// Inputs and outputs of each layer, first to last.
    pub layers: Vec<LayerShape>,
    /// Frequencies of the encoding of the point.
    pub octaves: usize,
    /// Learned grids whose features follow the sines in the encoding, if any.
    pub grid: Option<GridShape>,
    /// Index of the layer whose input is `[h, encoding] / √2`, if any.
    pub skip: Option<usize>,
    /// Sharpness β of the softplus.
    pub sharpness: f32,
}

/// A network with its weights packed.
#[derive(Debug)]
pub struct SoftplusNetwork<'t> {
    shape: SoftplusShape,
    arch: Arch,
    packed: PackedLayers,
    /// The grid's table, `[entries, features]`; empty without one.
    table: Cow<'t, [f32]>,
    /// The first output's column of the last layer, as right operand.
    first_forward: Panels,
    /// … its row, as right operand of one-column left operands.
    first_backward: Panels,
    /// The first row of the last weight, padded.
    first_row: Vec<f32>,
}

/// What a forward pass says of its rows.
#[derive(Debug, Default)]
pub struct SoftplusOutput {
    /// First output of every row, `[N]`.
    pub first: Vec<f32>,
    /// Its gradient with respect to the point, `[N, 3]`.
    pub gradient: Vec<f32>,
    /// The other outputs, `[N, outputs − 1]`; empty unless asked for.
    pub others: Vec<f32>,
}

/// First outputs of some rows, and the activations on the way to them.
#[derive(Debug)]
pub struct FirstPass {
    /// First output of every row, `[N]`.
    pub first: Vec<f32>,
    /// `h_l` of every layer, block after block.
    values: Pooled,
}

/// Rows that an earlier [`FirstPass`] with the same parameters has seen.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// That pass.
    pub pass: &'a FirstPass,
    /// Of each row at hand its number there.
    pub rows: &'a [u32],
}

/// Adjoints of [`SoftplusOutput`], of the same shapes.
#[derive(Clone, Copy, Debug)]
pub struct SoftplusAdjoint<'a> {
    /// `[N]`.
    pub first: &'a [f32],
    /// `[H, 3]` of the first `H ≤ N` rows: the others' gradients have no adjoint.
    pub gradient: &'a [f32],
    /// `[H, outputs − 1]`, or empty for none.
    pub others: &'a [f32],
}

/// What a backward pass says.
#[derive(Debug)]
pub struct SoftplusGradient {
    /// Of the parameters, in the order of [`SoftplusNetwork::new`].
    pub parameters: Vec<f32>,
    /// Of the grid's table, if there is one.
    pub table: Option<Vec<f32>>,
    /// Of the points `[N, 3]`, where asked for.
    pub points: Option<Vec<f32>>,
}

/// Activations of a forward pass, block after block.
#[derive(Debug)]
pub struct Tape(Pooled);

impl<'a> Known<'a> {
    /// The rows of one block.
    fn block(self, first_row: usize, rows: usize) -> Self {
        Self {
            rows: &self.rows[first_row..first_row + rows],
            ..self
        }
    }
}

impl SoftplusShape {
    fn hidden(&self) -> usize {
        self.layers.len() - 1
    }

    fn hidden_layers(&self) -> &[LayerShape] {
        &self.layers[..self.hidden()]
    }

    /// Columns of the encoding without the grid's features.
    fn waves(&self) -> usize {
        POINT * (1 + 2 * self.octaves)
    }

    fn grid_width(&self) -> usize {
        self.grid.as_ref().map_or(0, GridShape::width)
    }

    fn encoded(&self) -> usize {
        self.waves() + self.grid_width()
    }

    /// Numbers of a block's activations.
    fn block_values(&self) -> usize {
        block_size(self.hidden_layers())
    }

    /// Numbers of a block's tape: activations, and what the sweep leaves.
    fn block_tape(&self) -> usize {
        let swept = &self.layers[..self.hidden() - 1];
        self.block_values() + block_size(swept) + BLOCK_ROWS * padded(self.encoded())
    }

    /// Numbers of working memory that any pass over a block needs.
    fn scratch(&self) -> usize {
        let (hidden, widest) = (self.hidden(), widest(&self.layers));
        // Slopes and second-order terms of all layers, encoding and its adjoints,
        // and a handful of matrices of the widest layer; a tape where none is kept.
        let encodings = 4 * padded(self.encoded()) + POINT * self.grid_width();
        BLOCK_ROWS * ((2 * hidden + 6) * widest + encodings) + self.block_tape()
    }

    /// Bytes that the tape of `rows` rows takes.
    pub fn tape_bytes(&self, rows: usize) -> usize {
        rows.div_ceil(BLOCK_ROWS) * self.block_tape() * size_of::<f32>()
    }

    /// Bytes that a [`FirstPass`] over `rows` rows takes.
    pub fn first_pass_bytes(&self, rows: usize) -> usize {
        rows.div_ceil(BLOCK_ROWS) * self.block_values() * size_of::<f32>()
    }
}

impl<'t> SoftplusNetwork<'t> {
    /// Packs `parameters`: of each layer the weight `[outputs, inputs]`, row-major,
    /// then the bias. `table` `[entries, features]` is that of the grid, if there is one.
    ///
    /// # Panics
    /// If they do not fit the shape.
    pub fn new(
        arch: Arch,
        shape: &SoftplusShape,
        parameters: &[f32],
        table: impl Into<Cow<'t, [f32]>>,
    ) -> Self {
        let table = table.into();
        if let Some(grid) = &shape.grid {
            assert_eq!(
                table.len(),
                grid.entries() * grid.features,
                "SoftplusNetwork::new: the table does not fit the grid"
            );
        }
        let packed = PackedLayers::new(arch, &shape.layers, parameters);
        let last = shape.layers[shape.hidden()];
        let first_row = &parameters[parameters.len() - last.parameters()..][..last.inputs];
        let mut padded_row = first_row.to_vec();
        padded_row.resize(padded(last.inputs), 0.0);
        Self {
            shape: shape.clone(),
            arch,
            packed,
            table,
            first_forward: Panels::new(arch, last.inputs, 1, |k, _| first_row[k]),
            first_backward: Panels::new(arch, 1, last.inputs, |_, c| first_row[c]),
            first_row: padded_row,
        }
    }

    /// The first output at `points` `[N, 3]`.
    pub fn first(&self, points: &[f32]) -> Vec<f32> {
        let mut first = vec![0.0; points.len() / POINT];
        first
            .par_chunks_mut(BLOCK_ROWS)
            .zip(points.par_chunks(BLOCK_ROWS * POINT))
            .for_each(|(first, points)| {
                with_arena(self.shape.scratch(), |arena| {
                    let tape = self.shape.cut_tape(arena);
                    self.block_first(points, first, tape, arena);
                });
            });
        first
    }

    /// [`Self::first`], with the activations for later passes over the same rows.
    pub fn first_pass(&self, points: &[f32]) -> FirstPass {
        let rows = points.len() / POINT;
        let of_block = self.shape.block_values();
        let mut first = vec![0.0; rows];
        let mut values = Pooled::take(rows.div_ceil(BLOCK_ROWS) * of_block);
        first
            .par_chunks_mut(BLOCK_ROWS)
            .zip(points.par_chunks(BLOCK_ROWS * POINT))
            .zip(values.as_mut_slice().par_chunks_mut(of_block))
            .for_each(|((first, points), values)| {
                with_arena(self.shape.scratch(), |arena| {
                    let tape = BlockTape {
                        h: cut_block(self.shape.hidden_layers(), &mut Arena::new(values)),
                        ..self.shape.cut_tape(arena)
                    };
                    self.block_first(points, first, tape, arena);
                });
            });
        FirstPass { first, values }
    }

    /// First output, its gradient and, where asked for, the other outputs at
    /// `points` `[N, 3]`; with a tape for [`Self::backward`] where `keep`.
    pub fn forward(
        &self,
        points: &[f32],
        known: Option<Known<'_>>,
        others: bool,
        keep: bool,
    ) -> (SoftplusOutput, Option<Tape>) {
        let rows = points.len() / POINT;
        let width = if others { self.others() } else { 0 };
        let mut output = SoftplusOutput {
            first: vec![0.0; rows],
            gradient: vec![0.0; rows * POINT],
            others: vec![0.0; rows * width],
        };
        let blocks = rows.div_ceil(BLOCK_ROWS);
        let of_block = self.shape.block_tape();
        let mut tape = Pooled::take(if keep { blocks * of_block } else { 0 });
        let kept = keep.then(|| tape.as_mut_slice());
        let mut tapes = per_block(kept, of_block, blocks);
        let wanted = (width > 0).then_some(&mut output.others[..]);
        let mut others = per_block(wanted, BLOCK_ROWS * width, blocks);
        output
            .first
            .par_chunks_mut(BLOCK_ROWS)
            .zip(output.gradient.par_chunks_mut(BLOCK_ROWS * POINT))
            .zip(points.par_chunks(BLOCK_ROWS * POINT))
            .zip(tapes.par_iter_mut().zip(others.par_iter_mut()))
            .enumerate()
            .for_each(|(block, (((first, gradient), points), (tape, others)))| {
                let known = known.map(|known| known.block(block * BLOCK_ROWS, first.len()));
                with_arena(self.shape.scratch(), |arena| {
                    let mut tape = match tape {
                        Some(tape) => self.shape.cut_tape(&mut Arena::new(tape)),
                        None => self.shape.cut_tape(arena),
                    };
                    let wanted = Wanted {
                        first,
                        gradient: Some(gradient),
                        others: others.as_deref_mut(),
                    };
                    self.block_forward(points, known, &mut tape, wanted, arena);
                });
            });
        drop((tapes, others));
        (output, keep.then_some(Tape(tape)))
    }

    /// Its shape.
    pub fn shape(&self) -> &SoftplusShape {
        &self.shape
    }

    /// Number of outputs beyond the first.
    pub fn others(&self) -> usize {
        self.shape.layers[self.shape.hidden()].outputs - 1
    }

    /// The gradient of `Σ output · adjoint`, with respect to the points where
    /// `to_points`. The tape of the first `H` rows, and known rows, spare computing
    /// them again.
    pub fn backward(
        &self,
        points: &[f32],
        known: Option<Known<'_>>,
        adjoint: SoftplusAdjoint<'_>,
        tape: Option<Tape>,
        to_points: bool,
    ) -> SoftplusGradient {
        let rows = points.len() / POINT;
        let heavy = adjoint.gradient.len() / POINT;
        let mut tape = tape.map(|Tape(tape)| tape);
        let of_block = self.shape.block_tape();
        let blocks_of = |from: usize, to: usize| {
            (from..to)
                .step_by(BLOCK_ROWS)
                .map(move |first| first..to.min(first + BLOCK_ROWS))
        };
        let mut tapes = tape
            .as_mut()
            .map(|tape| tape.as_mut_slice().chunks_mut(of_block));
        let mut to_point_blocks = Vec::new();
        let mut of_points = vec![0.0; if to_points { points.len() } else { 0 }];
        if to_points {
            let (head, tail) = of_points.split_at_mut(heavy * POINT);
            to_point_blocks.extend(head.chunks_mut(BLOCK_ROWS * POINT).map(Some));
            to_point_blocks.extend(tail.chunks_mut(BLOCK_ROWS * POINT).map(Some));
        }
        let mut to_point_blocks = to_point_blocks.into_iter();
        let ranges: Vec<Range<usize>> = blocks_of(0, heavy).chain(blocks_of(heavy, rows)).collect();
        let of_grid_block = 2 * BLOCK_ROWS * self.shape.grid_width();
        let mut of_grid = Pooled::take(ranges.len() * of_grid_block);
        let mut to_grid_blocks = of_grid.as_mut_slice().chunks_mut(of_grid_block.max(1));
        let jobs: Vec<BlockJob<'_>> = ranges
            .iter()
            .map(|range| BlockJob {
                points: &points[range.start * POINT..range.end * POINT],
                known: known.map(|known| known.block(range.start, range.len())),
                first: &adjoint.first[range.clone()],
                gradient: (range.start < heavy)
                    .then(|| &adjoint.gradient[range.start * POINT..range.end * POINT]),
                others: (range.start < heavy && !adjoint.others.is_empty()).then(|| {
                    let width = self.others();
                    &adjoint.others[range.start * width..range.end * width]
                }),
                tape: tapes.as_mut().and_then(Iterator::next),
                of_points: to_point_blocks.next().flatten(),
                of_grid: to_grid_blocks.next(),
            })
            .collect();
        let sum = sum_over_blocks(&self.shape.layers, jobs, |job, sum| {
            with_arena(self.shape.scratch(), |arena| {
                self.block_backward(job, sum, arena);
            });
        });
        SoftplusGradient {
            parameters: sum,
            table: self.table_gradient(points, adjoint.gradient, &ranges, of_grid.as_slice()),
            points: to_points.then_some(of_points),
        }
    }
}
