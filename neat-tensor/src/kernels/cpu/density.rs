//! What sections of rays let pass, many at a time.

use super::simd_math::exp2_of_negative;
use pulp::{Arch, Simd, WithSimd};
use std::f32::consts::LOG2_E;

/// Numbers that are taken at once where whole vectors end; a multiple of every
/// vector.
const TAIL: usize = 16;

/// Share that each section lets pass: `exp(−δ σ)`, with the Laplace density
/// `σ = Ψ(−sdf) / β` of scale `beta` at its start and its length `δ`.
///
/// # Panics
/// If the slices differ in length.
pub fn passed_shares(sdf: &[f32], lengths: &[f32], beta: f32, passed: &mut [f32]) {
    assert!(
        sdf.len() == lengths.len() && sdf.len() == passed.len(),
        "passed_shares: one length and one result per distance"
    );
    let arch = Arch::new();
    let whole = sdf.len() / TAIL * TAIL;
    arch.dispatch(PassedShares {
        sdf: &sdf[..whole],
        lengths: &lengths[..whole],
        beta,
        passed: &mut passed[..whole],
    });
    let rest = sdf.len() - whole;
    if rest > 0 {
        let mut tail = [[0.0; TAIL]; 3];
        tail[0][..rest].copy_from_slice(&sdf[whole..]);
        tail[1][..rest].copy_from_slice(&lengths[whole..]);
        let [sdf, lengths, out] = &mut tail;
        arch.dispatch(PassedShares {
            sdf,
            lengths,
            beta,
            passed: out,
        });
        passed[whole..].copy_from_slice(&tail[2][..rest]);
    }
}

struct PassedShares<'a> {
    sdf: &'a [f32],
    lengths: &'a [f32],
    beta: f32,
    passed: &'a mut [f32],
}

impl WithSimd for PassedShares<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let steepness = simd.splat_f32s(LOG2_E / self.beta);
        // −log₂ e / β: density, and base 2.
        let fall = simd.splat_f32s(-LOG2_E / self.beta);
        let half = simd.splat_f32s(0.5);
        let one = simd.splat_f32s(1.0);
        let zero = simd.splat_f32s(0.0);
        let (sdf, lengths) = (S::as_simd_f32s(self.sdf).0, S::as_simd_f32s(self.lengths).0);
        let passed = S::as_mut_simd_f32s(self.passed).0;
        for (passed, (sdf, length)) in passed.iter_mut().zip(sdf.iter().zip(lengths)) {
            let negative = simd.or_f32s(*sdf, simd.splat_f32s(-0.0));
            let e = exp2_of_negative(simd, simd.mul_f32s(negative, steepness));
            let tail = simd.mul_f32s(half, e);
            let inside = simd.less_than_f32s(*sdf, zero);
            let psi = simd.select_f32s(inside, simd.sub_f32s(one, tail), tail);
            let energy = simd.mul_f32s(simd.mul_f32s(psi, *length), fall);
            *passed = exp2_of_negative(simd, energy);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_those_of_the_formula() {
        for count in [0, 1, 15, 16, 33] {
            let sdf: Vec<f32> = (0..count).map(|i| (i as f32 - 8.0) * 0.03).collect();
            let lengths: Vec<f32> = (0..count).map(|i| 0.01 * i as f32).collect();
            let mut passed = vec![0.0; count];
            passed_shares(&sdf, &lengths, 0.05, &mut passed);
            for i in 0..count {
                let tail = 0.5 * (-f64::from(sdf[i].abs()) / 0.05).exp();
                let psi = if sdf[i] < 0.0 { 1.0 - tail } else { tail };
                let exact = (-f64::from(lengths[i]) * psi / 0.05).exp();
                assert!((f64::from(passed[i]) - exact).abs() < 2e-6);
            }
        }
    }
}
