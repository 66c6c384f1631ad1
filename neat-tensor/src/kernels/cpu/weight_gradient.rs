//! Gradients of weights, summed over blocks in an order that no thread decides.

use super::arena::Pooled;
use super::layers::LayerShape;
use super::padded;
use rayon::prelude::*;

impl LayerShape {
    /// Numbers of this layer's gradient with padded rows.
    fn padded_parameters(&self) -> usize {
        self.outputs * padded(self.inputs) + padded(self.outputs)
    }
}

/// The gradient of all layers that some blocks contribute to.
pub(super) struct WeightGradient<'a> {
    layers: &'a [LayerShape],
    sum: Pooled,
}

impl WeightGradient<'_> {
    fn start(&self, layer: usize) -> usize {
        self.layers[..layer]
            .iter()
            .map(LayerShape::padded_parameters)
            .sum()
    }

    /// `[outputs, padded(inputs)]`.
    pub fn weight(&mut self, layer: usize) -> &mut [f32] {
        let start = self.start(layer);
        let LayerShape { inputs, outputs } = self.layers[layer];
        &mut self.sum.as_mut_slice()[start..][..outputs * padded(inputs)]
    }

    /// `[padded(outputs)]`.
    pub fn bias(&mut self, layer: usize) -> &mut [f32] {
        let LayerShape { inputs, outputs } = self.layers[layer];
        let start = self.start(layer) + outputs * padded(inputs);
        &mut self.sum.as_mut_slice()[start..][..padded(outputs)]
    }
}

/// Most partial sums, and so most threads that work at once.
const MAX_GROUPS: usize = 64;
/// Rows of weights whose partial sums one task adds.
const ROWS_PER_TASK: usize = 64;
/// Fewest blocks that share a partial sum, where there are enough.
const BLOCKS_PER_GROUP: usize = 4;

/// Runs `add` for every job, in parallel, and sums what they contribute: of each
/// layer the weight `[outputs, inputs]` and the bias.
///
/// Jobs are dealt to groups by their number, each group adds up in order, and the
/// groups' sums are added in order: the result does not depend on the threads.
pub(super) fn sum_over_blocks<J: Send>(
    layers: &[LayerShape],
    jobs: Vec<J>,
    add: impl Fn(J, &mut WeightGradient<'_>) + Sync,
) -> Vec<f32> {
    let groups = (jobs.len() / BLOCKS_PER_GROUP).clamp(1, MAX_GROUPS);
    let mut dealt: Vec<Vec<J>> = (0..groups).map(|_| Vec::new()).collect();
    for (i, job) in jobs.into_iter().enumerate() {
        dealt[i % groups].push(job);
    }
    let size = layers.iter().map(LayerShape::padded_parameters).sum();
    let partial: Vec<Pooled> = dealt
        .into_par_iter()
        .with_max_len(1)
        .map(|jobs| {
            let mut sum = WeightGradient {
                layers,
                sum: Pooled::zeros(size),
            };
            for job in jobs {
                add(job, &mut sum);
            }
            sum.sum
        })
        .collect();

    let mut total = vec![0.0; layers.iter().map(LayerShape::parameters).sum()];
    // Rows of the result, with where they begin in each padded sum.
    let mut rows: Vec<(&mut [f32], usize)> = Vec::new();
    let (mut rest, mut start) = (&mut total[..], 0);
    for layer in layers {
        let stride = padded(layer.inputs);
        let (weight, tail) = rest.split_at_mut(layer.inputs * layer.outputs);
        let (bias, tail) = tail.split_at_mut(layer.outputs);
        let weight_rows = weight.chunks_mut(layer.inputs).enumerate();
        rows.extend(weight_rows.map(|(r, row)| (row, start + r * stride)));
        rows.push((bias, start + layer.outputs * stride));
        start += layer.padded_parameters();
        rest = tail;
    }
    rows.into_par_iter()
        .with_min_len(ROWS_PER_TASK)
        .for_each(|(row, start)| {
            for partial in &partial {
                for (sum, x) in row.iter_mut().zip(&partial.as_slice()[start..]) {
                    *sum += x;
                }
            }
        });
    total
}
