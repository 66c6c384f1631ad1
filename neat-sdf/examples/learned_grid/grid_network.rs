//! A softplus perceptron over `[point, grid features]`: distance, its gradient and
//! features, and the backward pass of all three.
//!
//! The perceptron is that of `neat_tensor::kernels::softplus_network`, with the
//! same products, passes and blocks; only its encoding is another.

use super::field::{Adjoint, Field, Output};
use super::grid::Grid;
use neat_tensor::kernels::arena::Pooled;
use neat_tensor::kernels::block::{self, SweepAdjoint};
use neat_tensor::kernels::gemm::{Panels, add_outer_products, multiply};
use neat_tensor::kernels::layers::LayerShape;
use neat_tensor::kernels::{Arch, BLOCK_ROWS, PADDING, padded};

const POINT: usize = 3;

/// Sharpness of the softplus, as in the present network.
pub const SHARPNESS: f32 = 100.0;

/// Grids and perceptron. Parameters are those of the layers, each its weight
/// `[outputs, inputs]` and its bias, then the table.
pub struct GridNetwork<const F: usize> {
    grid: Grid<F>,
    layers: Vec<LayerShape>,
    arch: Arch,
    tape: Vec<BlockTape>,
    scratch: [Pooled; 4],
    /// Gradients of the layers, rows padded: weight and bias of each.
    of_layers: Vec<[Pooled; 2]>,
}

/// Matrices of one block that the backward pass reads.
struct BlockTape {
    /// `[point, features]`.
    input: Pooled,
    /// `[rows, 3, width of the grid]`.
    jacobian: Pooled,
    /// Values of the activations, per hidden layer.
    h: Vec<Pooled>,
    slopes: Vec<Pooled>,
    /// Derivative of the distance with respect to each layer's input.
    sweep: Vec<Pooled>,
    /// What the adjoint of the sweep adds to that of the pre-activations.
    through: Vec<Pooled>,
}

/// The layers, ready for products.
struct Packed {
    forward: Vec<Panels>,
    backward: Vec<Panels>,
    biases: Vec<Vec<f32>>,
    /// The distance's row of the last weight.
    first_row: Vec<f32>,
    first_column: Panels,
}

impl<const F: usize> GridNetwork<F> {
    /// A network with `hidden` layers of `width` and `outputs` outputs.
    pub fn new(grid: Grid<F>, hidden: usize, width: usize, outputs: usize) -> Self {
        let mut inputs = POINT + grid.width();
        let mut layers = Vec::new();
        for _ in 0..hidden {
            layers.push(LayerShape {
                inputs,
                outputs: width,
            });
            inputs = width;
        }
        layers.push(LayerShape { inputs, outputs });
        let widest = layers.iter().flat_map(|l| [l.inputs, l.outputs]).max();
        let of_block = BLOCK_ROWS * padded(widest.unwrap_or(0));
        Self {
            grid,
            arch: Arch::new(),
            tape: Vec::new(),
            scratch: std::array::from_fn(|_| Pooled::zeros(of_block)),
            of_layers: layers
                .iter()
                .map(|l| {
                    let weight = Pooled::zeros(l.outputs * padded(l.inputs));
                    [weight, Pooled::zeros(padded(l.outputs))]
                })
                .collect(),
            layers,
        }
    }

    fn hidden(&self) -> usize {
        self.layers.len() - 1
    }

    fn table_start(&self) -> usize {
        self.layers.iter().map(LayerShape::parameters).sum()
    }

    fn pack(&self, parameters: &[f32]) -> Packed {
        let arch = self.arch;
        let mut rest = parameters;
        let (mut forward, mut backward, mut biases) = (Vec::new(), Vec::new(), Vec::new());
        let mut last = &parameters[..0];
        for &LayerShape { inputs, outputs } in &self.layers {
            let (weight, tail) = rest.split_at(inputs * outputs);
            let (bias, tail) = tail.split_at(outputs);
            (rest, last) = (tail, &weight[..inputs]);
            forward.push(Panels::new(arch, inputs, outputs, |k, c| {
                weight[c * inputs + k]
            }));
            backward.push(Panels::new(arch, outputs, inputs, |k, c| {
                weight[k * inputs + c]
            }));
            let mut bias = bias.to_vec();
            bias.resize(padded(outputs), 0.0);
            biases.push(bias);
        }
        let mut first_row = last.to_vec();
        first_row.resize(padded(last.len()), 0.0);
        Packed {
            forward,
            backward,
            biases,
            first_row,
            first_column: Panels::new(arch, last.len(), 1, |k, _| last[k]),
        }
    }

