//! Matrix products of one block.

use super::{PADDING, padded};
use pulp::{Arch, Simd, WithSimd};

/// Rows of the register tile.
const TILE_ROWS: usize = 6;

/// Columns of the register tile, in vectors: with as many accumulators as the
/// registers hold beside the operands.
const fn tile_vectors<S: Simd>() -> usize {
    if S::REGISTER_COUNT >= 32 { 4 } else { 2 }
}

struct PanelWidth;

impl WithSimd for PanelWidth {
    type Output = usize;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        (tile_vectors::<S>() * S::F32_LANES).max(PADDING)
    }
}

/// A right operand `[depth, columns]`, cut into panels of columns that the
/// register tile reads front to back.
#[derive(Clone, Debug)]
pub struct Panels {
    data: Vec<f32>,
    depth: usize,
    columns: usize,
    panel: usize,
}

impl Panels {
    /// Packs the `depth × columns` matrix whose element is `element(depth, column)`.
    pub fn new(
        arch: Arch,
        depth: usize,
        columns: usize,
        element: impl Fn(usize, usize) -> f32,
    ) -> Self {
        let panel = arch.dispatch(PanelWidth);
        let width = padded(columns);
        let mut data = vec![0.0; depth * width];
        for first in (0..width).step_by(panel) {
            let wide = panel.min(width - first);
            let block = &mut data[first * depth..(first + wide) * depth];
            for (k, row) in block.chunks_exact_mut(wide).enumerate() {
                for (c, value) in row
                    .iter_mut()
                    .enumerate()
                    .take(columns.saturating_sub(first))
                {
                    *value = element(k, first + c);
                }
            }
        }
        Self {
            data,
            depth,
            columns: width,
            panel,
        }
    }

    /// Rows `depth` of the operand.
    pub fn depth(&self) -> usize {
        self.depth
    }
}

/// The right operand of a product.
#[derive(Clone, Copy)]
enum Right<'a> {
    Packed(&'a Panels),
    /// Row-major, rows of `columns` numbers.
    Plain(&'a [f32]),
}

/// How a product meets what is in the result.
#[derive(Clone, Copy)]
enum Start<'a> {
    Zero,
    /// The same row is added to every row.
    Bias(&'a [f32]),
    /// The product is added to what is there.
    Sum,
}

struct Product<'a> {
    rows: usize,
    depth: usize,
    /// A multiple of [`PADDING`].
    columns: usize,
    left: &'a [f32],
    left_stride: usize,
    /// Whether `left` is `[depth, rows]` instead of `[rows, depth]`.
    transposed: bool,
    right: Right<'a>,
    out: &'a mut [f32],
    out_stride: usize,
    start: Start<'a>,
}

/// `out = left · right (+ bias)`: `left` `[rows, depth]` with rows `left_stride`
/// apart, `out` `[rows, columns]` with padded columns.
pub fn multiply(
    arch: Arch,
    rows: usize,
    left: &[f32],
    left_stride: usize,
    right: &Panels,
    bias: Option<&[f32]>,
    out: &mut [f32],
    out_stride: usize,
) {
    arch.dispatch(Product {
        rows,
        depth: right.depth,
        columns: right.columns,
        left,
        left_stride,
        transposed: false,
        right: Right::Packed(right),
        out,
        out_stride,
        start: bias.map_or(Start::Zero, Start::Bias),
    });
}

/// `out += leftᵀ · right`: the sum over a block's `depth` samples of the outer
/// products of their rows. `left` `[depth, ≥ rows]`, `right` `[depth, columns]`,
/// `out` `[rows, columns]`; `columns` is padded.
pub fn add_outer_products(
    arch: Arch,
    depth: usize,
    left: &[f32],
    left_stride: usize,
    rows: usize,
    right: &[f32],
    columns: usize,
    out: &mut [f32],
) {
    arch.dispatch(Product {
        rows,
        depth,
        columns,
        left,
        left_stride,
        transposed: true,
        right: Right::Plain(right),
        out,
        out_stride: columns,
        start: Start::Sum,
    });
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if self.transposed {
            self.run::<S, true>(simd);
        } else {
            self.run::<S, false>(simd);
        }
    }
}

