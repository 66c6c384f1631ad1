//! ReLU perceptrons over inputs that are put together, and partly encoded, block
//! by block: radiance and attraction.

use super::arena::{Arena, Pooled, with_arena};
use super::block;
use super::gemm::{add_outer_products, multiply};
use super::layers::{LayerShape, PackedLayers, block_size, cut_block, per_block, widest};
use super::weight_gradient::{WeightGradient, sum_over_blocks};
use super::{BLOCK_ROWS, padded};
use pulp::Arch;
use rayon::prelude::*;

/// Shape of a perceptron and of the parts of its input.
#[derive(Clone, Debug, PartialEq)]
pub struct ReluShape {
    /// Inputs and outputs of each layer, first to last.
    pub layers: Vec<LayerShape>,
    /// Columns of each source of the input.
    pub sources: Vec<usize>,
    /// Parts of the input, side by side.
    pub parts: Vec<PartShape>,
}

/// One part of the input: some columns of a source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartShape {
    /// Index of the source.
    pub source: usize,
    /// Its first column.
    pub column: usize,
    /// Columns before encoding.
    pub width: usize,
    /// Frequencies of its positional encoding; 0 takes it as it is.
    pub octaves: usize,
}

impl PartShape {
    fn encoded(&self) -> usize {
        self.width * (1 + 2 * self.octaves)
    }
}

/// A perceptron with its weights packed.
#[derive(Debug)]
pub struct ReluNetwork {
    shape: ReluShape,
    arch: Arch,
    packed: PackedLayers,
}

/// Activations of a forward pass, block after block.
#[derive(Debug)]
pub struct Tape(Pooled);

impl ReluShape {
    fn hidden(&self) -> usize {
        self.layers.len() - 1
    }

    /// Columns of the output.
    pub fn outputs(&self) -> usize {
        self.layers[self.hidden()].outputs
    }

    fn block_tape(&self) -> usize {
        block_size(&self.layers[..self.hidden()])
    }

    fn scratch(&self) -> usize {
        BLOCK_ROWS * 5 * widest(&self.layers) + self.block_tape()
    }

    /// Bytes that the tape of `rows` rows takes.
    pub fn tape_bytes(&self, rows: usize) -> usize {
        rows.div_ceil(BLOCK_ROWS) * self.block_tape() * size_of::<f32>()
    }

    fn cut_tape<'a>(&self, arena: &mut Arena<'a>) -> Vec<&'a mut [f32]> {
        cut_block(&self.layers[..self.hidden()], arena)
    }
}

/// The rows of one block.
struct BlockJob<'a> {
    first_row: usize,
    rows: usize,
    tape: Option<&'a mut [f32]>,
    /// Where the adjoints of the sources go.
    of_sources: Vec<Option<&'a mut [f32]>>,
}

impl ReluNetwork {
    /// Packs `parameters`: of each layer the weight `[outputs, inputs]`, row-major,
    /// then the bias.
    ///
    /// # Panics
    /// If they do not fit the shape.
    pub fn new(arch: Arch, shape: &ReluShape, parameters: &[f32]) -> Self {
        assert_eq!(
            shape.layers[0].inputs,
            shape.parts.iter().map(PartShape::encoded).sum::<usize>(),
            "ReluNetwork::new: parts do not fit the first layer"
        );
        Self {
            packed: PackedLayers::new(arch, &shape.layers, parameters),
            shape: shape.clone(),
            arch,
        }
    }

