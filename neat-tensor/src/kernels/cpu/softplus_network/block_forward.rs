//! One block forwards: activations of all layers, and the reverse sweep.

use super::{Known, SoftplusNetwork, SoftplusShape};
use crate::kernels::cpu::arena::Arena;
use crate::kernels::cpu::gemm::multiply;
use crate::kernels::cpu::layers::{cut_block, widest};
use crate::kernels::cpu::{BLOCK_ROWS, PADDING, block, padded};
use std::f32::consts::FRAC_1_SQRT_2;

/// Matrices of one block that the backward pass reads.
pub(super) struct BlockTape<'a> {
    /// `h_l`.
    pub h: Vec<&'a mut [f32]>,
    /// `g_l` without the last, which is the same for all rows.
    pub g: Vec<&'a mut [f32]>,
    /// `g_E`.
    pub g_encoding: &'a mut [f32],
}

/// How far a forward pass over a block goes.
pub(super) struct Wanted<'a> {
    pub first: &'a mut [f32],
    pub gradient: Option<&'a mut [f32]>,
    pub others: Option<&'a mut [f32]>,
}

impl SoftplusShape {
    pub(super) fn cut_tape<'a>(&self, arena: &mut Arena<'a>) -> BlockTape<'a> {
        let hidden = self.hidden_layers();
        BlockTape {
            h: cut_block(hidden, arena),
            g: cut_block(&hidden[..hidden.len() - 1], arena),
            g_encoding: arena.take(BLOCK_ROWS * padded(self.encoded())),
        }
    }
}

impl SoftplusNetwork<'_> {
    pub(super) fn block_first(
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

    /// The input of layer `l` and its row stride; a concatenation is written to
    /// `joined`.
    pub(super) fn input<'b>(
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
    pub(super) fn join(&self, head: &[f32], tail: &[f32], l: usize, out: &mut [f32]) {
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
    pub(super) fn part(&self, joined: &[f32], l: usize, head: &mut [f32], tail: &mut [f32]) {
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

    pub(super) fn block_forward(
        &self,
        points: &[f32],
        known: Option<Known<'_>>,
        tape: &mut BlockTape<'_>,
        wanted: Wanted<'_>,
        arena: &mut Arena<'_>,
    ) {
        let shape = &self.shape;
        let (arch, hidden) = (self.arch, shape.hidden());
        let encoding = self.encode(points, wanted.gradient.is_some(), arena);
        let joined = arena.take(BLOCK_ROWS * widest(&shape.layers));
        let slopes = match known {
            None => {
                let slopes = wanted.gradient.is_some();
                self.activations(tape, encoding.values, joined, slopes, arena)
            }
            Some(known) => {
                self.recall(known, &mut tape.h);
                self.slopes(&tape.h, arena)
            }
        };
        let last = &*tape.h[hidden - 1];
        let stride = padded(shape.layers[hidden].inputs);
        let bias = &self.packed.biases[hidden];
        match wanted.others {
            None => {
                let y = &mut joined[..BLOCK_ROWS * PADDING];
                let (weight, bias) = (&self.first_forward, &bias[..PADDING]);
                multiply(
                    arch,
                    BLOCK_ROWS,
                    last,
                    stride,
                    weight,
                    Some(bias),
                    y,
                    PADDING,
                );
                for (out, y) in wanted.first.iter_mut().zip(y.chunks_exact(PADDING)) {
                    *out = y[0];
                }
            }
            Some(others) => {
                let width = padded(shape.layers[hidden].outputs);
                let y = &mut joined[..BLOCK_ROWS * width];
                let (weight, bias) = (&self.packed.forward[hidden], Some(&bias[..]));
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
        self.pull_back(&encoding, tape.g_encoding, gradient);
    }

    /// Fills `h` of the tape; gives the slopes of all layers where `slopes`.
    pub(super) fn activations<'b>(
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
            let (weight, bias) = (&self.packed.forward[l], Some(&self.packed.biases[l][..]));
            multiply(self.arch, BLOCK_ROWS, input, stride, weight, bias, z, width);
            let mut slope = slopes.then(|| arena.take(z.len()));
            block::softplus(self.arch, z, self.shape.sharpness, slope.as_deref_mut());
            all.extend(slope);
        }
        all
    }

    /// Fills `h` of a block with the activations of known rows.
    pub(super) fn recall(&self, known: Known<'_>, h: &mut [&mut [f32]]) {
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
    pub(super) fn slopes<'b>(&self, h: &[&mut [f32]], arena: &mut Arena<'b>) -> Vec<&'b mut [f32]> {
        h.iter()
            .map(|h| {
                let slope = arena.take(h.len());
                block::softplus_slope(self.arch, h, self.shape.sharpness, slope);
                slope
            })
            .collect()
    }

    /// The reverse sweep: fills `g` and `g_encoding` of the tape.
    pub(super) fn sweep(
        &self,
        tape: &mut BlockTape<'_>,
        slopes: &[&mut [f32]],
        joined: &mut [f32],
        arena: &mut Arena<'_>,
    ) {
        let shape = &self.shape;
        let (arch, hidden) = (self.arch, shape.hidden());
        let u = arena.take(BLOCK_ROWS * widest(&shape.layers));
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
            let weight = &self.packed.backward[l];
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
}
