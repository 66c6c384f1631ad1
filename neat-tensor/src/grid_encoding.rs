//! Features learned at the corners of grids of several resolutions (Müller et al. 2022).
//!
//! These are plain tensor operations: the readable twin of [`crate::kernels::cpu::grid`],
//! which says what is interpolated how.

use crate::kernels::cpu::grid::{GridLevel, GridShape, HASH, sides_of};
use crate::linear::NetworkSizeError;
use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, TensorData};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// Entries start uniform within this of 0 (Instant-NGP, section 4).
const INITIAL: f64 = 1e-4;

/// Sizes of learned grids.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GridConfig {
    /// Number of grids.
    pub levels: usize,
    /// Features per corner: 1, 2, 4 or 8.
    pub features: usize,
    /// Logarithm to base 2 of the most entries of a grid; the corners of finer ones share
    /// entries by a hash.
    pub log2_entries: u32,
    /// Cells along a side of the coarsest grid.
    pub coarsest: u32,
    /// Cells along a side of the finest; those between are in geometric progression.
    pub finest: u32,
}

impl Default for GridConfig {
    /// Of five sizes in short runs on two scenes the one with the best renderings
    /// (docs/performance.md).
    fn default() -> Self {
        Self {
            levels: 8,
            features: 2,
            log2_entries: 12,
            coarsest: 4,
            finest: 64,
        }
    }
}

impl GridConfig {
    /// Whether there can be such grids.
    ///
    /// # Errors
    /// If a number is outside of its range. The hash of a corner of 2048 cells in a table
    /// of 2²⁰ entries is the last that every backend's 32 bit integers hold.
    pub fn validate(&self) -> Result<(), NetworkSizeError> {
        Err(NetworkSizeError(if !(1..=32).contains(&self.levels) {
            "a grid encoding needs 1 to 32 levels"
        } else if !matches!(self.features, 1 | 2 | 4 | 8) {
            "a grid encoding has 1, 2, 4 or 8 features"
        } else if !(4..=20).contains(&self.log2_entries) {
            "log2_entries of a grid encoding lies between 4 and 20"
        } else if self.coarsest == 0 || self.coarsest > self.finest || self.finest > 2048 {
            "a grid encoding needs 1 ≤ coarsest ≤ finest ≤ 2048"
        } else {
            return Ok(());
        }))
    }

    /// Features of a point.
    pub fn width(&self) -> usize {
        self.levels * self.features
    }

    /// Numbers that are learned.
    pub fn parameters(&self) -> usize {
        self.shape(1.0).entries() * self.features
    }

    /// The grids over a cube of half the side `half_side`.
    pub fn shape(&self, half_side: f64) -> GridShape {
        let ratio = f64::from(self.finest) / f64::from(self.coarsest);
        let cells = (0..self.levels).map(|level| {
            let share = level as f64 / (self.levels - 1).max(1) as f64;
            (f64::from(self.coarsest) * ratio.powf(share)).round() as u32
        });
        let cells: Vec<u32> = cells.collect();
        GridShape::new(
            &cells,
            self.features,
            1 << self.log2_entries,
            half_side as f32,
        )
    }

    /// Grids at their start.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn init(
        &self,
        half_side: f64,
        rng: &mut impl Rng,
        device: &Device,
    ) -> Result<GridEncoding, NetworkSizeError> {
        self.validate()?;
        let shape = self.shape(half_side);
        let size = [shape.entries(), shape.features];
        let draw = |_| ((rng.random::<f64>() * 2.0 - 1.0) * INITIAL) as f32;
        let values: Vec<f32> = (0..size[0] * size[1]).map(draw).collect();
        Ok(GridEncoding {
            table: Param::from_data(TensorData::new(values, size), device),
            shape,
        })
    }
}

/// Learned grids.
#[derive(Module, Debug)]
pub struct GridEncoding {
    /// What is learned, `[entries, features]`.
    pub table: Param<Tensor<2>>,
    /// Their sizes.
    #[module(skip)]
    pub shape: GridShape,
}

/// Where points lie in a grid.
struct Place {
    /// Entries of the eight corners `[N]`; bit `k` of a corner's number is its side on
    /// axis `k`.
    corners: Vec<Tensor<1, Int>>,
    /// Weights of near and far side per axis, `[N, 1]`.
    weights: [[Tensor<2>; 2]; 3],
    /// Their derivatives.
    slopes: [[Tensor<2>; 2]; 3],
}

