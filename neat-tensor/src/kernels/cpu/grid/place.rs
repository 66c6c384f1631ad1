//! Where points lie in a grid.

use super::shape::{GridLevel, GridShape, HASH};
use super::{CORNERS, LANES, Lane, POINT};

/// Where each of some points lies.
pub(super) struct Place {
    /// Entries of the corners of its cell, counted from the level's first; bit `k` of a
    /// corner's number is its side on axis `k`.
    pub corners: [[u32; LANES]; CORNERS],
    /// Weight of the far side, per axis.
    pub far: [Lane; POINT],
    /// Its first derivative with respect to the point.
    pub slope: [Lane; POINT],
    /// Its second derivative.
    pub bend: [Lane; POINT],
}

impl Place {
    /// Places `points` in `level` of `shape`.
    #[inline(always)]
    pub fn of(shape: &GridShape, level: &GridLevel, points: &[Lane; POINT]) -> Self {
        let (scale, half_side) = (shape.scale(level), shape.half_side);
        let last = (level.cells - 1) as f32;
        let mut cell = [[0u32; LANES]; POINT];
        let [mut far, mut slope, mut bend] = [[[0.0; LANES]; POINT]; 3];
        for axis in 0..POINT {
            for r in 0..LANES {
                let position = (points[axis][r] + half_side) * scale;
                let corner = position.max(0.0).min(last).trunc();
                let unbounded = position - corner;
                let t = unbounded.clamp(0.0, 1.0);
                cell[axis][r] = corner as u32;
                far[axis][r] = t * t * (3.0 - 2.0 * t);
                slope[axis][r] = 6.0 * t * (1.0 - t) * scale;
                // Outside the weight is constant.
                let inside = if unbounded == t { 1.0 } else { 0.0 };
                bend[axis][r] = inside * (6.0 - 12.0 * t) * (scale * scale);
            }
        }
        Self {
            corners: corners(level, &cell),
            far,
            slope,
            bend,
        }
    }

    /// The weights of near and far side, per axis.
    #[inline(always)]
    pub fn sides(&self) -> [[Lane; 2]; POINT] {
        let mut sides = [[[0.0; LANES]; 2]; POINT];
        for axis in 0..POINT {
            for r in 0..LANES {
                sides[axis][0][r] = 1.0 - self.far[axis][r];
            }
            sides[axis][1] = self.far[axis];
        }
        sides
    }
}

#[inline(always)]
fn corners(level: &GridLevel, cell: &[[u32; LANES]; POINT]) -> [[u32; LANES]; CORNERS] {
    let mut corners = [[0; LANES]; CORNERS];
    match level.mask {
        None => {
            let side = level.cells + 1;
            for (c, corner) in corners.iter_mut().enumerate() {
                let [i, j, k] = sides_of(c);
                let (i, j, k) = (i as u32, j as u32, k as u32);
                for r in 0..LANES {
                    let [x, y, z] = [cell[0][r] + i, cell[1][r] + j, cell[2][r] + k];
                    corner[r] = (z * side + y) * side + x;
                }
            }
        }
        Some(mask) => {
            for (c, corner) in corners.iter_mut().enumerate() {
                let [i, j, k] = sides_of(c);
                let (i, j, k) = (i as u32, j as u32, k as u32);
                for r in 0..LANES {
                    let y = (cell[1][r] + j).wrapping_mul(HASH[0]);
                    let z = (cell[2][r] + k).wrapping_mul(HASH[1]);
                    corner[r] = ((cell[0][r] + i) ^ y ^ z) & mask;
                }
            }
        }
    }
    corners
}

/// On which side of each axis corner `c` lies: 0 near, 1 far.
#[inline(always)]
pub(crate) fn sides_of(c: usize) -> [usize; POINT] {
    [c & 1, c >> 1 & 1, c >> 2]
}
