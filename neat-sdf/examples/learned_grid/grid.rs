//! Features learned on the corners of grids of several resolutions, interpolated
//! between them (Müller et al. 2022), with the derivatives of first and second
//! order that a signed distance network needs.
//!
//! Per sample and level eight entries are read; their interpolation and its
//! Jacobian come from one separable pass. A gradient of the distance is the
//! Jacobian, transposed, times the sweep of the network behind it; the adjoint of
//! both scatters to the same eight entries once.

use pulp::{Arch, Simd, WithSimd};

/// Half the side of the cube that the grids cover.
pub const EXTENT: f32 = 1.05;

/// How features lie between corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Trilinear: normals jump from cell to cell.
    Linear,
    /// Trilinear in `t² (3 − 2t)`: normals are continuous, and the features'
    /// derivatives vanish at corners.
    Smooth,
}

/// Sizes of the grids.
#[derive(Clone, Copy, Debug)]
pub struct GridShape {
    /// Number of grids.
    pub levels: usize,
    /// Cells along a side of the coarsest.
    pub coarsest: usize,
    /// Cells along a side of the finest.
    pub finest: usize,
    /// Most entries of a level; finer ones share entries by a hash. A power of two.
    pub most_entries: usize,
    /// How features lie between corners.
    pub interpolation: Interpolation,
}

impl GridShape {
    /// Cells along a side of level `level`, in geometric progression.
    pub fn cells(&self, level: usize) -> usize {
        let ratio = self.finest as f64 / self.coarsest as f64;
        let share = level as f64 / (self.levels.max(2) - 1) as f64;
        (self.coarsest as f64 * ratio.powf(share)).round() as usize
    }
}

/// One grid.
#[derive(Clone, Copy, Debug)]
struct Level {
    cells: u32,
    /// First entry in the table.
    first: usize,
    /// Entries minus one, where corners are hashed.
    mask: Option<u32>,
}

/// The grids, with `F` features per entry.
pub struct Grid<const F: usize> {
    levels: Vec<Level>,
    interpolation: Interpolation,
    entries: usize,
}

/// Where a point lies in a grid.
struct Place {
    /// Entries of the cell's corners; bit `k` of the number is the side on axis `k`.
    corners: [usize; 8],
    /// Interpolation weight of the far side, per axis.
    far: [f32; 3],
    /// Its derivative with respect to the point.
    slope: [f32; 3],
}

impl Level {
    #[inline(always)]
    fn place(&self, point: &[f32; 3], interpolation: Interpolation) -> Place {
        let scale = self.cells as f32 / (2.0 * EXTENT);
        let last = (self.cells - 1) as f32;
        let (mut cell, mut far, mut slope) = ([0u32; 3], [0.0; 3], [0.0; 3]);
        for k in 0..3 {
            let position = (point[k] + EXTENT) * scale;
            let corner = position.max(0.0).min(last).trunc();
            let t = (position - corner).clamp(0.0, 1.0);
            cell[k] = corner as u32;
            (far[k], slope[k]) = match interpolation {
                Interpolation::Linear => (t, scale),
                Interpolation::Smooth => (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) * scale),
            };
        }
        let corners = match self.mask {
            None => {
                let side = self.cells + 1;
                let base = ((cell[2] * side + cell[1]) * side + cell[0]) as usize + self.first;
                let (up, deep) = (side as usize, (side * side) as usize);
                std::array::from_fn(|c| base + (c & 1) + (c >> 1 & 1) * up + (c >> 2) * deep)
            }
            Some(mask) => {
                let y = [cell[1], cell[1] + 1].map(|y| y.wrapping_mul(2_654_435_761));
                let z = [cell[2], cell[2] + 1].map(|z| z.wrapping_mul(805_459_861));
                std::array::from_fn(|c| {
                    let hash = (cell[0] + (c as u32 & 1)) ^ y[c >> 1 & 1] ^ z[c >> 2];
                    (hash & mask) as usize + self.first
                })
            }
        };
        Place {
            corners,
            far,
            slope,
        }
    }
}

/// `a + t (b − a)`.
#[inline(always)]
fn mix<const F: usize>(a: [f32; F], b: [f32; F], t: f32) -> [f32; F] {
    std::array::from_fn(|f| a[f] + t * (b[f] - a[f]))
}

/// `b − a`.
#[inline(always)]
fn difference<const F: usize>(a: [f32; F], b: [f32; F]) -> [f32; F] {
    std::array::from_fn(|f| b[f] - a[f])
}

impl<const F: usize> Grid<F> {
    /// Grids as `shape` wants them.
    pub fn new(shape: &GridShape) -> Self {
        let mut entries = 0;
        let levels = (0..shape.levels)
            .map(|l| {
                let cells = shape.cells(l);
                let corners = (cells + 1).pow(3);
                let first = entries;
                let hashed = corners > shape.most_entries;
                entries += corners.min(shape.most_entries);
                Level {
                    cells: cells as u32,
                    first,
                    mask: hashed.then(|| shape.most_entries as u32 - 1),
                }
            })
            .collect();
        Self {
            levels,
            interpolation: shape.interpolation,
            entries,
        }
    }

