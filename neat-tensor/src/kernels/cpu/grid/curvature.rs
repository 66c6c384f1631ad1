//! How the gradient changes with the point.

use super::place::{Place, sides_of};
use super::{GridShape, LANES, POINT, lanes_of, with_features};
use pulp::{Arch, Simd, WithSimd};

impl GridShape {
    /// Adds to `out` `[rows, 3]` the derivative of `Σ gradient · tangent` with respect to
    /// the points, where `gradient` is the transposed Jacobian times `sweep` (columns
    /// from `at` on, rows `stride` apart).
    pub fn add_curvature(
        &self,
        arch: Arch,
        [points, tangents]: [&[f32]; 2],
        table: &[f32],
        sweep: &[f32],
        stride: usize,
        at: usize,
        out: &mut [f32],
    ) {
        with_features!(self.features, F => arch.dispatch(Curvature::<F> {
            shape: self,
            points: points.as_chunks().0,
            tangents: tangents.as_chunks().0,
            table: table.as_chunks().0,
            sweep,
            stride,
            at,
            out: out.as_chunks_mut().0,
        }));
    }
}

struct Curvature<'a, const F: usize> {
    shape: &'a GridShape,
    points: &'a [[f32; POINT]],
    tangents: &'a [[f32; POINT]],
    table: &'a [[f32; F]],
    sweep: &'a [f32],
    stride: usize,
    at: usize,
    out: &'a mut [[f32; POINT]],
}

impl<const F: usize> WithSimd for Curvature<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        for l in 0..self.shape.levels.len() {
            for first_row in (0..self.points.len()).step_by(LANES) {
                self.level(l, first_row);
            }
        }
    }
}

impl<const F: usize> Curvature<'_, F> {
    #[inline(always)]
    fn level(&mut self, l: usize, first_row: usize) {
        let level = &self.shape.levels[l];
        let rows = LANES.min(self.points.len() - first_row);
        let of_rows = first_row..first_row + rows;
        let place = Place::of(self.shape, level, &lanes_of(&self.points[of_rows.clone()]));
        let tangents = lanes_of(&self.tangents[of_rows.clone()]);
        let sides = place.sides();
        for (c, corners) in place.corners.iter().enumerate() {
            let side = sides_of(c);
            for r in 0..rows {
                let entry = &self.table[level.first + corners[r] as usize];
                let column = (first_row + r) * self.stride + self.at + l * F;
                let sweep = &self.sweep[column..column + F];
                let speaks: f32 = entry.iter().zip(sweep).map(|(e, s)| e * s).sum();
                // The corner's weight is a product of one factor per axis.
                let factor: [f32; POINT] = std::array::from_fn(|axis| sides[axis][side[axis]][r]);
                let sign = side.map(|side| if side == 1 { 1.0 } else { -1.0 });
                let slope: [f32; POINT] =
                    std::array::from_fn(|axis| sign[axis] * place.slope[axis][r]);
                let bend: [f32; POINT] =
                    std::array::from_fn(|axis| sign[axis] * place.bend[axis][r]);
                let n = tangents.map(|tangent| tangent[r]);
                let out = &mut self.out[first_row + r];
                for k in 0..POINT {
                    let [i, j] = [(k + 1) % POINT, (k + 2) % POINT];
                    let own = n[k] * bend[k] * factor[i] * factor[j];
                    let mixed = n[i] * slope[i] * factor[j] + n[j] * slope[j] * factor[i];
                    out[k] += speaks * (own + slope[k] * mixed);
                }
            }
        }
    }
}
