//! The gradient of the table.

use super::place::{Place, sides_of};
use super::{CORNERS, GridLevel, GridShape, LANES, Lane, POINT, lanes_of, with_features};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// What some rows ask of the table.
#[derive(Clone, Copy, Debug)]
pub struct GridAdjoint<'a> {
    /// `[rows, 3]`.
    pub points: &'a [f32],
    /// Adjoint of the gradient with respect to the point, `[rows, 3]`, where it has one.
    pub tangents: Option<&'a [f32]>,
    /// Per level and row: the adjoint of its features, then, where there are tangents,
    /// the derivative of the loss's output with respect to them.
    pub of_features: &'a [f32],
}

impl GridAdjoint<'_> {
    fn rows(&self) -> usize {
        self.points.len() / POINT
    }
}

impl GridShape {
    /// Numbers of [`GridAdjoint::of_features`] for `rows` rows.
    pub fn adjoint_size(&self, rows: usize, tangents: bool) -> usize {
        rows * self.width() * if tangents { 2 } else { 1 }
    }

    /// Rearranges columns of `features` and `sweep`, from `at` on and with rows `stride`
    /// apart, to [`GridAdjoint::of_features`] of `rows` rows.
    pub fn gather_adjoint(
        &self,
        rows: usize,
        features: &[f32],
        sweep: Option<&[f32]>,
        stride: usize,
        at: usize,
        out: &mut [f32],
    ) {
        let f = self.features;
        let mut out = out.chunks_exact_mut(f);
        for l in 0..self.levels.len() {
            for row in 0..rows {
                let from = row * stride + at + l * f;
                for source in [Some(features), sweep].into_iter().flatten() {
                    let out = out.next().expect("gather_adjoint: room for all rows");
                    out.copy_from_slice(&source[from..from + f]);
                }
            }
        }
    }

    /// The gradient of `Σ features · adjoint + Σ gradient · tangent` with respect to the
    /// table, over all rows of `adjoints`, where `gradient` is the transposed Jacobian
    /// times the sweep.
    ///
    /// Every entry is summed in the order of the rows, whatever the number of threads:
    /// a task takes one level, or, where there are more threads than levels, some of its
    /// entries.
    pub fn scatter(&self, arch: Arch, adjoints: &[GridAdjoint<'_>]) -> Vec<f32> {
        let f = self.features;
        let mut of_table = vec![0.0; self.entries() * f];
        let parts = rayon::current_num_threads().div_ceil(self.levels.len().max(1));
        let mut tasks = Vec::new();
        let mut rest = &mut of_table[..];
        for (l, level) in self.levels.iter().enumerate() {
            let (entries, tail) = rest.split_at_mut(level.entries() * f);
            rest = tail;
            let size = level.entries().div_ceil(parts);
            tasks.extend(
                entries
                    .chunks_mut(size * f)
                    .enumerate()
                    .map(|(part, out)| (l, level, part * size, out)),
            );
        }
        tasks
            .into_par_iter()
            .with_max_len(1)
            .for_each(|(l, level, first, out)| {
                with_features!(f, F => arch.dispatch(Scatter::<F> {
                    shape: self,
                    l,
                    level,
                    adjoints,
                    first,
                    out: out.as_chunks_mut().0,
                }));
            });
        of_table
    }
}

/// The entries from `first` on of one level.
struct Scatter<'a, const F: usize> {
    shape: &'a GridShape,
    l: usize,
    level: &'a GridLevel,
    adjoints: &'a [GridAdjoint<'a>],
    first: usize,
    out: &'a mut [[f32; F]],
}

impl<const F: usize> WithSimd for Scatter<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        for adjoint in self.adjoints {
            let kinds = if adjoint.tangents.is_some() { 2 } else { 1 };
            let of_level = adjoint.rows() * kinds;
            let of_features = adjoint.of_features.as_chunks::<F>().0;
            let of_features = &of_features[self.l * of_level..][..of_level];
            let points = adjoint.points.as_chunks::<POINT>().0;
            for (chunk, points) in points.chunks(LANES).enumerate() {
                let of_features = &of_features[chunk * LANES * kinds..];
                match adjoint.tangents {
                    None => self.values(points, of_features),
                    Some(tangents) => {
                        let tangents = &tangents.as_chunks::<POINT>().0[chunk * LANES..];
                        let tangents = &tangents[..points.len()];
                        self.values_and_gradients(points, tangents, of_features);
                    }
                }
            }
        }
    }
}

impl<const F: usize> Scatter<'_, F> {
    #[inline(always)]
    fn values(&mut self, points: &[[f32; POINT]], of_features: &[[f32; F]]) {
        let place = Place::of(self.shape, self.level, &lanes_of(points));
        let [x, y, z] = place.sides();
        let mut weights = [[0.0; LANES]; CORNERS];
        for (c, weights) in weights.iter_mut().enumerate() {
            let [i, j, k] = sides_of(c);
            for r in 0..LANES {
                weights[r] = x[i][r] * y[j][r] * z[k][r];
            }
        }
        for (r, feature) in of_features[..points.len()].iter().enumerate() {
            for c in 0..CORNERS {
                let weight = weights[c][r];
                self.add(place.corners[c][r], weight, feature);
            }
        }
    }

    #[inline(always)]
    fn values_and_gradients(
        &mut self,
        points: &[[f32; POINT]],
        tangents: &[[f32; POINT]],
        of_features: &[[f32; F]],
    ) {
        let place = Place::of(self.shape, self.level, &lanes_of(points));
        let [x, y, z] = place.sides();
        let [tx, ty, tz] = along(&lanes_of(tangents), &place.slope);
        let [mut weights, mut changes] = [[[0.0; LANES]; CORNERS]; 2];
        for (c, (weights, changes)) in weights.iter_mut().zip(&mut changes).enumerate() {
            let [i, j, k] = sides_of(c);
            for r in 0..LANES {
                let (x, y, z) = (x[i][r], y[j][r], z[k][r]);
                weights[r] = x * y * z;
                changes[r] = tx[i][r] * y * z + x * (ty[j][r] * z + y * tz[k][r]);
            }
        }
        let pairs = of_features.as_chunks::<2>().0;
        for (r, [feature, sweep]) in pairs[..points.len()].iter().enumerate() {
            for c in 0..CORNERS {
                let (weight, change) = (weights[c][r], changes[c][r]);
                let corner = place.corners[c][r];
                self.add(corner, weight, feature);
                self.add(corner, change, sweep);
            }
        }
    }

    /// Adds `factor` times `value` to an entry, if it is one of these.
    #[inline(always)]
    fn add(&mut self, corner: u32, factor: f32, value: &[f32; F]) {
        if let Some(entry) = self.out.get_mut((corner as usize).wrapping_sub(self.first)) {
            for f in 0..F {
                entry[f] += factor * value[f];
            }
        }
    }
}

/// How the weights of near and far side change along `tangents`, per axis.
#[inline(always)]
fn along(tangents: &[Lane; POINT], slopes: &[Lane; POINT]) -> [[Lane; 2]; POINT] {
    let mut change = [[[0.0; LANES]; 2]; POINT];
    for axis in 0..POINT {
        for r in 0..LANES {
            let far = slopes[axis][r] * tangents[axis][r];
            change[axis][0][r] = -far;
            change[axis][1][r] = far;
        }
    }
    change
}