    fn new_tape(&self) -> BlockTape {
        let hidden = &self.layers[..self.hidden()];
        let outputs = || {
            let wide = |l: &LayerShape| Pooled::zeros(BLOCK_ROWS * padded(l.outputs));
            hidden.iter().map(wide).collect()
        };
        let inputs = |l: &LayerShape| Pooled::zeros(BLOCK_ROWS * padded(l.inputs));
        BlockTape {
            input: inputs(&self.layers[0]),
            jacobian: Pooled::zeros(BLOCK_ROWS * POINT * self.grid.width()),
            h: outputs(),
            slopes: outputs(),
            sweep: hidden.iter().map(inputs).collect(),
            through: outputs(),
        }
    }

    /// Fills `input`, `h` and, where the gradient is wanted, `jacobian` and
    /// `slopes` of a tape.
    fn activations(
        &self,
        points: &[f32],
        table: &[f32],
        packed: &Packed,
        gradient: bool,
        tape: &mut BlockTape,
    ) {
        let stride = padded(self.layers[0].inputs);
        let input = tape.input.as_mut_slice();
        for (row, point) in input
            .chunks_exact_mut(stride)
            .zip(points.chunks_exact(POINT))
        {
            row[..POINT].copy_from_slice(point);
        }
        let jacobian = gradient.then(|| tape.jacobian.as_mut_slice());
        self.grid
            .encode(self.arch, points, table, input, stride, POINT, jacobian);
        for l in 0..self.hidden() {
            let (before, rest) = tape.h.split_at_mut(l);
            let from = before
                .last()
                .map_or(tape.input.as_slice(), Pooled::as_slice);
            let LayerShape { inputs, outputs } = self.layers[l];
            let z = rest[0].as_mut_slice();
            multiply(
                self.arch,
                BLOCK_ROWS,
                from,
                padded(inputs),
                &packed.forward[l],
                Some(&packed.biases[l]),
                z,
                padded(outputs),
            );
            let slope = gradient.then(|| tape.slopes[l].as_mut_slice());
            block::softplus(self.arch, z, SHARPNESS, slope);
        }
    }

    /// Fills `sweep` of a tape and writes the gradient `[rows, 3]`.
    fn sweep(&mut self, packed: &Packed, tape: &mut BlockTape, gradient: &mut [[f32; 3]]) {
        let hidden = self.hidden();
        for l in (0..hidden).rev() {
            let LayerShape { inputs, outputs } = self.layers[l];
            let width = padded(outputs);
            let u = &mut self.scratch[0].as_mut_slice()[..BLOCK_ROWS * width];
            let slopes = tape.slopes[l].as_slice();
            match tape.sweep.get(l + 1) {
                None => block::scale_rows(self.arch, slopes, &packed.first_row, u),
                Some(sweep) => block::product(self.arch, sweep.as_slice(), slopes, u),
            }
            let out = tape.sweep[l].as_mut_slice();
            let weight = &packed.backward[l];
            multiply(
                self.arch,
                BLOCK_ROWS,
                u,
                width,
                weight,
                None,
                out,
                padded(inputs),
            );
        }
        let (stride, width) = (padded(self.layers[0].inputs), self.grid.width());
        for ((out, sweep), jacobian) in gradient
            .iter_mut()
            .zip(tape.sweep[0].as_slice().chunks_exact(stride))
            .zip(tape.jacobian.as_slice().chunks_exact(POINT * width))
        {
            let features = &sweep[POINT..POINT + width];
            for (axis, out) in out.iter_mut().enumerate() {
                let row = &jacobian[axis * width..][..width];
                let sum: f32 = row.iter().zip(features).map(|(j, s)| j * s).sum();
                *out = sweep[axis] + sum;
            }
        }
    }

