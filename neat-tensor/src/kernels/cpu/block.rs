//! Element-wise passes over the matrices of one block.

use super::simd_math::{MAX_ANGLE, exp2_of_negative, log1p_of_fraction, sin_cos};
use pulp::{Arch, Simd, WithSimd};
use std::f32::consts::LOG2_E;

/// Softplus of `z` in place: `max(z, 0) + ln(1 + exp(−β|z|)) / β`; where `slope`
/// is given, it receives the derivative `1 / (1 + exp(−βz))`.
pub fn softplus(arch: Arch, z: &mut [f32], sharpness: f32, slope: Option<&mut [f32]>) {
    arch.dispatch(Softplus {
        z,
        sharpness,
        slope,
    });
}

struct Softplus<'a> {
    z: &'a mut [f32],
    sharpness: f32,
    slope: Option<&'a mut [f32]>,
}

impl WithSimd for Softplus<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let steepness = simd.splat_f32s(self.sharpness * LOG2_E);
        let inverse = simd.splat_f32s(1.0 / self.sharpness);
        let zero = simd.splat_f32s(0.0);
        let one = simd.splat_f32s(1.0);
        let z = S::as_mut_simd_f32s(self.z).0;
        match self.slope {
            None => {
                for z in z {
                    let e = exp_of_minus_magnitude(simd, *z, steepness);
                    *z = value_from_exp(simd, *z, e, inverse);
                }
            }
            Some(slope) => {
                for (z, slope) in z.iter_mut().zip(S::as_mut_simd_f32s(slope).0) {
                    let e = exp_of_minus_magnitude(simd, *z, steepness);
                    let share = simd.div_f32s(one, simd.add_f32s(one, e));
                    let positive = simd.greater_than_or_equal_f32s(*z, zero);
                    *slope = simd.select_f32s(positive, share, simd.mul_f32s(e, share));
                    *z = value_from_exp(simd, *z, e, inverse);
                }
            }
        }
    }
}

// Closures would not inherit the vector instructions of their surroundings;
// functions that are always inlined do.

/// `exp(−β|z|)`; `steepness` is `β log₂ e`.
#[inline(always)]
fn exp_of_minus_magnitude<S: Simd>(simd: S, z: S::f32s, steepness: S::f32s) -> S::f32s {
    // The sign bit set: −|z|.
    let negative = simd.or_f32s(z, simd.splat_f32s(-0.0));
    exp2_of_negative(simd, simd.mul_f32s(negative, steepness))
}

/// Softplus of `z` from `e = exp(−β|z|)`.
#[inline(always)]
fn value_from_exp<S: Simd>(simd: S, z: S::f32s, e: S::f32s, inverse: S::f32s) -> S::f32s {
    let above = simd.max_f32s(z, simd.splat_f32s(0.0));
    simd.mul_add_f32s(log1p_of_fraction(simd, e), inverse, above)
}

/// The derivative of softplus from its value `h`: `1 − exp(−βh)`; `fall` is
/// `−β log₂ e`.
#[inline(always)]
fn slope_from_value<S: Simd>(simd: S, h: S::f32s, fall: S::f32s) -> S::f32s {
    let e = exp2_of_negative(simd, simd.mul_f32s(h, fall));
    simd.sub_f32s(simd.splat_f32s(1.0), e)
}

/// Writes the derivative of softplus at its values `h` to `slope`.
pub fn softplus_slope(arch: Arch, h: &[f32], sharpness: f32, slope: &mut [f32]) {
    arch.dispatch(Slope {
        h,
        sharpness,
        slope,
    });
}

struct Slope<'a> {
    h: &'a [f32],
    sharpness: f32,
    slope: &'a mut [f32],
}

impl WithSimd for Slope<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let fall = simd.splat_f32s(-self.sharpness * LOG2_E);
        let h = S::as_simd_f32s(self.h).0;
        for (slope, h) in S::as_mut_simd_f32s(self.slope).0.iter_mut().zip(h) {
            *slope = slope_from_value(simd, *h, fall);
        }
    }
}

/// The adjoint of the reverse sweep through one activation, `u = g · s` with
/// slope `s = φ'(z)`: given `h = φ(z)`, `g` and the adjoint `up` of `u`, writes
/// `s`, the product `u` (over `g`), the adjoint of `g` (over `up`) and the
/// adjoint of `z` through the slope.
pub struct SweepAdjoint<'a> {
    /// Values of the activation.
    pub h: &'a [f32],
    /// In: `g`. Out: `u = g s`.
    pub g: &'a mut [f32],
    /// In: adjoint of `u`. Out: adjoint of `g`.
    pub up: &'a mut [f32],
    /// Out: the slope `s`.
    pub slope: &'a mut [f32],
    /// Out: adjoint of `z`: `up g β s (1 − s)`.
    pub through_slope: &'a mut [f32],
    /// β.
    pub sharpness: f32,
}

impl SweepAdjoint<'_> {
    /// Runs the pass.
    pub fn run(self, arch: Arch) {
        arch.dispatch(self);
    }
}

