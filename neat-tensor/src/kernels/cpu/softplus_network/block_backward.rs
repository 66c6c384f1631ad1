//! One block backwards: up through the adjoint of the reverse sweep, down through
//! the adjoint of the forward pass.

use super::block_encoding::{BlockEncoding, EncodingAdjoint};
use super::block_forward::BlockTape;
use super::{Known, POINT, SoftplusNetwork};
use crate::kernels::cpu::arena::Arena;
use crate::kernels::cpu::block::{self, SweepAdjoint};
use crate::kernels::cpu::gemm::{add_outer_products, multiply};
use crate::kernels::cpu::layers::widest;
use crate::kernels::cpu::weight_gradient::WeightGradient;
use crate::kernels::cpu::{BLOCK_ROWS, padded};

/// One block of a backward pass.
pub(super) struct BlockJob<'a> {
    pub points: &'a [f32],
    pub known: Option<Known<'a>>,
    /// Adjoint of the first output.
    pub first: &'a [f32],
    /// … of the gradient, where it has one.
    pub gradient: Option<&'a [f32]>,
    /// … of the other outputs, where they have one.
    pub others: Option<&'a [f32]>,
    pub tape: Option<&'a mut [f32]>,
    /// Where the adjoint of the points goes.
    pub of_points: Option<&'a mut [f32]>,
    /// Where that of the grid's features goes.
    pub of_grid: Option<&'a mut [f32]>,
}

/// What both ways share.
struct BlockPass<'a> {
    tape: BlockTape<'a>,
    encoding: BlockEncoding<'a>,
    /// A matrix for concatenations.
    joined: &'a mut [f32],
    /// `s_l`, of all layers once the way up is done.
    slopes: Vec<&'a mut [f32]>,
    /// What `z̄_l` gets from the adjoint of the sweep; empty without one.
    through: Vec<&'a mut [f32]>,
}

