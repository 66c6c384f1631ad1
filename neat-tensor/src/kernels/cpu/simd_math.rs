//! Exponential, logarithm, sine and cosine of whole vectors.
//!
//! All are polynomials after a range reduction, correct to a few units in the
//! last place of float32.

use pulp::Simd;

/// Adding and subtracting this rounds to an integer, which then stands in the
/// low bits of the sum.
const ROUNDER: f32 = 12_582_912.0; // 1.5 · 2²³

/// Minimax coefficients of `(2ᶠ − 1) / f` on ±½.
const EXP2: [f32; 5] = [
    std::f32::consts::LN_2,
    0.240_223_5,
    0.055_503_57,
    0.009_666_374,
    0.001_339_086_7,
];

/// Minimax coefficients of `ln(1 + e) / e` on [0, 1].
const LOG1P: [f32; 9] = [
    1.0,
    -0.499_995_02,
    0.333_192_7,
    -0.248_443_7,
    0.191_114_3,
    -0.136_747_7,
    0.078_361_67,
    -0.029_588_507,
    0.005_253_458,
];

/// `c[0] + c[1] x + …`.
#[inline(always)]
fn polynomial<S: Simd, const N: usize>(simd: S, coefficients: [f32; N], x: S::f32s) -> S::f32s {
    let mut sum = simd.splat_f32s(coefficients[N - 1]);
    for c in coefficients.iter().rev().skip(1) {
        sum = simd.mul_add_f32s(sum, x, simd.splat_f32s(*c));
    }
    sum
}

/// `2ᵗ` for `t ≤ 0`; below −126 it is that of −126, which is `1e-38`.
///
/// In base 2 the fraction is what the rounding leaves: no second reduction.
#[inline(always)]
pub fn exp2_of_negative<S: Simd>(simd: S, t: S::f32s) -> S::f32s {
    let t = simd.max_f32s(t, simd.splat_f32s(-126.0));
    let rounder = simd.splat_f32s(ROUNDER);
    let shifted = simd.add_f32s(t, rounder);
    let fraction = simd.sub_f32s(t, simd.sub_f32s(shifted, rounder));
    let one = simd.splat_f32s(1.0);
    let power = simd.mul_add_f32s(polynomial(simd, EXP2, fraction), fraction, one);
    // 2ⁿ, built in the exponent.
    let bits = simd.transmute_u32s_f32s(shifted);
    let exponent = simd.wrapping_dyn_shl_u32s(bits, simd.splat_u32s(23));
    let scale = simd.add_u32s(exponent, simd.splat_u32s(0x3f80_0000));
    simd.mul_f32s(power, simd.transmute_f32s_u32s(scale))
}

/// `ln(1 + e)` for `e` in [0, 1].
#[inline(always)]
pub fn log1p_of_fraction<S: Simd>(simd: S, e: S::f32s) -> S::f32s {
    simd.mul_f32s(polynomial(simd, LOG1P, e), e)
}

/// Largest argument of [`sin_cos`].
pub const MAX_ANGLE: f32 = 8192.0;