    /// The adjoint of the sweep, from that of the gradient.
    fn upwards(&mut self, packed: &Packed, tangents: &[f32], tape: &mut BlockTape) {
        let hidden = self.hidden();
        let (stride, width) = (padded(self.layers[0].inputs), self.grid.width());
        let [p, up, g, _] = &mut self.scratch;
        let (p, up, g) = (p.as_mut_slice(), up.as_mut_slice(), g.as_mut_slice());
        p[..BLOCK_ROWS * stride].fill(0.0);
        for ((row, tangent), jacobian) in p
            .chunks_exact_mut(stride)
            .zip(tangents.chunks_exact(POINT))
            .zip(tape.jacobian.as_slice().chunks_exact(POINT * width))
        {
            row[..POINT].copy_from_slice(tangent);
            let features = &mut row[POINT..POINT + width];
            for (axis, t) in tangent.iter().enumerate() {
                for (out, j) in features.iter_mut().zip(&jacobian[axis * width..][..width]) {
                    *out += t * j;
                }
            }
        }
        for l in 0..hidden {
            let LayerShape { inputs, outputs } = self.layers[l];
            let (inputs, width) = (padded(inputs), padded(outputs));
            let size = BLOCK_ROWS * width;
            let (up, g) = (&mut up[..size], &mut g[..size]);
            let weight = &packed.forward[l];
            multiply(self.arch, BLOCK_ROWS, p, inputs, weight, None, up, width);
            match tape.sweep.get(l + 1) {
                None => g
                    .chunks_exact_mut(width)
                    .for_each(|row| row.copy_from_slice(&packed.first_row)),
                Some(sweep) => g.copy_from_slice(sweep.as_slice()),
            }
            SweepAdjoint {
                h: tape.h[l].as_slice(),
                g,
                up,
                slope: tape.slopes[l].as_mut_slice(),
                through_slope: tape.through[l].as_mut_slice(),
                sharpness: SHARPNESS,
            }
            .run(self.arch);
            let of_weight = self.of_layers[l][0].as_mut_slice();
            add_outer_products(
                self.arch, BLOCK_ROWS, g, width, outputs, p, inputs, of_weight,
            );
            p[..size].copy_from_slice(up);
        }
        let width = padded(self.layers[hidden].inputs);
        let first_row = &mut self.of_layers[hidden][0].as_mut_slice()[..width];
        block::add_column_sums(self.arch, &p[..BLOCK_ROWS * width], width, first_row);
    }

    /// The adjoint of the forward pass; leaves that of the input in `scratch[0]`.
    fn downwards(&mut self, packed: &Packed, first: &[f32], others: &[f32], tape: &BlockTape) {
        let hidden = self.hidden();
        let arch = self.arch;
        let [to_input, adjoint, before, y] = &mut self.scratch;
        let (mut adjoint, mut before) = (adjoint.as_mut_slice(), before.as_mut_slice());
        let LayerShape { inputs, outputs } = self.layers[hidden];
        let (count, width, stride) = (outputs - 1, padded(outputs), padded(inputs));
        let y = &mut y.as_mut_slice()[..BLOCK_ROWS * width];
        y.fill(0.0);
        for ((y, first), others) in y
            .chunks_exact_mut(width)
            .zip(first)
            .zip(others.chunks_exact(count))
        {
            y[0] = *first;
            y[1..outputs].copy_from_slice(others);
        }
        let [of_weight, of_bias] = &mut self.of_layers[hidden];
        let (of_weight, of_bias) = (of_weight.as_mut_slice(), of_bias.as_mut_slice());
        let weight = &packed.backward[hidden];
        multiply(arch, BLOCK_ROWS, y, width, weight, None, adjoint, stride);
        let last = tape.h[hidden - 1].as_slice();
        add_outer_products(arch, BLOCK_ROWS, y, width, outputs, last, stride, of_weight);
        block::add_column_sums(arch, y, width, of_bias);
        for l in (0..hidden).rev() {
            let LayerShape { inputs, outputs } = self.layers[l];
            let (stride, width) = (padded(inputs), padded(outputs));
            let z = &mut adjoint[..BLOCK_ROWS * width];
            let through = Some(tape.through[l].as_slice());
            block::scale_and_add(arch, z, tape.slopes[l].as_slice(), through);
            let [of_weight, of_bias] = &mut self.of_layers[l];
            let (of_weight, of_bias) = (of_weight.as_mut_slice(), of_bias.as_mut_slice());
            block::add_column_sums(arch, z, width, of_bias);
            let input = match l {
                0 => tape.input.as_slice(),
                _ => tape.h[l - 1].as_slice(),
            };
            add_outer_products(
                arch, BLOCK_ROWS, z, width, outputs, input, stride, of_weight,
            );
            let weight = &packed.backward[l];
            multiply(arch, BLOCK_ROWS, z, width, weight, None, before, stride);
            std::mem::swap(&mut adjoint, &mut before);
        }
        let size = BLOCK_ROWS * padded(self.layers[0].inputs);
        to_input.as_mut_slice()[..size].copy_from_slice(&adjoint[..size]);
    }
}

impl<const F: usize> Field for GridNetwork<F> {
    fn parameters(&self) -> usize {
        self.table_start() + self.grid.parameters()
    }

    fn table(&self) -> std::ops::Range<usize> {
        self.table_start()..self.parameters()
    }

    fn layers(&self) -> &[LayerShape] {
        &self.layers
    }

