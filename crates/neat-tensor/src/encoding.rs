//! Positional encoding of coordinates.

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
        let mut blocks = vec![x.clone()];
        for octave in 0..self.octaves {
            let scaled = x.clone().mul_scalar((1u64 << octave) as f64);
            blocks.push(scaled.clone().sin());
            blocks.push(scaled.cos());
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
        let mut sum = gradient.clone().narrow(1, 0, width);
        for octave in 0..self.octaves {
            let frequency = (1u64 << octave) as f64;
            let scaled = x.clone().mul_scalar(frequency);
            let of_sin = gradient.clone().narrow(1, width * (1 + 2 * octave), width);
            let of_cos = gradient.clone().narrow(1, width * (2 + 2 * octave), width);
            let term = of_sin * scaled.clone().cos() - of_cos * scaled.sin();
            sum = sum + term.mul_scalar(frequency);
        }
        sum
    }
}