    /// Outputs `[N, outputs]` for `sources`, `[N, columns]` each; with a tape for
    /// [`Self::backward`] where `keep`.
    pub fn forward(&self, rows: usize, sources: &[&[f32]], keep: bool) -> (Vec<f32>, Option<Tape>) {
        let width = self.shape.outputs();
        let blocks = rows.div_ceil(BLOCK_ROWS);
        let of_block = self.shape.block_tape();
        let mut out = vec![0.0; rows * width];
        let mut tape = Pooled::take(if keep { blocks * of_block } else { 0 });
        let kept = keep.then(|| tape.as_mut_slice());
        let mut tapes = per_block(kept, of_block, blocks);
        out.par_chunks_mut(BLOCK_ROWS * width)
            .zip(tapes.par_iter_mut())
            .enumerate()
            .for_each(|(block, (out, tape))| {
                with_arena(self.shape.scratch(), |arena| {
                    let mut h = match tape {
                        Some(tape) => self.shape.cut_tape(&mut Arena::new(tape)),
                        None => self.shape.cut_tape(arena),
                    };
                    let rows = out.len() / width;
                    let input = arena.take(BLOCK_ROWS * widest(&self.shape.layers));
                    self.gather(block * BLOCK_ROWS, rows, sources, input, arena);
                    self.activations(input, &mut h);
                    let last = h.last().map_or(&*input, |h| &**h);
                    let l = self.shape.hidden();
                    let (stride, columns) = (self.stride(l), padded(width));
                    let y = arena.take(BLOCK_ROWS * columns);
                    let (weight, bias) =
                        (&self.packed.forward[l], Some(&self.packed.biases[l][..]));
                    multiply(
                        self.arch, BLOCK_ROWS, last, stride, weight, bias, y, columns,
                    );
                    for (out, y) in out.chunks_exact_mut(width).zip(y.chunks_exact(columns)) {
                        out.copy_from_slice(&y[..width]);
                    }
                });
            });
        drop(tapes);
        (out, keep.then_some(Tape(tape)))
    }

    /// Row stride of the input of layer `l`.
    fn stride(&self, l: usize) -> usize {
        padded(self.shape.layers[l].inputs)
    }

    /// The input of a block, put together; rows beyond `rows` are zero.
    fn gather(
        &self,
        first_row: usize,
        rows: usize,
        sources: &[&[f32]],
        input: &mut [f32],
        arena: &mut Arena<'_>,
    ) {
        let stride = self.stride(0);
        let input = &mut input[..BLOCK_ROWS * stride];
        for row in input.chunks_exact_mut(stride).skip(rows) {
            row.fill(0.0);
        }
        let dense = arena.take(BLOCK_ROWS * widest(&self.shape.layers));
        let mut column = 0;
        for part in &self.shape.parts {
            let (width, octaves) = (part.width, part.octaves);
            let columns = self.shape.sources[part.source];
            let source = &sources[part.source][first_row * columns..][..rows * columns];
            let x = &mut dense[..rows * width];
            block::copy_columns(source, columns, part.column, width, x);
            block::encode(self.arch, rows, x, width, octaves, input, stride, column);
            column += part.encoded();
        }
        for row in input.chunks_exact_mut(stride) {
            row[column..].fill(0.0);
        }
    }

    fn activations(&self, input: &[f32], h: &mut [&mut [f32]]) {
        for l in 0..self.shape.hidden() {
            let (done, next) = h.split_at_mut(l);
            let input = done.last().map_or(input, |h| &**h);
            let columns = padded(self.shape.layers[l].outputs);
            let (weight, bias) = (&self.packed.forward[l], Some(&self.packed.biases[l][..]));
            let (z, stride) = (&mut *next[0], self.stride(l));
            multiply(
                self.arch, BLOCK_ROWS, input, stride, weight, bias, z, columns,
            );
            block::relu(self.arch, z);
        }
    }