impl Product<'_> {
    /// Panics unless every operand holds what the tiles will read and write.
    fn check(&self) {
        let Self {
            rows,
            depth,
            columns,
            left_stride,
            out_stride,
            ..
        } = *self;
        let span = |count: usize, stride: usize, width: usize| match count {
            0 => 0,
            _ => (count - 1) * stride + width,
        };
        let left = if self.transposed {
            span(depth, left_stride, rows)
        } else {
            span(rows, left_stride, depth)
        };
        assert!(self.left.len() >= left, "gemm: left operand too short");
        let right = match self.right {
            Right::Packed(panels) => panels.data.len(),
            Right::Plain(data) => data.len(),
        };
        assert!(right >= depth * columns, "gemm: right operand too short");
        assert!(
            self.out.len() >= span(rows, out_stride, columns),
            "gemm: result too short"
        );
        assert!(columns % PADDING == 0, "gemm: columns not padded");
        if let Start::Bias(bias) = self.start {
            assert!(bias.len() >= columns, "gemm: bias too short");
        }
    }

    #[inline(always)]
    fn run<S: Simd, const TRANSPOSED: bool>(mut self, simd: S) {
        self.check();
        let panel = match self.right {
            Right::Packed(panels) => panels.panel,
            Right::Plain(_) => (tile_vectors::<S>() * S::F32_LANES).max(PADDING),
        };
        for first in (0..self.columns).step_by(panel) {
            let wide = panel.min(self.columns - first);
            let (right, stride): (&[f32], usize) = match self.right {
                Right::Packed(panels) => (&panels.data[first * self.depth..], wide),
                Right::Plain(data) => (&data[first..], self.columns),
            };
            let mut column = 0;
            while column < wide {
                let left = (wide - column) / S::F32_LANES;
                let at = Columns {
                    right: &right[column..],
                    stride,
                    first: first + column,
                };
                // SAFETY: `check` held; `at` starts `column` into a panel of
                // `wide` columns, of which the tile takes at most the rest.
                let vectors = unsafe {
                    match left.min(tile_vectors::<S>()) {
                        4 => self.all_rows::<S, 4, TRANSPOSED>(simd, at),
                        3 => self.all_rows::<S, 3, TRANSPOSED>(simd, at),
                        2 => self.all_rows::<S, 2, TRANSPOSED>(simd, at),
                        _ => self.all_rows::<S, 1, TRANSPOSED>(simd, at),
                    }
                };
                column += vectors * S::F32_LANES;
            }
        }
    }

    /// The columns of one tile width for all rows; gives back the width `N`.
    ///
    /// # Safety
    /// `check` must have held, and `N` vectors from `at.first` must lie in the panel.
    #[inline(always)]
    unsafe fn all_rows<S: Simd, const N: usize, const TRANSPOSED: bool>(
        &mut self,
        simd: S,
        at: Columns<'_>,
    ) -> usize {
        let mut row = 0;
        // SAFETY: as our caller promises; `row` and the tile's height stay within `rows`.
        unsafe {
            while row + TILE_ROWS <= self.rows {
                self.tile::<S, TILE_ROWS, N, TRANSPOSED>(simd, at, row);
                row += TILE_ROWS;
            }
            match self.rows - row {
                5 => self.tile::<S, 5, N, TRANSPOSED>(simd, at, row),
                4 => self.tile::<S, 4, N, TRANSPOSED>(simd, at, row),
                3 => self.tile::<S, 3, N, TRANSPOSED>(simd, at, row),
                2 => self.tile::<S, 2, N, TRANSPOSED>(simd, at, row),
                1 => self.tile::<S, 1, N, TRANSPOSED>(simd, at, row),
                _ => {}
            }
        }
        N
    }

    /// One register tile: `M` rows from `row`, `N` vectors of columns.
    ///
    /// # Safety
    /// As [`Self::all_rows`], and the rows must lie in the matrix.
    #[inline(always)]
    unsafe fn tile<S: Simd, const M: usize, const N: usize, const TRANSPOSED: bool>(
        &mut self,
        simd: S,
        at: Columns<'_>,
        row: usize,
    ) {
        let lanes = S::F32_LANES;
        let left_stride = self.left_stride;
        // SAFETY: `check` made sure that rows `row..row + M`, the tile's columns and
        // all of `depth` lie within the operands; vectors have the alignment of their
        // elements.
        unsafe {
            let out = self.out.as_mut_ptr().add(row * self.out_stride + at.first);
            let mut sums = [[simd.splat_f32s(0.0); N]; M];
            if let Start::Bias(bias) = self.start {
                let bias = bias.as_ptr().add(at.first);
                for sums in &mut sums {
                    for (j, sum) in sums.iter_mut().enumerate() {
                        *sum = *bias.add(j * lanes).cast::<S::f32s>();
                    }
                }
            }
            let mut left = if TRANSPOSED {
                self.left.as_ptr().add(row)
            } else {
                self.left.as_ptr().add(row * left_stride)
            };
            let mut right = at.right.as_ptr();
            for _ in 0..self.depth {
                let mut b = [simd.splat_f32s(0.0); N];
                for (j, b) in b.iter_mut().enumerate() {
                    *b = *right.add(j * lanes).cast::<S::f32s>();
                }
                for (m, sums) in sums.iter_mut().enumerate() {
                    let a = *left.add(if TRANSPOSED { m } else { m * left_stride });
                    let a = simd.splat_f32s(a);
                    for (sum, b) in sums.iter_mut().zip(b) {
                        *sum = simd.mul_add_f32s(a, b, *sum);
                    }
                }
                left = left.wrapping_add(if TRANSPOSED { left_stride } else { 1 });
                right = right.wrapping_add(at.stride);
            }
            let add = matches!(self.start, Start::Sum);
            for (m, sums) in sums.iter().enumerate() {
                for (j, sum) in sums.iter().enumerate() {
                    let place = out.add(m * self.out_stride + j * lanes).cast::<S::f32s>();
                    *place = if add {
                        simd.add_f32s(*place, *sum)
                    } else {
                        *sum
                    };
                }
            }
        }
    }
}

/// Where a tile's columns begin.
#[derive(Clone, Copy)]
struct Columns<'a> {
    /// The right operand from there on.
    right: &'a [f32],
    /// From one of its rows to the next.
    stride: usize,
    /// Index of the first column in the result.
    first: usize,
}
