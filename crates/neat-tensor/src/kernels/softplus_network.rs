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

use super::arena::{Arena, Pooled, with_arena};
use super::block::{self, SweepAdjoint};
use super::gemm::{Panels, add_outer_products, multiply};
use super::weight_gradient::{LayerShape, WeightGradient, split_parameters, sum_over_blocks};
use super::{BLOCK_ROWS, padded};
use pulp::Arch;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_SQRT_2;

/// Coordinates of a point.
const POINT: usize = 3;

/// Shape of a signed distance network.
#[derive(Clone, Debug, PartialEq)]
pub struct SoftplusShape {
    /// Inputs and outputs of each layer, first to last.
    pub layers: Vec<LayerShape>,
    /// Frequencies of the encoding of the point.
    pub octaves: usize,
    /// Index of the layer whose input is `[h, encoding] / √2`, if any.
    pub skip: Option<usize>,
    /// Sharpness β of the softplus.
    pub sharpness: f32,
}

/// A network with its weights packed for products in both directions.
#[derive(Debug)]
pub struct SoftplusNetwork {
    shape: SoftplusShape,
    arch: Arch,
    /// `W_lᵀ` as right operand: `z = a Wᵀ`.
    forward: Vec<Panels>,
    /// `W_l` as right operand: `p = u W`.
    backward: Vec<Panels>,
    /// `[padded(outputs)]` each.
    biases: Vec<Vec<f32>>,
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

/// Matrices of one block that the backward pass reads.
struct BlockTape<'a> {
    /// `h_l`.
    h: Vec<&'a mut [f32]>,
    /// `g_l` without the last, which is the same for all rows.
    g: Vec<&'a mut [f32]>,
    /// `g_E`.
    g_encoding: &'a mut [f32],
}

impl SoftplusShape {
    fn hidden(&self) -> usize {
        self.layers.len() - 1
    }

    fn encoded(&self) -> usize {
        POINT * (1 + 2 * self.octaves)
    }

    fn widest(&self) -> usize {
        let widths = self.layers.iter().flat_map(|l| [l.inputs, l.outputs]);
        padded(widths.max().unwrap_or(0))
    }

    /// Numbers of a block's activations.
    fn block_values(&self) -> usize {
        let hidden = &self.layers[..self.hidden()];
        BLOCK_ROWS * hidden.iter().map(|l| padded(l.outputs)).sum::<usize>()
    }

    /// Numbers of a block's tape: activations, and what the sweep leaves.
    fn block_tape(&self) -> usize {
        let swept = &self.layers[..self.hidden() - 1];
        let sweep: usize = swept.iter().map(|l| padded(l.outputs)).sum();
        self.block_values() + BLOCK_ROWS * (sweep + padded(self.encoded()))
    }

    /// Numbers of working memory that any pass over a block needs.
    fn scratch(&self) -> usize {
        let hidden = self.hidden();
        // Slopes and second-order terms of all layers, encoding and its adjoints,
        // and a handful of matrices of the widest layer; a tape where none is kept.
        BLOCK_ROWS * (2 * hidden * self.widest() + 6 * self.widest() + 4 * padded(self.encoded()))
            + self.block_tape()
    }

    /// Bytes that the tape of `rows` rows takes.
    pub fn tape_bytes(&self, rows: usize) -> usize {
        rows.div_ceil(BLOCK_ROWS) * self.block_tape() * size_of::<f32>()
    }

    /// Bytes that a [`FirstPass`] over `rows` rows takes.
    pub fn first_pass_bytes(&self, rows: usize) -> usize {
        rows.div_ceil(BLOCK_ROWS) * self.block_values() * size_of::<f32>()
    }

    fn cut_values<'a>(&self, arena: &mut Arena<'a>) -> Vec<&'a mut [f32]> {
        self.layers[..self.hidden()]
            .iter()
            .map(|l| arena.take(BLOCK_ROWS * padded(l.outputs)))
            .collect()
    }

    fn cut_tape<'a>(&self, arena: &mut Arena<'a>) -> BlockTape<'a> {
        BlockTape {
            h: self.cut_values(arena),
            g: self.layers[..self.hidden() - 1]
                .iter()
                .map(|l| arena.take(BLOCK_ROWS * padded(l.outputs)))
                .collect(),
            g_encoding: arena.take(BLOCK_ROWS * padded(self.encoded())),
        }
    }
}

