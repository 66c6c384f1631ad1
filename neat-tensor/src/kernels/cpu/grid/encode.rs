//! Features at points, and their derivatives.

use super::place::Place;
use super::{CORNERS, GridShape, LANES, Lane, POINT, lanes_of, with_features};
use pulp::{Arch, Simd, WithSimd};

impl GridShape {
    /// Interpolates `table` `[entries, features]` at `points` `[rows, 3]`: the features
    /// into columns of `out` from `at` on, rows `stride` apart, and, where given, their
    /// derivative with respect to each coordinate into `jacobian` `[rows, 3, width]`.
    pub fn encode(
        &self,
        arch: Arch,
        points: &[f32],
        table: &[f32],
        out: &mut [f32],
        stride: usize,
        at: usize,
        jacobian: Option<&mut [f32]>,
    ) {
        with_features!(self.features, F => arch.dispatch(Encode::<F> {
            shape: self,
            points: points.as_chunks().0,
            table: table.as_chunks().0,
            out,
            stride,
            at,
            jacobian,
        }));
    }
}

struct Encode<'a, const F: usize> {
    shape: &'a GridShape,
    points: &'a [[f32; POINT]],
    table: &'a [[f32; F]],
    out: &'a mut [f32],
    stride: usize,
    at: usize,
    jacobian: Option<&'a mut [f32]>,
}

impl<const F: usize> WithSimd for Encode<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        for l in 0..self.shape.levels.len() {
            for (chunk, points) in self.points.chunks(LANES).enumerate() {
                self.level(l, chunk * LANES, points);
            }
        }
    }
}

impl<const F: usize> Encode<'_, F> {
    /// Level `l` of the points from row `first_row` on.
    #[inline(always)]
    fn level(&mut self, l: usize, first_row: usize, points: &[[f32; POINT]]) {
        let level = &self.shape.levels[l];
        let place = Place::of(self.shape, level, &lanes_of(points));
        let table = &self.table[level.first..][..level.entries()];
        // Per feature the entries of the corners.
        let mut entries = [[[0.0; LANES]; CORNERS]; F];
        for (c, corner) in place.corners.iter().enumerate() {
            for (r, corner) in corner.iter().enumerate() {
                let entry = table[*corner as usize];
                for f in 0..F {
                    entries[f][c][r] = entry[f];
                }
            }
        }
        let (width, rows) = (self.shape.width(), points.len());
        for (f, corners) in entries.iter().enumerate() {
            let column = l * F + f;
            let (value, gradient) = interpolate(corners, &place);
            let out = self.out[first_row * self.stride..].chunks_mut(self.stride);
            for (out, value) in out.zip(value).take(rows) {
                out[self.at + column] = value;
            }
            let Some(jacobian) = self.jacobian.as_deref_mut() else {
                continue;
            };
            let jacobian = jacobian[first_row * POINT * width..].chunks_mut(POINT * width);
            for (r, jacobian) in jacobian.enumerate().take(rows) {
                for axis in 0..POINT {
                    jacobian[axis * width + column] = gradient[axis][r];
                }
            }
        }
    }
}

/// A feature between its corners, and its gradient.
#[inline(always)]
fn interpolate(c: &[Lane; CORNERS], place: &Place) -> (Lane, [Lane; POINT]) {
    let [sx, sy, sz] = &place.far;
    let mut value = [0.0; LANES];
    let mut gradient = [[0.0; LANES]; POINT];
    for r in 0..LANES {
        let (sx, sy, sz) = (sx[r], sy[r], sz[r]);
        let x = [
            mix(c[0][r], c[1][r], sx),
            mix(c[2][r], c[3][r], sx),
            mix(c[4][r], c[5][r], sx),
            mix(c[6][r], c[7][r], sx),
        ];
        let y = [mix(x[0], x[1], sy), mix(x[2], x[3], sy)];
        value[r] = mix(y[0], y[1], sz);
        let near = mix(c[1][r] - c[0][r], c[3][r] - c[2][r], sy);
        let far = mix(c[5][r] - c[4][r], c[7][r] - c[6][r], sy);
        gradient[0][r] = mix(near, far, sz) * place.slope[0][r];
        gradient[1][r] = mix(x[1] - x[0], x[3] - x[2], sz) * place.slope[1][r];
        gradient[2][r] = (y[1] - y[0]) * place.slope[2][r];
    }
    (value, gradient)
}

/// `a + t (b − a)`; no closure, which would not inherit the instruction set.
#[inline(always)]
fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + t * (b - a)
}
