//! The sine of large angles, as exact on a GPU as on the CPU.
//!
//! Vulkan grants the sine an error of 2⁻¹¹, which drivers use: 2·10⁻⁴ was
//! measured where all else was right to 2·10⁻⁷. That would be the largest error
//! of a whole network, so on a GPU the encoding sums a series instead.

use crate::backend::is_on_host;
use burn::tensor::{DType, Tensor};
use std::f64::consts::FRAC_1_PI;

/// π in parts (Cephes' `sinf`) of so few bits that a part times a few thousand
/// half turns is exact.
const PI_PARTS: [f64; 3] = [
    3.140625,
    9.675_025_939_941_406e-4,
    1.509_957_990_978_376_4e-7,
];
/// Taylor's coefficients of r³, r⁵, … r¹³; in ±π/2 the rest is below 10⁻⁹.
const SERIES: [f64; 6] = [
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
];

/// `sin(x)`.
pub fn sine<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    if has_exact_sine(&x) {
        x.sin()
    } else {
        sine_by_series(x, 0.0)
    }
}

/// `cos(x)`.
pub fn cosine<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    if has_exact_sine(&x) {
        x.cos()
    } else {
        sine_by_series(x, 0.5)
    }
}

/// The CPU backends call the system's or Rust's library; no GPU has float64 here.
fn has_exact_sine<const D: usize>(x: &Tensor<D>) -> bool {
    x.dtype() != DType::F32 || is_on_host(&x.device())
}

/// `sin(x + half_turns · π)` for half turns of 0 or ½, to about 10⁻⁷.
fn sine_by_series<const D: usize>(x: Tensor<D>, half_turns: f64) -> Tensor<D> {
    // x = r + (k − half_turns) π with r in ±π/2; the sine is that of r, negated
    // for odd k.
    let scaled = x.clone().mul_scalar(FRAC_1_PI);
    let k = scaled.add_scalar(half_turns).round();
    let turns = k.clone().sub_scalar(half_turns);
    let r = PI_PARTS
        .into_iter()
        .fold(x, |r, part| r - turns.clone().mul_scalar(part));
    let odd = k.clone() - k.mul_scalar(0.5).floor().mul_scalar(2.0);
    let sign = odd.mul_scalar(-2.0).add_scalar(1.0);

    let square = r.clone().square();
    let [inner @ .., last] = SERIES;
    let series = inner
        .into_iter()
        .rev()
        .fold(square.clone().mul_scalar(last), |sum, coefficient| {
            sum.add_scalar(coefficient) * square.clone()
        });
    sign * r * series.add_scalar(1.0)
}

#[cfg(all(test, feature = "flex"))]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn the_series_is_the_sine_and_the_cosine() {
        let angles: Vec<f32> = (-20_000..=20_000).map(|i| i as f32 * 0.0127).collect();
        let x = Tensor::<1>::from_data(angles.as_slice(), &Device::flex());
        for (half_turns, exact) in [(0.0, f64::sin as fn(f64) -> f64), (0.5, f64::cos)] {
            let series = sine_by_series(x.clone(), half_turns).into_data();
            let series = series.as_slice::<f32>().expect("float32");
            for (angle, value) in angles.iter().zip(series) {
                let error = (f64::from(*value) - exact(f64::from(*angle))).abs();
                assert!(error < 2e-7, "{half_turns} {angle}: off by {error:.1e}");
            }
        }
    }
}
