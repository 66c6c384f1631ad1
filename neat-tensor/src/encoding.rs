//! Positional encoding of coordinates.

use crate::sine::{cosine, sine};
use burn::tensor::Tensor;

/// `[x, sin(x), cos(x), sin(2x), cos(2x), …, sin(2ᴸ⁻¹x), cos(2ᴸ⁻¹x)]` with
/// `L` octaves, every block as wide as `x`; no factor π, as in the published code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PositionalEncoding {
    /// Number of frequencies `L`; 0 leaves the input as it is.
    pub octaves: usize,
}

impl PositionalEncoding {
    /// Width of the encoding of a `width`-dimensional input.
    pub fn output_width(&self, width: usize) -> usize {
        width * (1 + 2 * self.octaves)
    }

    /// `[N, d]` → `[N, d (1 + 2L)]`.
    pub fn encode(&self, x: Tensor<2>) -> Tensor<2> {
        if self.octaves == 0 {
            return x;
        }
        let (sines, cosines) = self.sines_and_cosines(x.clone());
        let width = x.dims()[1];
        let mut blocks = vec![x];
        for octave in 0..self.octaves {
            for wave in [&sines, &cosines] {
                blocks.push(wave.clone().narrow(1, width * octave, width));
            }
        }
        Tensor::cat(blocks, 1)
    }

    /// Pulls a gradient with respect to the encoding `[N, d (1 + 2L)]` back to
    /// the input `x` `[N, d]`: the transposed Jacobian times `gradient`.
    pub fn pull_back(&self, x: Tensor<2>, gradient: Tensor<2>) -> Tensor<2> {
        if self.octaves == 0 {
            return gradient;
        }
        let width = x.dims()[1];
        let (sines, cosines) = self.sines_and_cosines(x);
        let mut sum = gradient.clone().narrow(1, 0, width);
        for octave in 0..self.octaves {
            let [sine, cosine] =
                [&sines, &cosines].map(|wave| wave.clone().narrow(1, width * octave, width));
            let of_sin = gradient.clone().narrow(1, width * (1 + 2 * octave), width);
            let of_cos = gradient.clone().narrow(1, width * (2 + 2 * octave), width);
            let term = of_sin * cosine - of_cos * sine;
            sum = sum + term.mul_scalar((1u64 << octave) as f64);
        }
        sum
    }

    /// Sines and cosines of all octaves, each `[N, d L]`: a GPU likes few large
    /// operations.
    fn sines_and_cosines(&self, x: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
        let angles = (0..self.octaves).map(|octave| x.clone().mul_scalar((1u64 << octave) as f64));
        let angles = Tensor::cat(angles.collect(), 1);
        (sine(angles.clone()), cosine(angles))
    }
}
