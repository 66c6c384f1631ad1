//! Features learned at the corners of grids of several resolutions and interpolated
//! between them (Müller et al. 2022), with the derivatives of first and second order that
//! a signed distance network needs.
//!
//! The weight of a cell's far side is `t² (3 − 2t)` per axis, so that the gradient of
//! what is interpolated is continuous. Outside the grids everything is as at their
//! border.
//!
//! Points are taken `LANES` at a time: places, weights and interpolation are then
//! vectors along the points, and only the entries of the table are read one by one.

mod curvature;
mod encode;
mod features;
mod place;
mod scatter;
mod shape;

pub(crate) use place::sides_of;
pub use scatter::GridAdjoint;
pub(crate) use shape::HASH;
pub use shape::{GridLevel, GridShape};

/// Points that are taken at once: the widest vector.
const LANES: usize = 16;

/// A number of each of these points.
type Lane = [f32; LANES];

/// Coordinates of a point.
const POINT: usize = 3;

/// Corners of a cell.
const CORNERS: usize = 8;

/// A call for each number of features that grids may have.
macro_rules! with_features {
    ($features:expr, $F:ident => $call:expr) => {
        match $features {
            1 => {
                const $F: usize = 1;
                $call
            }
            2 => {
                const $F: usize = 2;
                $call
            }
            4 => {
                const $F: usize = 4;
                $call
            }
            8 => {
                const $F: usize = 8;
                $call
            }
            other => unreachable!("GridShape::new allows no {other} features"),
        }
    };
}
use with_features;

/// The coordinates of up to [`LANES`] points, axis by axis; the origin beyond them.
fn lanes_of(points: &[[f32; POINT]]) -> [Lane; POINT] {
    let mut lanes = [[0.0; LANES]; POINT];
    for (lane, point) in points.iter().enumerate() {
        for axis in 0..POINT {
            lanes[axis][lane] = point[axis];
        }
    }
    lanes
}