impl WithSimd for SweepAdjoint<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let sharpness = simd.splat_f32s(self.sharpness);
        let fall = simd.splat_f32s(-self.sharpness * LOG2_E);
        let h = S::as_simd_f32s(self.h).0;
        let g = S::as_mut_simd_f32s(self.g).0;
        let up = S::as_mut_simd_f32s(self.up).0;
        let slopes = S::as_mut_simd_f32s(self.slope).0;
        let through = S::as_mut_simd_f32s(self.through_slope).0;
        for ((((h, g), up), slope), through) in h.iter().zip(g).zip(up).zip(slopes).zip(through) {
            let s = slope_from_value(simd, *h, fall);
            let u = simd.mul_f32s(*g, s);
            // β u (1 − s) = β (u − u s)
            let curvature = simd.mul_f32s(sharpness, simd.sub_f32s(u, simd.mul_f32s(u, s)));
            *through = simd.mul_f32s(*up, curvature);
            *g = u;
            *up = simd.mul_f32s(*up, s);
            *slope = s;
        }
    }
}

/// `out = a · b`.
pub fn product(arch: Arch, a: &[f32], b: &[f32], out: &mut [f32]) {
    arch.dispatch(ProductInto { a, b, out });
}

struct ProductInto<'a> {
    a: &'a [f32],
    b: &'a [f32],
    out: &'a mut [f32],
}

impl WithSimd for ProductInto<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (a, b) = (S::as_simd_f32s(self.a).0, S::as_simd_f32s(self.b).0);
        for (out, (a, b)) in S::as_mut_simd_f32s(self.out)
            .0
            .iter_mut()
            .zip(a.iter().zip(b))
        {
            *out = simd.mul_f32s(*a, *b);
        }
    }
}

/// `out = row · matrix`, for every row of `matrix`.
pub fn scale_rows(arch: Arch, matrix: &[f32], row: &[f32], out: &mut [f32]) {
    let width = row.len();
    for (m, out) in matrix.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
        product(arch, m, row, out);
    }
}

/// `h = h · slope + through` in place: the adjoint of `z` from that of `h`.
pub fn scale_and_add(arch: Arch, h: &mut [f32], slope: &[f32], through: Option<&[f32]>) {
    arch.dispatch(ScaleAndAdd { h, slope, through });
}

struct ScaleAndAdd<'a> {
    h: &'a mut [f32],
    slope: &'a [f32],
    through: Option<&'a [f32]>,
}

impl WithSimd for ScaleAndAdd<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let h = S::as_mut_simd_f32s(self.h).0;
        let slope = S::as_simd_f32s(self.slope).0;
        match self.through {
            None => {
                for (h, s) in h.iter_mut().zip(slope) {
                    *h = simd.mul_f32s(*h, *s);
                }
            }
            Some(through) => {
                let through = S::as_simd_f32s(through).0;
                for ((h, s), t) in h.iter_mut().zip(slope).zip(through) {
                    *h = simd.mul_add_f32s(*h, *s, *t);
                }
            }
        }
    }
}

/// ReLU in place.
pub fn relu(arch: Arch, z: &mut [f32]) {
    arch.dispatch(Relu(z));
}

struct Relu<'a>(&'a mut [f32]);

impl WithSimd for Relu<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let zero = simd.splat_f32s(0.0);
        for z in S::as_mut_simd_f32s(self.0).0 {
            *z = simd.max_f32s(*z, zero);
        }
    }
}

/// Sets `adjoint` to zero where the ReLU's value `h` is.
pub fn relu_adjoint(arch: Arch, adjoint: &mut [f32], h: &[f32]) {
    arch.dispatch(ReluAdjoint { adjoint, h });
}

struct ReluAdjoint<'a> {
    adjoint: &'a mut [f32],
    h: &'a [f32],
}

impl WithSimd for ReluAdjoint<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let zero = simd.splat_f32s(0.0);
        let h = S::as_simd_f32s(self.h).0;
        for (a, h) in S::as_mut_simd_f32s(self.adjoint).0.iter_mut().zip(h) {
            *a = simd.select_f32s(simd.greater_than_f32s(*h, zero), *a, zero);
        }
    }
}

/// Adds the sum of all rows of `matrix` `[_, width]` to `sum` `[width]`.
pub fn add_column_sums(arch: Arch, matrix: &[f32], width: usize, sum: &mut [f32]) {
    arch.dispatch(ColumnSums { matrix, width, sum });
}

struct ColumnSums<'a> {
    matrix: &'a [f32],
    width: usize,
    sum: &'a mut [f32],
}

impl WithSimd for ColumnSums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let sum = S::as_mut_simd_f32s(&mut self.sum[..self.width]).0;
        for row in self.matrix.chunks_exact(self.width) {
            for (sum, x) in sum.iter_mut().zip(S::as_simd_f32s(row).0) {
                *sum = simd.add_f32s(*sum, *x);
            }
        }
    }
}