/// One block of a backward pass.
struct BlockJob<'a> {
    points: &'a [f32],
    known: Option<Known<'a>>,
    /// Adjoint of the first output.
    first: &'a [f32],
    /// … of the gradient, where it has one.
    gradient: Option<&'a [f32]>,
    /// … of the other outputs, where they have one.
    others: Option<&'a [f32]>,
    tape: Option<&'a mut [f32]>,
    /// Where the adjoint of the points goes.
    of_points: Option<&'a mut [f32]>,
}

/// How far a forward pass over a block goes.
struct Wanted<'a> {
    first: &'a mut [f32],
    gradient: Option<&'a mut [f32]>,
    others: Option<&'a mut [f32]>,
}

impl SoftplusNetwork {
    /// Packs `parameters`: of each layer the weight `[outputs, inputs]`, row-major,
    /// then the bias.
    ///
    /// # Panics
    /// If they do not fit the shape.
    pub fn new(arch: Arch, shape: &SoftplusShape, parameters: &[f32]) -> Self {
        let parameters = split_parameters(&shape.layers, parameters);
        let (mut forward, mut backward, mut biases) = (Vec::new(), Vec::new(), Vec::new());
        let mut first = None;
        for (l, (layer, (weight, bias))) in shape.layers.iter().zip(parameters).enumerate() {
            let n = layer.inputs;
            forward.push(Panels::new(arch, n, layer.outputs, |k, c| {
                weight[c * n + k]
            }));
            backward.push(Panels::new(arch, layer.outputs, n, |k, c| {
                weight[k * n + c]
            }));
            biases.push(layer.padded_bias(bias));
            if l + 1 == shape.layers.len() {
                let mut row = vec![0.0; padded(n)];
                row[..n].copy_from_slice(&weight[..n]);
                first = Some((
                    Panels::new(arch, n, 1, |k, _| weight[k]),
                    Panels::new(arch, 1, n, |_, c| weight[c]),
                    row,
                ));
            }
        }
        let (first_forward, first_backward, first_row) =
            first.expect("SoftplusNetwork::new: a network has layers");
        Self {
            shape: shape.clone(),
            arch,
            forward,
            backward,
            biases,
            first_forward,
            first_backward,
            first_row,
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
                        h: self.shape.cut_values(&mut Arena::new(values)),
                        ..self.shape.cut_tape(arena)
                    };
                    self.block_first(points, first, tape, arena);
                });
            });
        FirstPass { first, values }
    }

    fn block_first(
        &self,
        points: &[f32],
        first: &mut [f32],
        mut tape: BlockTape<'_>,
        arena: &mut Arena<'_>,
    ) {
        let wanted = Wanted {
            first,
            gradient: None,
            others: None,
        };
        self.block_forward(points, None, &mut tape, wanted, arena);
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
        let mut tapes: Vec<Option<&mut [f32]>> = if keep {
            tape.as_mut_slice().chunks_mut(of_block).map(Some).collect()
        } else {
            (0..blocks).map(|_| None).collect()
        };
        let mut others: Vec<Option<&mut [f32]>> = if width > 0 {
            output
                .others
                .chunks_mut(BLOCK_ROWS * width)
                .map(Some)
                .collect()
        } else {
            (0..blocks).map(|_| None).collect()
        };
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

    /// The input of layer `l` and its row stride; a concatenation is written to
    /// `joined`.
    fn input<'b>(
        &self,
        l: usize,
        h: &'b [&mut [f32]],
        encoding: &'b [f32],
        joined: &'b mut [f32],
    ) -> (&'b [f32], usize) {
        let shape = &self.shape;
        let encoded = shape.encoded();
        if l == 0 {
            return (encoding, padded(encoded));
        }
        let before = shape.layers[l - 1].outputs;
        if shape.skip != Some(l) {
            return (h[l - 1], padded(before));
        }
        let stride = padded(shape.layers[l].inputs);
        self.join(h[l - 1], encoding, l, joined);
        (joined, stride)
    }

    /// `[head, tail] / √2` as the skip layer `l` takes it.
    fn join(&self, head: &[f32], tail: &[f32], l: usize, out: &mut [f32]) {
        let shape = &self.shape;
        let (before, encoded) = (shape.layers[l - 1].outputs, shape.encoded());
        let stride = padded(shape.layers[l].inputs);
        for ((out, head), tail) in out
            .chunks_exact_mut(stride)
            .zip(head.chunks_exact(padded(before)))
            .zip(tail.chunks_exact(padded(encoded)))
            .take(BLOCK_ROWS)
        {
            let (first, rest) = out.split_at_mut(before);
            for (out, x) in first.iter_mut().zip(head) {
                *out = x * FRAC_1_SQRT_2;
            }
            for (out, x) in rest.iter_mut().zip(&tail[..encoded]) {
                *out = x * FRAC_1_SQRT_2;
            }
            rest[encoded..].fill(0.0);
        }
    }

    /// The adjoint of [`Self::join`]: writes the head, adds the tail.
    fn part(&self, joined: &[f32], l: usize, head: &mut [f32], tail: &mut [f32]) {
        let shape = &self.shape;
        let (before, encoded) = (shape.layers[l - 1].outputs, shape.encoded());
        let stride = padded(shape.layers[l].inputs);
        for ((joined, head), tail) in joined
            .chunks_exact(stride)
            .zip(head.chunks_exact_mut(padded(before)))
            .zip(tail.chunks_exact_mut(padded(encoded)))
            .take(BLOCK_ROWS)
        {
            for (out, x) in head[..before].iter_mut().zip(joined) {
                *out = x * FRAC_1_SQRT_2;
            }
            head[before..].fill(0.0);
            for (out, x) in tail.iter_mut().zip(&joined[before..before + encoded]) {
                *out += x * FRAC_1_SQRT_2;
            }
        }
    }

    /// The encoding of a block's points; rows beyond them repeat the origin.
    fn encode(&self, points: &[f32], encoding: &mut [f32]) {
        let mut block = [0.0; BLOCK_ROWS * POINT];
        block[..points.len()].copy_from_slice(points);
        let stride = padded(self.shape.encoded());
        block::encode(
            self.arch,
            BLOCK_ROWS,
            &block,
            POINT,
            self.shape.octaves,
            encoding,
            stride,
            0,
        );
        for row in encoding.chunks_exact_mut(stride) {
            row[self.shape.encoded()..].fill(0.0);
        }
    }

    fn block_forward(
        &self,
        points: &[f32],
        known: Option<Known<'_>>,
        tape: &mut BlockTape<'_>,
        wanted: Wanted<'_>,
        arena: &mut Arena<'_>,
    ) {
        let shape = &self.shape;
        let (arch, hidden) = (self.arch, shape.hidden());
        let rows = points.len() / POINT;
        let encoding = arena.take(BLOCK_ROWS * padded(shape.encoded()));
        let joined = arena.take(BLOCK_ROWS * shape.widest());
        self.encode(points, encoding);
        let slopes = match known {
            None => self.activations(tape, encoding, joined, wanted.gradient.is_some(), arena),
            Some(known) => {
                self.recall(known, &mut tape.h);
                self.slopes(&tape.h, arena)
            }
        };
        let last = &*tape.h[hidden - 1];
        let stride = padded(shape.layers[hidden].inputs);
        let bias = &self.biases[hidden];
        match wanted.others {
            None => {
                let y = &mut joined[..BLOCK_ROWS * super::PADDING];
                let (weight, bias) = (&self.first_forward, &bias[..super::PADDING]);
                multiply(
                    arch,
                    BLOCK_ROWS,
                    last,
                    stride,
                    weight,
                    Some(bias),
                    y,
                    super::PADDING,
                );
                for (out, y) in wanted.first.iter_mut().zip(y.chunks_exact(super::PADDING)) {
                    *out = y[0];
                }
            }
            Some(others) => {
                let width = padded(shape.layers[hidden].outputs);
                let y = &mut joined[..BLOCK_ROWS * width];
                let (weight, bias) = (&self.forward[hidden], Some(&bias[..]));
                multiply(arch, BLOCK_ROWS, last, stride, weight, bias, y, width);
                let count = self.others();
                for ((first, others), y) in wanted
                    .first
                    .iter_mut()
                    .zip(others.chunks_exact_mut(count))
                    .zip(y.chunks_exact(width))
                {
                    *first = y[0];
                    others.copy_from_slice(&y[1..=count]);
                }
            }
        }
        let Some(gradient) = wanted.gradient else {
            return;
        };
        self.sweep(tape, &slopes, joined, arena);
        let stride = padded(shape.encoded());
        for ((out, encoding), g) in gradient
            .chunks_exact_mut(POINT)
            .zip(encoding.chunks_exact(stride))
            .zip(tape.g_encoding.chunks_exact(stride))
            .take(rows)
        {
            block::add_pull_back(encoding, g, POINT, shape.octaves, out);
        }
    }

    /// Fills `h` of the tape; gives the slopes of all layers where `slopes`.
    fn activations<'b>(
        &self,
        tape: &mut BlockTape<'_>,
        encoding: &[f32],
        joined: &mut [f32],
        slopes: bool,
        arena: &mut Arena<'b>,
    ) -> Vec<&'b mut [f32]> {
        let mut all = Vec::new();
        for l in 0..self.shape.hidden() {
            let (done, next) = tape.h.split_at_mut(l);
            let (input, stride) = self.input(l, done, encoding, joined);
            let width = padded(self.shape.layers[l].outputs);
            let z = &mut *next[0];
            let (weight, bias) = (&self.forward[l], Some(&self.biases[l][..]));
            multiply(self.arch, BLOCK_ROWS, input, stride, weight, bias, z, width);
            let mut slope = slopes.then(|| arena.take(z.len()));
            block::softplus(self.arch, z, self.shape.sharpness, slope.as_deref_mut());
            all.extend(slope);
        }
        all
    }

    /// Fills `h` of a block with the activations of known rows.
    fn recall(&self, known: Known<'_>, h: &mut [&mut [f32]]) {
        let of_block = self.shape.block_values();
        let values = known.pass.values.as_slice();
        for (place, row) in known.rows.iter().map(|row| *row as usize).enumerate() {
            let mut block = &values[row / BLOCK_ROWS * of_block..];
            for (h, layer) in h.iter_mut().zip(&self.shape.layers) {
                let width = padded(layer.outputs);
                h[place * width..][..width]
                    .copy_from_slice(&block[row % BLOCK_ROWS * width..][..width]);
                block = &block[BLOCK_ROWS * width..];
            }
        }
        for (h, layer) in h.iter_mut().zip(&self.shape.layers) {
            h[known.rows.len() * padded(layer.outputs)..].fill(0.0);
        }
    }

    /// The slopes of all layers, from their values.
    fn slopes<'b>(&self, h: &[&mut [f32]], arena: &mut Arena<'b>) -> Vec<&'b mut [f32]> {
        h.iter()
            .map(|h| {
                let slope = arena.take(h.len());
                block::softplus_slope(self.arch, h, self.shape.sharpness, slope);
                slope
            })
            .collect()
    }

    /// The reverse sweep: fills `g` and `g_encoding` of the tape.
    fn sweep(
        &self,
        tape: &mut BlockTape<'_>,
        slopes: &[&mut [f32]],
        joined: &mut [f32],
        arena: &mut Arena<'_>,
    ) {
        let shape = &self.shape;
        let (arch, hidden) = (self.arch, shape.hidden());
        let u = arena.take(BLOCK_ROWS * shape.widest());
        tape.g_encoding.fill(0.0);
        for l in (0..hidden).rev() {
            let width = padded(shape.layers[l].outputs);
            let u = &mut u[..BLOCK_ROWS * width];
            if l + 1 == hidden {
                block::scale_rows(arch, slopes[l], &self.first_row, u);
            } else {
                block::product(arch, tape.g[l], slopes[l], u);
            }
            let inputs = padded(shape.layers[l].inputs);
            let weight = &self.backward[l];
            if l == 0 {
                let p = &mut joined[..BLOCK_ROWS * inputs];
                multiply(arch, BLOCK_ROWS, u, width, weight, None, p, inputs);
                for (g, p) in tape.g_encoding.iter_mut().zip(p) {
                    *g += *p;
                }
            } else if shape.skip == Some(l) {
                let p = &mut joined[..BLOCK_ROWS * inputs];
                multiply(arch, BLOCK_ROWS, u, width, weight, None, p, inputs);
                self.part(p, l, tape.g[l - 1], tape.g_encoding);
            } else {
                multiply(
                    arch,
                    BLOCK_ROWS,
                    u,
                    width,
                    weight,
                    None,
                    tape.g[l - 1],
                    inputs,
                );
            }
        }
    }

    /// The gradient of `Σ output · adjoint` with respect to the parameters, in the
    /// order of [`Self::new`], and with respect to the points `[N, 3]` where
    /// `to_points`. The tape of the first `H` rows, and known rows, spare computing
    /// them again.
    pub fn backward(
        &self,
        points: &[f32],
        known: Option<Known<'_>>,
        adjoint: SoftplusAdjoint<'_>,
        tape: Option<Tape>,
        to_points: bool,
    ) -> (Vec<f32>, Option<Vec<f32>>) {
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
        let jobs: Vec<BlockJob<'_>> = blocks_of(0, heavy)
            .chain(blocks_of(heavy, rows))
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
            })
            .collect();
        let sum = sum_over_blocks(&self.shape.layers, jobs, |job, sum| {
            with_arena(self.shape.scratch(), |arena| {
                self.block_backward(job, sum, arena);
            });
        });
        (sum, to_points.then_some(of_points))
    }

    fn block_backward(
        &self,
        job: BlockJob<'_>,
        sum: &mut WeightGradient<'_>,
        arena: &mut Arena<'_>,
    ) {
        let shape = &self.shape;
        let (arch, hidden) = (self.arch, shape.hidden());
        let rows = job.first.len();
        let encoded = shape.encoded();
        let of_encoding = padded(encoded);
        let swept = job.gradient.is_some();

        // Activations: from the tape, or once more.
        let mut slopes: Vec<&mut [f32]> = Vec::new();
        let recompute = job.tape.is_none();
        let mut tape = match job.tape {
            Some(tape) => shape.cut_tape(&mut Arena::new(tape)),
            None => shape.cut_tape(arena),
        };
        let encoding = arena.take(BLOCK_ROWS * of_encoding);
        let joined = arena.take(BLOCK_ROWS * shape.widest());
        self.encode(job.points, encoding);
        if recompute {
            slopes = match job.known {
                None => self.activations(&mut tape, encoding, joined, true, arena),
                Some(known) => {
                    self.recall(known, &mut tape.h);
                    self.slopes(&tape.h, arena)
                }
            };
            if swept {
                self.sweep(&mut tape, &slopes, joined, arena);
            }
        }

        // Up: the adjoint of the sweep. `through[l]` is what z̄_l gets from it.
        let mut through: Vec<&mut [f32]> = Vec::new();
        // ḡ_E, the adjoint of `g_encoding`.
        let tangent = arena.take(BLOCK_ROWS * of_encoding);
        if let Some(gradient) = job.gradient {
            tangent.fill(0.0);
            for ((tangent, encoding), n) in tangent
                .chunks_exact_mut(of_encoding)
                .zip(encoding.chunks_exact(of_encoding))
                .zip(gradient.chunks_exact(POINT))
            {
                block::push_forward(encoding, n, shape.octaves, tangent);
            }
            let p = arena.take(BLOCK_ROWS * shape.widest());
            let up = arena.take(BLOCK_ROWS * shape.widest());
            p[..tangent.len()].copy_from_slice(tangent);
            for l in 0..hidden {
                let (inputs, width) = (
                    padded(shape.layers[l].inputs),
                    padded(shape.layers[l].outputs),
                );
                let size = BLOCK_ROWS * width;
                if shape.skip == Some(l) && l > 0 {
                    // `p` holds ḡ_{l−1}; join it with the encoding's.
                    self.join(p, tangent, l, joined);
                    p[..BLOCK_ROWS * inputs].copy_from_slice(&joined[..BLOCK_ROWS * inputs]);
                }
                let up = &mut up[..size];
                multiply(
                    arch,
                    BLOCK_ROWS,
                    p,
                    inputs,
                    &self.forward[l],
                    None,
                    up,
                    width,
                );
                if slopes.len() <= l {
                    slopes.push(arena.take(size));
                }
                through.push(arena.take(size));
                let g = &mut joined[..size];
                if l + 1 == hidden {
                    for row in g.chunks_exact_mut(width) {
                        row.copy_from_slice(&self.first_row);
                    }
                } else {
                    g.copy_from_slice(tape.g[l]);
                }
                SweepAdjoint {
                    h: tape.h[l],
                    g,
                    up,
                    slope: slopes[l],
                    through_slope: through[l],
                    sharpness: shape.sharpness,
                }
                .run(arch);
                let outputs = shape.layers[l].outputs;
                add_outer_products(
                    arch,
                    BLOCK_ROWS,
                    g,
                    width,
                    outputs,
                    p,
                    inputs,
                    sum.weight(l),
                );
                p[..size].copy_from_slice(up);
            }
            // The sweep starts at the first row of the last weight.
            let width = padded(shape.layers[hidden].inputs);
            let first_row = &mut sum.weight(hidden)[..width];
            block::add_column_sums(arch, &p[..BLOCK_ROWS * width], width, first_row);
        } else if slopes.is_empty() {
            slopes = self.slopes(&tape.h, arena);
        }

        // Down: the adjoint of the forward pass.
        let adjoint = arena.take(BLOCK_ROWS * shape.widest());
        let before = arena.take(BLOCK_ROWS * shape.widest());
        let to_encoding = arena.take(BLOCK_ROWS * of_encoding);
        to_encoding.fill(0.0);
        let stride = padded(shape.layers[hidden].inputs);
        let last = &*tape.h[hidden - 1];
        let width = match job.others {
            None => super::PADDING,
            Some(_) => padded(shape.layers[hidden].outputs),
        };
        let y = &mut before[..BLOCK_ROWS * width];
        y.fill(0.0);
        for (y, first) in y.chunks_exact_mut(width).zip(job.first) {
            y[0] = *first;
        }
        if let Some(others) = job.others {
            let count = self.others();
            for (y, others) in y.chunks_exact_mut(width).zip(others.chunks_exact(count)) {
                y[1..=count].copy_from_slice(others);
            }
        }
        let (outputs, weight) = match job.others {
            None => (1, &self.first_backward),
            Some(_) => (shape.layers[hidden].outputs, &self.backward[hidden]),
        };
        let size = BLOCK_ROWS * stride;
        multiply(
            arch,
            BLOCK_ROWS,
            y,
            width,
            weight,
            None,
            &mut adjoint[..size],
            stride,
        );
        add_outer_products(
            arch,
            BLOCK_ROWS,
            y,
            width,
            outputs,
            last,
            stride,
            sum.weight(hidden),
        );
        block::add_column_sums(arch, y, width, sum.bias(hidden));
        for l in (0..hidden).rev() {
            let width = padded(shape.layers[l].outputs);
            let z = &mut adjoint[..BLOCK_ROWS * width];
            block::scale_and_add(arch, z, slopes[l], through.get(l).map(|t| &**t));
            block::add_column_sums(arch, z, width, sum.bias(l));
            let (input, stride) = self.input(l, &tape.h, encoding, joined);
            let outputs = shape.layers[l].outputs;
            add_outer_products(
                arch,
                BLOCK_ROWS,
                z,
                width,
                outputs,
                input,
                stride,
                sum.weight(l),
            );
            if l == 0 && job.of_points.is_none() {
                break;
            }
            let before = &mut before[..BLOCK_ROWS * stride];
            multiply(
                arch,
                BLOCK_ROWS,
                z,
                width,
                &self.backward[l],
                None,
                before,
                stride,
            );
            if l == 0 {
                for (sum, x) in to_encoding.iter_mut().zip(&*before) {
                    *sum += x;
                }
            } else if shape.skip == Some(l) {
                self.part(before, l, adjoint, to_encoding);
            } else {
                adjoint[..before.len()].copy_from_slice(before);
            }
        }
        let Some(of_points) = job.of_points else {
            return;
        };
        for r in 0..rows {
            let at = r * of_encoding..(r + 1) * of_encoding;
            let out = &mut of_points[r * POINT..(r + 1) * POINT];
            let encoding = &encoding[at.clone()];
            block::add_pull_back(
                encoding,
                &to_encoding[at.clone()],
                POINT,
                shape.octaves,
                out,
            );
            if let Some(gradient) = job.gradient {
                let n = &gradient[r * POINT..(r + 1) * POINT];
                block::add_curvature(encoding, &tape.g_encoding[at], n, shape.octaves, out);
            }
        }
    }
}