    /// The gradient of `Σ output · adjoint` with respect to the parameters, in the
    /// order of [`Self::new`], and to those sources that `to_sources` names,
    /// `[N, columns]` each.
    pub fn backward(
        &self,
        rows: usize,
        sources: &[&[f32]],
        adjoint: &[f32],
        tape: Option<Tape>,
        to_sources: &[bool],
    ) -> (Vec<f32>, Vec<Option<Vec<f32>>>) {
        let mut tape = tape.map(|Tape(tape)| tape);
        let mut tapes = tape
            .as_mut()
            .map(|tape| tape.as_mut_slice().chunks_mut(self.shape.block_tape()));
        let mut of_sources: Vec<Option<Vec<f32>>> = to_sources
            .iter()
            .zip(&self.shape.sources)
            .map(|(wanted, columns)| wanted.then(|| vec![0.0; rows * columns]))
            .collect();
        let mut source_blocks: Vec<_> = of_sources
            .iter_mut()
            .zip(&self.shape.sources)
            .map(|(of_source, columns)| {
                of_source
                    .as_mut()
                    .map(|of_source| of_source.chunks_mut(BLOCK_ROWS * columns))
            })
            .collect();
        let jobs: Vec<BlockJob<'_>> = (0..rows)
            .step_by(BLOCK_ROWS)
            .map(|first_row| BlockJob {
                first_row,
                rows: BLOCK_ROWS.min(rows - first_row),
                tape: tapes.as_mut().and_then(Iterator::next),
                of_sources: source_blocks
                    .iter_mut()
                    .map(|blocks| blocks.as_mut().and_then(Iterator::next))
                    .collect(),
            })
            .collect();
        let sum = sum_over_blocks(&self.shape.layers, jobs, |job, sum| {
            with_arena(self.shape.scratch(), |arena| {
                self.block_backward(job, sources, adjoint, sum, arena);
            });
        });
        drop(source_blocks);
        (sum, of_sources)
    }

    fn block_backward(
        &self,
        job: BlockJob<'_>,
        sources: &[&[f32]],
        adjoint: &[f32],
        sum: &mut WeightGradient<'_>,
        arena: &mut Arena<'_>,
    ) {
        let (arch, shape) = (self.arch, &self.shape);
        let input = arena.take(BLOCK_ROWS * widest(&shape.layers));
        self.gather(job.first_row, job.rows, sources, input, arena);
        let h = match job.tape {
            Some(tape) => shape.cut_tape(&mut Arena::new(tape)),
            None => {
                let mut h = shape.cut_tape(arena);
                self.activations(input, &mut h);
                h
            }
        };
        let mut z = arena.take(BLOCK_ROWS * widest(&shape.layers));
        let mut before = arena.take(BLOCK_ROWS * widest(&shape.layers));
        let width = shape.outputs();
        let columns = padded(width);
        let y = &mut z[..BLOCK_ROWS * columns];
        y.fill(0.0);
        let adjoint = &adjoint[job.first_row * width..][..job.rows * width];
        for (y, adjoint) in y.chunks_exact_mut(columns).zip(adjoint.chunks_exact(width)) {
            y[..width].copy_from_slice(adjoint);
        }
        let to_input = job.of_sources.iter().any(Option::is_some);
        for l in (0..shape.layers.len()).rev() {
            let outputs = shape.layers[l].outputs;
            let (columns, stride) = (padded(outputs), self.stride(l));
            let zl = &mut z[..BLOCK_ROWS * columns];
            if l < shape.hidden() {
                block::relu_adjoint(arch, zl, h[l]);
            }
            let input = if l == 0 { &*input } else { &*h[l - 1] };
            add_outer_products(
                arch,
                BLOCK_ROWS,
                zl,
                columns,
                outputs,
                input,
                stride,
                sum.weight(l),
            );
            block::add_column_sums(arch, zl, columns, sum.bias(l));
            if l > 0 || to_input {
                let weight = &self.packed.backward[l];
                multiply(arch, BLOCK_ROWS, zl, columns, weight, None, before, stride);
                std::mem::swap(&mut z, &mut before);
            }
        }
        let stride = self.stride(0);
        let mut of_sources = job.of_sources;
        let mut column = 0;
        for part in &shape.parts {
            let encoded = column..column + part.encoded();
            column = encoded.end;
            let Some(of_source) = &mut of_sources[part.source] else {
                continue;
            };
            for ((out, input), z) in of_source
                .chunks_exact_mut(shape.sources[part.source])
                .zip(input.chunks_exact(stride))
                .zip(z.chunks_exact(stride))
            {
                let out = &mut out[part.column..][..part.width];
                let (input, z) = (&input[encoded.clone()], &z[encoded.clone()]);
                block::add_pull_back(input, z, part.width, part.octaves, out);
            }
        }
    }
}