    /// Features per point, of all levels.
    pub fn width(&self) -> usize {
        self.levels.len() * F
    }

    /// Numbers in the table.
    pub fn parameters(&self) -> usize {
        self.entries * F
    }

    /// Interpolates `table` at `points` `[rows, 3]`: the features into columns of
    /// `out` from `at` on, rows `stride` apart, and, where given, their derivative
    /// with respect to each coordinate into `jacobian` `[rows, 3, width]`.
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
        arch.dispatch(Encode {
            grid: self,
            points,
            table: table.as_chunks::<F>().0,
            out,
            stride,
            at,
            jacobian,
        });
    }

    /// Adds to `of_table` what `Σ features · of_features + Σ gradient · tangent`
    /// owes to the table, where `gradient` is the Jacobian, transposed, times
    /// `sweep`: both with rows `stride` apart and from column `at` on. `tangents`
    /// `[rows, 3]`.
    pub fn scatter(
        &self,
        arch: Arch,
        points: &[f32],
        tangents: &[f32],
        of_features: &[f32],
        sweep: &[f32],
        stride: usize,
        at: usize,
        of_table: &mut [f32],
    ) {
        arch.dispatch(Scatter {
            grid: self,
            points,
            tangents,
            of_features,
            sweep,
            stride,
            at,
            of_table: of_table.as_chunks_mut::<F>().0,
        });
    }
}

struct Encode<'a, const F: usize> {
    grid: &'a Grid<F>,
    points: &'a [f32],
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
        let width = self.grid.width();
        for (l, level) in self.grid.levels.iter().enumerate() {
            for (row, point) in self.points.as_chunks().0.iter().enumerate() {
                let place = level.place(point, self.grid.interpolation);
                let c = place.corners.map(|corner| self.table[corner]);
                let [sx, sy, sz] = place.far;
                let along_x: [[f32; F]; 4] =
                    std::array::from_fn(|k| mix(c[2 * k], c[2 * k + 1], sx));
                let along_y = [
                    mix(along_x[0], along_x[1], sy),
                    mix(along_x[2], along_x[3], sy),
                ];
                let value = mix(along_y[0], along_y[1], sz);
                let column = l * F;
                let out = &mut self.out[row * self.stride + self.at + column..][..F];
                out.copy_from_slice(&value);
                let Some(jacobian) = self.jacobian.as_deref_mut() else {
                    continue;
                };
                let dx: [[f32; F]; 4] = std::array::from_fn(|k| difference(c[2 * k], c[2 * k + 1]));
                let dx = mix(mix(dx[0], dx[1], sy), mix(dx[2], dx[3], sy), sz);
                let dy = mix(
                    difference(along_x[0], along_x[1]),
                    difference(along_x[2], along_x[3]),
                    sz,
                );
                let dz = difference(along_y[0], along_y[1]);
                let of_row = &mut jacobian[row * 3 * width..][..3 * width];
                for (axis, d) in [dx, dy, dz].into_iter().enumerate() {
                    let d = d.map(|d| d * place.slope[axis]);
                    of_row[axis * width + column..][..F].copy_from_slice(&d);
                }
            }
        }
    }
}

struct Scatter<'a, const F: usize> {
    grid: &'a Grid<F>,
    points: &'a [f32],
    tangents: &'a [f32],
    of_features: &'a [f32],
    sweep: &'a [f32],
    stride: usize,
    at: usize,
    of_table: &'a mut [[f32; F]],
}

impl<const F: usize> WithSimd for Scatter<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let (points, tangents) = (self.points.as_chunks().0, self.tangents.as_chunks().0);
        for (l, level) in self.grid.levels.iter().enumerate() {
            for (row, (point, tangent)) in points.iter().zip(tangents).enumerate() {
                self.add(level, l, row, point, tangent);
            }
        }
    }
}

impl<const F: usize> Scatter<'_, F> {
    #[inline(always)]
    fn add(&mut self, level: &Level, l: usize, row: usize, point: &[f32; 3], tangent: &[f32; 3]) {
        let place = level.place(point, self.grid.interpolation);
        let column = row * self.stride + self.at + l * F;
        let feature: [f32; F] = std::array::from_fn(|f| self.of_features[column + f]);
        let sweep: [f32; F] = std::array::from_fn(|f| self.sweep[column + f]);
        let [x, y, z] = place.far.map(|far| [1.0 - far, far]);
        // Derivative of the weights along the tangent, axis by axis.
        let [tx, ty, tz]: [[f32; 2]; 3] = std::array::from_fn(|k| {
            let slope = place.slope[k] * tangent[k];
            [-slope, slope]
        });
        for (c, corner) in place.corners.into_iter().enumerate() {
            let (i, j, k) = (c & 1, c >> 1 & 1, c >> 2);
            let weight = x[i] * y[j] * z[k];
            let along = tx[i] * y[j] * z[k] + x[i] * (ty[j] * z[k] + y[j] * tz[k]);
            let entry = &mut self.of_table[corner];
            for f in 0..F {
                entry[f] += weight * feature[f] + along * sweep[f];
            }
        }
    }
}
