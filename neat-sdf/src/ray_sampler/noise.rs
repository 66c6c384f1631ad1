//! The random decisions of samplers, replaceable by fixed ones.

use rand::{Rng, RngExt};

/// Where a sampler gets its random decisions from.
pub trait SamplingNoise {
    /// `count` uniform numbers in [0, 1), or `None` for evenly spaced positions.
    fn uniform(&mut self, count: usize) -> Option<Vec<f32>>;

    /// `wanted` different column indices out of `available`, in any order.
    fn columns(&mut self, available: usize, wanted: usize) -> Vec<usize>;
}

/// No randomness: evenly spaced positions and columns, as in evaluation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Deterministic;

impl SamplingNoise for Deterministic {
    fn uniform(&mut self, _count: usize) -> Option<Vec<f32>> {
        None
    }

    fn columns(&mut self, available: usize, wanted: usize) -> Vec<usize> {
        let step = (available - 1) as f64 / (wanted.max(2) - 1) as f64;
        (0..wanted).map(|i| (i as f64 * step) as usize).collect()
    }
}

/// Random decisions from a seeded stream.
#[derive(Clone, Debug)]
pub struct Seeded<R>(pub R);

impl<R: Rng> SamplingNoise for Seeded<R> {
    fn uniform(&mut self, count: usize) -> Option<Vec<f32>> {
        Some((0..count).map(|_| self.0.random::<f32>()).collect())
    }

    fn columns(&mut self, available: usize, wanted: usize) -> Vec<usize> {
        // The head of a Fisher-Yates shuffle.
        let mut all: Vec<usize> = (0..available).collect();
        let wanted = wanted.min(available);
        for i in 0..wanted {
            let j = self.0.random_range(i..available);
            all.swap(i, j);
        }
        all.truncate(wanted);
        all
    }
}