    fn distances(&mut self, parameters: &[f32], points: &[f32]) -> Vec<f32> {
        let packed = self.pack(parameters);
        let table = &parameters[self.table_start()..];
        let hidden = self.hidden();
        let stride = padded(self.layers[hidden].inputs);
        let mut tape = self.new_tape();
        let mut first = Vec::with_capacity(points.len() / POINT);
        for points in points.chunks(BLOCK_ROWS * POINT) {
            self.activations(points, table, &packed, false, &mut tape);
            let y = &mut self.scratch[0].as_mut_slice()[..BLOCK_ROWS * PADDING];
            multiply(
                self.arch,
                BLOCK_ROWS,
                tape.h[hidden - 1].as_slice(),
                stride,
                &packed.first_column,
                Some(&packed.biases[hidden][..PADDING]),
                y,
                PADDING,
            );
            let rows = points.len() / POINT;
            first.extend(y.chunks_exact(PADDING).take(rows).map(|row| row[0]));
        }
        first
    }

    fn forward(&mut self, parameters: &[f32], points: &[f32]) -> Output {
        let packed = self.pack(parameters);
        let table = &parameters[self.table_start()..];
        let hidden = self.hidden();
        let LayerShape { inputs, outputs } = self.layers[hidden];
        let (stride, width, rows) = (padded(inputs), padded(outputs), points.len() / POINT);
        let mut output = Output {
            first: Vec::with_capacity(rows),
            gradient: vec![[0.0; 3]; rows],
            others: Vec::with_capacity(rows * (outputs - 1)),
        };
        let blocks = rows.div_ceil(BLOCK_ROWS);
        let mut tapes = std::mem::take(&mut self.tape);
        tapes.resize_with(blocks, || self.new_tape());
        for ((points, tape), gradient) in points
            .chunks(BLOCK_ROWS * POINT)
            .zip(&mut tapes)
            .zip(output.gradient.chunks_mut(BLOCK_ROWS))
        {
            self.activations(points, table, &packed, true, tape);
            let y = &mut self.scratch[0].as_mut_slice()[..BLOCK_ROWS * width];
            let last = tape.h[hidden - 1].as_slice();
            let (weight, bias) = (&packed.forward[hidden], Some(&packed.biases[hidden][..]));
            multiply(self.arch, BLOCK_ROWS, last, stride, weight, bias, y, width);
            for row in y.chunks_exact(width).take(gradient.len()) {
                output.first.push(row[0]);
                output.others.extend_from_slice(&row[1..outputs]);
            }
            self.sweep(&packed, tape, gradient);
        }
        self.tape = tapes;
        output
    }

    fn backward(
        &mut self,
        parameters: &[f32],
        points: &[f32],
        adjoint: &Adjoint,
        gradient: &mut [f32],
    ) {
        let packed = self.pack(parameters);
        for part in self.of_layers.as_flattened_mut() {
            part.as_mut_slice().fill(0.0);
        }
        let start = self.table_start();
        let (of_layers, of_table) = gradient.split_at_mut(start);
        let others = self.layers[self.hidden()].outputs - 1;
        let stride = padded(self.layers[0].inputs);
        let mut tapes = std::mem::take(&mut self.tape);
        for (block, (points, tape)) in points
            .chunks(BLOCK_ROWS * POINT)
            .zip(&mut tapes)
            .enumerate()
        {
            let rows = block * BLOCK_ROWS..block * BLOCK_ROWS + points.len() / POINT;
            let tangents = adjoint.gradient[rows.clone()].as_flattened();
            self.upwards(&packed, tangents, tape);
            let of_others = &adjoint.others[rows.start * others..rows.end * others];
            self.downwards(&packed, &adjoint.first[rows], of_others, tape);
            self.grid.scatter(
                self.arch,
                points,
                tangents,
                self.scratch[0].as_slice(),
                tape.sweep[0].as_slice(),
                stride,
                POINT,
                of_table,
            );
        }
        self.tape = tapes;
        // Without the padding.
        let mut rest = of_layers;
        for (LayerShape { inputs, outputs }, [weight, bias]) in
            self.layers.iter().zip(&self.of_layers)
        {
            let (to_weight, tail) = rest.split_at_mut(inputs * outputs);
            let (to_bias, tail) = tail.split_at_mut(*outputs);
            let rows = weight.as_slice().chunks_exact(padded(*inputs));
            for (to, from) in to_weight.chunks_exact_mut(*inputs).zip(rows) {
                to.copy_from_slice(&from[..*inputs]);
            }
            to_bias.copy_from_slice(&bias.as_slice()[..*outputs]);
            rest = tail;
        }
    }
}