/// Columns `from..from + width` of `matrix` (rows of `stride` numbers), densely
/// packed into `out`.
pub fn copy_columns(matrix: &[f32], stride: usize, from: usize, width: usize, out: &mut [f32]) {
    for (out, row) in out.chunks_exact_mut(width).zip(matrix.chunks_exact(stride)) {
        out.copy_from_slice(&row[from..from + width]);
    }
}

/// Positional encoding of `x` `[rows, width]` (densely packed):
/// `[x, sin x, cos x, sin 2x, cos 2x, …]`, into columns of `out` from `to` on.
pub fn encode(
    arch: Arch,
    rows: usize,
    x: &[f32],
    width: usize,
    octaves: usize,
    out: &mut [f32],
    out_stride: usize,
    to: usize,
) {
    for (out, x) in out
        .chunks_mut(out_stride)
        .zip(x.chunks_exact(width))
        .take(rows)
    {
        out[to..to + width].copy_from_slice(x);
    }
    for octave in 0..octaves {
        let at = to + width * (1 + 2 * octave);
        arch.dispatch(EncodeOctave {
            rows,
            x,
            width,
            frequency: frequency(octave),
            out,
            out_stride,
            at,
        });
    }
}

/// Frequency of an octave.
pub fn frequency(octave: usize) -> f32 {
    (1u64 << octave) as f32
}

struct EncodeOctave<'a> {
    rows: usize,
    x: &'a [f32],
    width: usize,
    frequency: f32,
    out: &'a mut [f32],
    out_stride: usize,
    /// Column of the first sine.
    at: usize,
}

/// Numbers whose sine is taken at once; a multiple of every vector.
const CHUNK: usize = 48;

impl WithSimd for EncodeOctave<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let width = self.width;
        for (chunk, x) in self.x[..self.rows * width].chunks(CHUNK).enumerate() {
            let mut angle = [0.0f32; CHUNK];
            let (mut sine, mut cosine) = ([0.0f32; CHUNK], [0.0f32; CHUNK]);
            let mut largest = 0.0f32;
            for (angle, x) in angle.iter_mut().zip(x) {
                *angle = x * self.frequency;
                largest = largest.max(angle.abs());
            }
            if largest <= MAX_ANGLE {
                let sines = S::as_mut_simd_f32s(&mut sine).0.iter_mut();
                let cosines = S::as_mut_simd_f32s(&mut cosine).0;
                let both = sines.zip(cosines);
                for ((s, c), angle) in both.zip(S::as_simd_f32s(&angle).0) {
                    (*s, *c) = sin_cos(simd, *angle);
                }
            } else {
                for ((s, c), angle) in sine.iter_mut().zip(&mut cosine).zip(angle) {
                    (*s, *c) = angle.sin_cos();
                }
            }
            for i in 0..x.len() {
                let flat = chunk * CHUNK + i;
                let place = flat / width * self.out_stride + self.at + flat % width;
                self.out[place] = sine[i];
                self.out[place + width] = cosine[i];
            }
        }
    }
}

/// The Jacobian of the encoding at its own value: `encoded` holds the sines and
/// cosines. Pulls `gradient` (columns as `encoded`) back and adds it to `out`
/// `[width]`.
pub fn add_pull_back(
    encoded: &[f32],
    gradient: &[f32],
    width: usize,
    octaves: usize,
    out: &mut [f32],
) {
    for c in 0..width {
        let mut sum = gradient[c];
        for octave in 0..octaves {
            let (s, k) = (width * (1 + 2 * octave) + c, width * (2 + 2 * octave) + c);
            sum += frequency(octave) * (gradient[s] * encoded[k] - gradient[k] * encoded[s]);
        }
        out[c] += sum;
    }
}

/// Pushes a tangent `[width]` forward through the encoding: the adjoint of
/// [`add_pull_back`] with respect to its gradient.
pub fn push_forward(encoded: &[f32], tangent: &[f32], octaves: usize, out: &mut [f32]) {
    let width = tangent.len();
    for c in 0..width {
        out[c] = tangent[c];
        for octave in 0..octaves {
            let (s, k) = (width * (1 + 2 * octave) + c, width * (2 + 2 * octave) + c);
            let scaled = frequency(octave) * tangent[c];
            out[s] = scaled * encoded[k];
            out[k] = -scaled * encoded[s];
        }
    }
}

/// The adjoint of [`add_pull_back`] with respect to the encoded point: adds
/// `Σ_f −f² (g_sin sin + g_cos cos) tangent` to `out` `[width]`.
pub fn add_curvature(
    encoded: &[f32],
    gradient: &[f32],
    tangent: &[f32],
    octaves: usize,
    out: &mut [f32],
) {
    let width = tangent.len();
    for c in 0..width {
        let mut sum = 0.0;
        for octave in 0..octaves {
            let (s, k) = (width * (1 + 2 * octave) + c, width * (2 + 2 * octave) + c);
            let f = frequency(octave);
            sum -= f * f * (gradient[s] * encoded[s] + gradient[k] * encoded[k]);
        }
        out[c] += sum * tangent[c];
    }
}