impl GridEncoding {
    /// Features `[N, levels · features]` at `x` `[N, 3]`.
    pub fn encode(&self, x: Tensor<2>) -> Tensor<2> {
        let table = self.table.val();
        let levels = self.shape.levels.iter().map(|level| {
            let place = self.place(level, &x);
            let corners = (0..8).map(|c| {
                let [i, j, k] = sides_of(c);
                let [x, y, z] = &place.weights;
                let weight = x[i].clone() * y[j].clone() * z[k].clone();
                table.clone().select(0, place.corners[c].clone()) * weight
            });
            corners.reduce(|a, b| a + b).expect("a cell has corners")
        });
        Tensor::cat(levels.collect(), 1)
    }

    /// Pulls a gradient with respect to the features back to `x`: the transposed Jacobian
    /// times `gradient` `[N, levels · features]`.
    pub fn pull_back(&self, x: Tensor<2>, gradient: Tensor<2>) -> Tensor<2> {
        let (table, features) = (self.table.val(), self.shape.features);
        let levels = self.shape.levels.iter().enumerate().map(|(l, level)| {
            let place = self.place(level, &x);
            let gradient = gradient.clone().narrow(1, l * features, features);
            let corners = (0..8).map(|c| {
                let [i, j, k] = sides_of(c);
                let [x, y, z] = place.weights.each_ref();
                let [dx, dy, dz] = place.slopes.each_ref();
                let of_weight = Tensor::cat(
                    vec![
                        dx[i].clone() * y[j].clone() * z[k].clone(),
                        x[i].clone() * dy[j].clone() * z[k].clone(),
                        x[i].clone() * y[j].clone() * dz[k].clone(),
                    ],
                    1,
                );
                let entry = table.clone().select(0, place.corners[c].clone());
                of_weight * (entry * gradient.clone()).sum_dim(1)
            });
            corners.reduce(|a, b| a + b).expect("a cell has corners")
        });
        levels.reduce(|a, b| a + b).expect("there is a level")
    }

    fn place(&self, level: &GridLevel, x: &Tensor<2>) -> Place {
        let scale = f64::from(self.shape.scale(level));
        let position = x.clone().add_scalar(self.shape.half_side).mul_scalar(scale);
        let last = f64::from(level.cells - 1);
        // Which cell it is has no derivative.
        let cell = position.clone().detach().clamp(0.0, last).floor();
        let t = (position - cell.clone()).clamp(0.0, 1.0);
        let far = t.clone().square() * t.clone().mul_scalar(-2.0).add_scalar(3.0);
        let slope = (t.clone() - t.square()).mul_scalar(6.0 * scale);
        let axis = |of: &Tensor<2>, axis: usize| of.clone().narrow(1, axis, 1);
        Place {
            corners: corners(level, cell),
            weights: std::array::from_fn(|k| {
                let far = axis(&far, k);
                [far.clone().neg().add_scalar(1.0), far]
            }),
            slopes: std::array::from_fn(|k| {
                let slope = axis(&slope, k);
                [slope.clone().neg(), slope]
            }),
        }
    }
}

/// The entries of the corners of the cells `cell` `[N, 3]`.
fn corners(level: &GridLevel, cell: Tensor<2>) -> Vec<Tensor<1, Int>> {
    let rows = cell.dims()[0];
    let cell = cell.int();
    let axis = |k: usize, side: usize| {
        let near: Tensor<1, Int> = cell.clone().narrow(1, k, 1).reshape([rows]);
        near.add_scalar(side as i64)
    };
    let corner = |c: usize| {
        let [i, j, k] = sides_of(c);
        let [x, y, z] = [axis(0, i), axis(1, j), axis(2, k)];
        let entry = match level.mask {
            None => {
                let side = i64::from(level.cells + 1);
                (z.mul_scalar(side) + y).mul_scalar(side) + x
            }
            Some(mask) => {
                // Of a factor only the bits that the mask leaves matter, and with fewer
                // of them no product overflows.
                let [of_y, of_z] = HASH.map(|factor| i64::from(factor & mask));
                x.bitwise_xor(y.mul_scalar(of_y))
                    .bitwise_xor(z.mul_scalar(of_z))
                    .bitwise_and_scalar(i64::from(mask))
            }
        };
        entry.add_scalar(level.first as i64)
    };
    (0..8).map(corner).collect()
}