/// Sine and cosine for `|x| ≤` [`MAX_ANGLE`].
#[inline(always)]
pub fn sin_cos<S: Simd>(simd: S, x: S::f32s) -> (S::f32s, S::f32s) {
    let rounder = simd.splat_f32s(ROUNDER);
    let shifted = simd.mul_add_f32s(x, simd.splat_f32s(std::f32::consts::FRAC_2_PI), rounder);
    let n = simd.sub_f32s(shifted, rounder);
    // π/2 in three parts (Cody and Waite).
    let r = simd.mul_add_f32s(n, simd.splat_f32s(-1.570_312_5), x);
    let r = simd.mul_add_f32s(n, simd.splat_f32s(-4.837_513e-4), r);
    let r = simd.mul_add_f32s(n, simd.splat_f32s(-7.549_79e-8), r);
    let square = simd.mul_f32s(r, r);
    let sine = polynomial(
        simd,
        [-0.166_666_55, 0.008_332_161, -1.951_529_6e-4],
        square,
    );
    let sine = simd.mul_add_f32s(simd.mul_f32s(sine, square), r, r);
    let cosine = polynomial(
        simd,
        [-0.5, 0.041_666_646, -0.001_388_731_6, 2.443_315_7e-5],
        square,
    );
    let cosine = simd.mul_add_f32s(cosine, square, simd.splat_f32s(1.0));
    // Quadrants: odd ones swap, the second bit turns the sign.
    let quadrant = simd.transmute_u32s_f32s(shifted);
    let one = simd.splat_u32s(1);
    let odd = simd.equal_u32s(simd.and_u32s(quadrant, one), one);
    let next = simd.add_u32s(quadrant, one);
    (
        turned(simd, simd.select_f32s(odd, cosine, sine), quadrant),
        turned(simd, simd.select_f32s(odd, sine, cosine), next),
    )
}

/// `x` with its sign turned in the second half turn.
#[inline(always)]
fn turned<S: Simd>(simd: S, x: S::f32s, quadrant: S::u32s) -> S::f32s {
    let half = simd.and_u32s(quadrant, simd.splat_u32s(2));
    let sign = simd.wrapping_dyn_shl_u32s(half, simd.splat_u32s(30));
    simd.transmute_f32s_u32s(simd.xor_u32s(simd.transmute_u32s_f32s(x), sign))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Arch, WithSimd};

    struct Apply<'a, F>(&'a [f32], F);

    trait Function {
        fn apply<S: Simd>(&self, simd: S, x: S::f32s) -> S::f32s;
    }

    impl<F: Function> WithSimd for Apply<'_, F> {
        type Output = Vec<f32>;
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
            let (whole, rest) = S::as_simd_f32s(self.0);
            assert!(rest.is_empty());
            let mut out = vec![0.0; self.0.len()];
            for (out, x) in S::as_mut_simd_f32s(&mut out).0.iter_mut().zip(whole) {
                *out = self.1.apply(simd, *x);
            }
            out
        }
    }

    macro_rules! function {
        ($name:ident, |$simd:ident, $x:ident| $body:expr) => {
            struct $name;
            impl Function for $name {
                #[inline(always)]
                fn apply<S: Simd>(&self, $simd: S, $x: S::f32s) -> S::f32s {
                    $body
                }
            }
        };
    }
    function!(Exp2, |simd, x| exp2_of_negative(simd, x));
    function!(Log1p, |simd, x| log1p_of_fraction(simd, x));
    function!(Sine, |simd, x| sin_cos(simd, x).0);
    function!(Cosine, |simd, x| sin_cos(simd, x).1);

    fn worst(f: impl Function, exact: fn(f64) -> f64, from: f32, to: f32, relative: bool) -> f64 {
        let n = 1 << 16;
        let x: Vec<f32> = (0..n)
            .map(|i| from + (to - from) * i as f32 / (n - 1) as f32)
            .collect();
        let y = Arch::new().dispatch(Apply(&x, f));
        x.iter().zip(y).fold(0.0, |worst, (x, y)| {
            let exact = exact(f64::from(*x));
            let error = (f64::from(y) - exact).abs();
            f64::max(
                worst,
                if relative {
                    error / exact.abs().max(1e-30)
                } else {
                    error
                },
            )
        })
    }

    #[test]
    fn functions_are_those_of_the_standard_library() {
        assert!(worst(Exp2, f64::exp2, -126.0, 0.0, true) < 4e-7);
        assert!(worst(Log1p, f64::ln_1p, 0.0, 1.0, true) < 3e-7);
        for (from, to) in [(-4.0, 4.0), (-300.0, 300.0), (-8192.0, 8192.0)] {
            assert!(worst(Sine, f64::sin, from, to, false) < 2e-7);
            assert!(worst(Cosine, f64::cos, from, to, false) < 2e-7);
        }
    }
}