impl SoftplusNetwork<'_> {
    pub(super) fn block_backward(
        &self,
        job: BlockJob<'_>,
        sum: &mut WeightGradient<'_>,
        arena: &mut Arena<'_>,
    ) {
        let shape = &self.shape;
        let recompute = job.tape.is_none();
        let derivatives = job.gradient.is_some() || job.of_points.is_some();
        let mut pass = BlockPass {
            tape: match job.tape {
                Some(tape) => shape.cut_tape(&mut Arena::new(tape)),
                None => shape.cut_tape(arena),
            },
            encoding: self.encode(job.points, derivatives, arena),
            joined: arena.take(BLOCK_ROWS * widest(&shape.layers)),
            slopes: Vec::new(),
            through: Vec::new(),
        };
        if recompute {
            let BlockPass {
                tape,
                encoding,
                joined,
                ..
            } = &mut pass;
            let slopes = match job.known {
                None => self.activations(tape, encoding.values, joined, true, arena),
                Some(known) => {
                    self.recall(known, &mut tape.h);
                    self.slopes(&tape.h, arena)
                }
            };
            if job.gradient.is_some() {
                self.sweep(tape, &slopes, joined, arena);
            }
            pass.slopes = slopes;
        }
        match job.gradient {
            Some(gradient) => self.upwards(gradient, &mut pass, sum, arena),
            None if pass.slopes.is_empty() => pass.slopes = self.slopes(&pass.tape.h, arena),
            None => {}
        }
        let y = Outputs {
            first: job.first,
            others: job.others,
        };
        let wanted = job.of_points.is_some() || job.of_grid.is_some();
        let to_encoding = self.downwards(y, &mut pass, wanted, sum, arena);
        let adjoint = EncodingAdjoint {
            encoding: to_encoding,
            sweep: pass.tape.g_encoding,
            gradient: job.gradient,
        };
        if let Some(of_grid) = job.of_grid {
            self.to_grid(&adjoint, job.points.len() / POINT, of_grid);
        }
        if let Some(of_points) = job.of_points {
            self.to_points(&pass.encoding, &adjoint, job.points, of_points);
        }
    }

    /// The adjoint of the sweep, from the adjoint of the gradient `[rows, 3]`:
    /// weight gradients, and `through` and `slopes` for the way down.
    fn upwards<'a: 'x, 'x>(
        &self,
        gradient: &[f32],
        pass: &mut BlockPass<'x>,
        sum: &mut WeightGradient<'_>,
        arena: &mut Arena<'a>,
    ) {
        let shape = &self.shape;
        let (arch, hidden) = (self.arch, shape.hidden());
        let BlockPass {
            tape,
            encoding,
            joined,
            slopes,
            through,
        } = pass;
        let of_encoding = padded(shape.encoded());
        // ḡ_E, the adjoint of `g_encoding`.
        let tangent = arena.take(BLOCK_ROWS * of_encoding);
        self.push_forward(encoding, gradient, tangent);
        // p̄_l, then ū_l and ḡ_l.
        let p = arena.take(BLOCK_ROWS * widest(&shape.layers));
        let up = arena.take(BLOCK_ROWS * widest(&shape.layers));
        p[..tangent.len()].copy_from_slice(tangent);
        for l in 0..hidden {
            let layer = shape.layers[l];
            let (inputs, width) = (padded(layer.inputs), padded(layer.outputs));
            let size = BLOCK_ROWS * width;
            if shape.skip == Some(l) && l > 0 {
                // `p` holds ḡ_{l−1}; join it with the encoding's.
                self.join(p, tangent, l, joined);
                p[..BLOCK_ROWS * inputs].copy_from_slice(&joined[..BLOCK_ROWS * inputs]);
            }
            let up = &mut up[..size];
            let weight = &self.packed.forward[l];
            multiply(arch, BLOCK_ROWS, p, inputs, weight, None, up, width);
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
            // The pass has turned `g` into `u` and `up` into ḡ_l.
            let of_weight = sum.weight(l);
            add_outer_products(
                arch,
                BLOCK_ROWS,
                g,
                width,
                layer.outputs,
                p,
                inputs,
                of_weight,
            );
            p[..size].copy_from_slice(up);
        }
        // The sweep starts at the first row of the last weight.
        let width = padded(shape.layers[hidden].inputs);
        let first_row = &mut sum.weight(hidden)[..width];
        block::add_column_sums(arch, &p[..BLOCK_ROWS * width], width, first_row);
    }

    /// The adjoint of the forward pass: weight gradients, and what reaches the
    /// encoding, all of it only where it is wanted.
    fn downwards<'a>(
        &self,
        adjoint_of: Outputs<'_>,
        pass: &mut BlockPass<'_>,
        wanted: bool,
        sum: &mut WeightGradient<'_>,
        arena: &mut Arena<'a>,
    ) -> &'a [f32] {
        let shape = &self.shape;
        let (arch, hidden) = (self.arch, shape.hidden());
        let BlockPass {
            tape,
            encoding,
            joined,
            slopes,
            through,
        } = pass;
        let mut adjoint = arena.take(BLOCK_ROWS * widest(&shape.layers));
        let mut before = arena.take(BLOCK_ROWS * widest(&shape.layers));
        let to_encoding = arena.take(BLOCK_ROWS * padded(shape.encoded()));
        to_encoding.fill(0.0);

        let stride = padded(shape.layers[hidden].inputs);
        let (outputs, weight) = match adjoint_of.others {
            None => (1, &self.first_backward),
            Some(_) => (shape.layers[hidden].outputs, &self.packed.backward[hidden]),
        };
        let width = padded(outputs);
        let y = &mut before[..BLOCK_ROWS * width];
        y.fill(0.0);
        for (y, first) in y.chunks_exact_mut(width).zip(adjoint_of.first) {
            y[0] = *first;
        }
        if let Some(others) = adjoint_of.others {
            let count = self.others();
            for (y, others) in y.chunks_exact_mut(width).zip(others.chunks_exact(count)) {
                y[1..=count].copy_from_slice(others);
            }
        }
        let last = &*tape.h[hidden - 1];
        multiply(arch, BLOCK_ROWS, y, width, weight, None, adjoint, stride);
        let of_weight = sum.weight(hidden);
        add_outer_products(arch, BLOCK_ROWS, y, width, outputs, last, stride, of_weight);
        block::add_column_sums(arch, y, width, sum.bias(hidden));

        for l in (0..hidden).rev() {
            let outputs = shape.layers[l].outputs;
            let width = padded(outputs);
            let z = &mut adjoint[..BLOCK_ROWS * width];
            block::scale_and_add(arch, z, slopes[l], through.get(l).map(|t| &**t));
            block::add_column_sums(arch, z, width, sum.bias(l));
            let (input, stride) = self.input(l, &tape.h, encoding.values, joined);
            let of_weight = sum.weight(l);
            add_outer_products(
                arch, BLOCK_ROWS, z, width, outputs, input, stride, of_weight,
            );
            if l == 0 && !wanted {
                break;
            }
            let weight = &self.packed.backward[l];
            multiply(arch, BLOCK_ROWS, z, width, weight, None, before, stride);
            if l == 0 {
                for (sum, x) in to_encoding.iter_mut().zip(&*before) {
                    *sum += x;
                }
            } else if shape.skip == Some(l) {
                self.part(before, l, adjoint, to_encoding);
            } else {
                std::mem::swap(&mut adjoint, &mut before);
            }
        }
        to_encoding
    }
}

/// Adjoints of a block's outputs.
struct Outputs<'a> {
    first: &'a [f32],
    others: Option<&'a [f32]>,
}
