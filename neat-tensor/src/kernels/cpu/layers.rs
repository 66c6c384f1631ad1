//! The affine layers of a network: their sizes, their packed weights, and the
//! matrices of a block that they fill.

use super::arena::Arena;
use super::gemm::Panels;
use super::{BLOCK_ROWS, padded};
use pulp::Arch;

/// Size of one affine layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerShape {
    /// Width of its input.
    pub inputs: usize,
    /// Width of its output.
    pub outputs: usize,
}

impl LayerShape {
    /// Number of weights and biases.
    pub fn parameters(&self) -> usize {
        (self.inputs + 1) * self.outputs
    }
}

/// Layers with their weights packed for products in both directions.
#[derive(Debug)]
pub(super) struct PackedLayers {
    /// `W_lᵀ` as right operand: `z = a Wᵀ`.
    pub forward: Vec<Panels>,
    /// `W_l` as right operand: `p = u W`.
    pub backward: Vec<Panels>,
    /// `[padded(outputs)]` each.
    pub biases: Vec<Vec<f32>>,
}

impl PackedLayers {
    /// Packs `parameters`: of each layer the weight `[outputs, inputs]`, row-major,
    /// then the bias.
    ///
    /// # Panics
    /// If they do not fit the layers.
    pub fn new(arch: Arch, layers: &[LayerShape], parameters: &[f32]) -> Self {
        let wanted: usize = layers.iter().map(LayerShape::parameters).sum();
        assert_eq!(parameters.len(), wanted, "parameters do not fit the layers");
        let mut packed = Self {
            forward: Vec::new(),
            backward: Vec::new(),
            biases: Vec::new(),
        };
        let mut rest = parameters;
        for &LayerShape { inputs, outputs } in layers {
            let (weight, tail) = rest.split_at(inputs * outputs);
            let (bias, tail) = tail.split_at(outputs);
            rest = tail;
            packed
                .forward
                .push(Panels::new(arch, inputs, outputs, |k, c| {
                    weight[c * inputs + k]
                }));
            packed
                .backward
                .push(Panels::new(arch, outputs, inputs, |k, c| {
                    weight[k * inputs + c]
                }));
            let mut padded_bias = bias.to_vec();
            padded_bias.resize(padded(outputs), 0.0);
            packed.biases.push(padded_bias);
        }
        packed
    }
}

/// Padded width of the widest input or output.
pub(super) fn widest(layers: &[LayerShape]) -> usize {
    let widths = layers.iter().flat_map(|l| [l.inputs, l.outputs]);
    padded(widths.max().unwrap_or(0))
}

/// Numbers of one matrix per layer, as wide as its output, for a block.
pub(super) fn block_size(layers: &[LayerShape]) -> usize {
    BLOCK_ROWS * layers.iter().map(|l| padded(l.outputs)).sum::<usize>()
}

/// Those matrices, from `arena`.
pub(super) fn cut_block<'a>(layers: &[LayerShape], arena: &mut Arena<'a>) -> Vec<&'a mut [f32]> {
    layers
        .iter()
        .map(|l| arena.take(BLOCK_ROWS * padded(l.outputs)))
        .collect()
}

/// The part of each of `blocks` blocks of a list, where there is one.
pub(super) fn per_block(
    list: Option<&mut [f32]>,
    of_block: usize,
    blocks: usize,
) -> Vec<Option<&mut [f32]>> {
    match list {
        Some(list) => list.chunks_mut(of_block).map(Some).collect(),
        None => (0..blocks).map(|_| None).collect(),
    }
}
