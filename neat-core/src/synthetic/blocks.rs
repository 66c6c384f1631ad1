//! Boxes in the cells of a lattice, at most one in each, so that the nearest one
//! is found at once.

use super::block_scene::BlockScene;
use super::random::{Purpose, stream};
use crate::{LineSegment3, Wireframe3d};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::RngExt;

/// Half the sides of a box, in sides of its cell: a box turned by any angle and
/// jittered stays in its cell.
const HALF_SIDES: [f64; 2] = [0.2, 0.3];
/// Largest offset of a box from the middle of its cell, in sides of the cell.
const JITTER: f64 = 0.04;

/// One box.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Block {
    pub center: Vector3<f64>,
    pub half_sides: Vector3<f64>,
    /// Its columns are the directions of the sides.
    pub world_from_block: Matrix3<f64>,
}

impl Block {
    /// The corner at the end of each side whose bit of `index` is set.
    fn corner(&self, index: usize) -> Vector3<f64> {
        let sign = Vector3::from_fn(|axis, _| if index >> axis & 1 == 1 { 1.0 } else { -1.0 });
        self.center + self.world_from_block * self.half_sides.component_mul(&sign)
    }

    /// The corners that each edge joins.
    fn edges() -> impl Iterator<Item = [usize; 2]> {
        (0..8).flat_map(|corner| {
            (0..3)
                .filter(move |axis| corner >> axis & 1 == 0)
                .map(move |axis| [corner, corner | 1 << axis])
        })
    }

    pub(super) fn segments(&self) -> impl Iterator<Item = LineSegment3> {
        Self::edges().map(|[a, b]| LineSegment3::new(self.corner(a), self.corner(b)))
    }

    /// Distance and its gradient in the world, a unit vector.
    fn sdf_and_gradient(&self, point: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let local = self.world_from_block.tr_mul(&(point - self.center));
        let beyond = local.abs() - self.half_sides;
        let outside = beyond.sup(&Vector3::zeros());
        let distance = outside.norm();
        let (distance, gradient) = if distance > 0.0 {
            (distance, outside / distance)
        } else {
            (beyond.max(), Vector3::ith(beyond.imax(), 1.0))
        };
        let signed = gradient.zip_map(&local, |slope, x| slope.copysign(x));
        (distance, self.world_from_block * signed)
    }
}

/// The boxes with their lattice.
#[derive(Clone, Debug)]
pub struct Blocks {
    pub(super) boxes: Vec<Block>,
    /// Cells along each side of the lattice, which spans [-1, 1]³.
    cells_per_side: usize,
    /// The box in each cell.
    box_of_cell: Vec<Option<u32>>,
}

impl Blocks {
    /// The boxes of a scene.
    pub(super) fn new(config: &BlockScene) -> Self {
        let (cells_per_side, cells) = lattice(config.blocks);
        let side = 2.0 / cells_per_side as f64;
        let mut rng = stream(config.seed, 0, Purpose::Blocks);
        let mut box_of_cell = vec![None; cells_per_side.pow(3)];
        let mut boxes = Vec::new();
        for (index, cell) in cells.into_iter().enumerate() {
            let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
            let jitter = Vector3::from_fn(|_, _| uniform(-JITTER, JITTER) * side);
            let half_sides = Vector3::from_fn(|_, _| uniform(HALF_SIDES[0], HALF_SIDES[1]) * side);
            let max_yaw = config.max_yaw_in_degrees.to_radians();
            let yaw = Rotation3::from_axis_angle(&Vector3::z_axis(), uniform(-max_yaw, max_yaw));
            boxes.push(Block {
                center: cell_center(cell, cells_per_side) + jitter,
                half_sides,
                world_from_block: yaw.into_inner(),
            });
            box_of_cell[cell] = Some(index as u32);
        }
        Self {
            boxes,
            cells_per_side,
            box_of_cell,
        }
    }

    /// Junctions and edges of all boxes.
    pub(super) fn wireframe(&self) -> Wireframe3d {
        let corners = |block: &Block| (0..8).map(|i| block.corner(i)).collect::<Vec<_>>();
        Wireframe3d {
            junctions: self.boxes.iter().flat_map(corners).collect(),
            edges: (0..self.boxes.len())
                .flat_map(|i| Block::edges().map(move |edge| edge.map(|corner| 8 * i + corner)))
                .collect(),
        }
    }

    /// Signed distance from the nearest box, negative inside, exact up to half
    /// the side of a lattice cell and never more than that, with its gradient
    /// (zero where the distance is cut off).
    pub fn sdf_and_gradient(&self, point: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let n = self.cells_per_side;
        let side = 2.0 / n as f64;
        let mut nearest = (0.5 * side, Vector3::zeros());
        // The two cells along each axis whose nearer half holds the point.
        let first = point.map(|x| ((x + 1.0) / side - 0.5).floor());
        for corner in 0..8 {
            let cell = Vector3::from_fn(|axis, _| first[axis] + f64::from(corner >> axis & 1));
            // NaN lies in no cell.
            if !cell.iter().all(|x| (0.0..n as f64).contains(x)) {
                continue;
            }
            let [x, y, z] = cell.map(|x| x as usize).into();
            if let Some(index) = self.box_of_cell[(z * n + y) * n + x] {
                let answer = self.boxes[index as usize].sdf_and_gradient(point);
                if answer.0 < nearest.0 {
                    nearest = answer;
                }
            }
        }
        nearest
    }

    /// The distance of [`Self::sdf_and_gradient`].
    pub fn sdf(&self, point: &Vector3<f64>) -> f64 {
        self.sdf_and_gradient(point).0
    }
}

/// The coarsest lattice over [-1, 1]³ with at least `count` cells in the unit
/// ball: its cells per side, and the innermost `count` of these cells.
fn lattice(count: usize) -> (usize, Vec<usize>) {
    (1..)
        .find_map(|n: usize| {
            let half_diagonal = 3f64.sqrt() / n as f64;
            let mut cells: Vec<(f64, usize)> = (0..n.pow(3))
                .map(|cell| (cell_center(cell, n).norm(), cell))
                .filter(|(distance, _)| n == 1 || distance + half_diagonal <= 1.0)
                .collect();
            (cells.len() >= count).then(|| {
                cells.sort_by(|a, b| a.0.total_cmp(&b.0));
                cells.truncate(count);
                (n, cells.into_iter().map(|(_, cell)| cell).collect())
            })
        })
        .unwrap_or_default()
}

fn cell_center(cell: usize, cells_per_side: usize) -> Vector3<f64> {
    let n = cells_per_side;
    Vector3::new(cell % n, cell / n % n, cell / (n * n))
        .map(|i| (2 * i + 1) as f64 / n as f64 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> BlockScene {
        BlockScene {
            blocks: 30,
            views: 4,
            ..BlockScene::default()
        }
    }

    #[test]
    fn distances_are_those_of_all_boxes_up_to_the_cut() {
        let blocks = Blocks::new(&small());
        let half_cell = 1.0 / blocks.cells_per_side as f64;
        let mut rng = stream(3, 0, Purpose::Noise);
        for _ in 0..2000 {
            let point = Vector3::from_fn(|_, _| 2.4 * rng.random::<f64>() - 1.2);
            let exact = blocks
                .boxes
                .iter()
                .map(|block| block.sdf_and_gradient(&point).0)
                .fold(f64::INFINITY, f64::min);
            let (distance, gradient) = blocks.sdf_and_gradient(&point);
            assert_eq!(distance, exact.min(half_cell));
            if distance < half_cell {
                let numeric = Vector3::from_fn(|axis, _| {
                    let step = Vector3::ith(axis, 1e-7);
                    (blocks.sdf(&(point + step)) - blocks.sdf(&(point - step))) / 2e-7
                });
                assert!((numeric - gradient).norm() < 1e-4, "{point}");
            }
        }
        assert!(blocks.sdf(&Vector3::repeat(f64::NAN)) > 0.0);
    }

    #[test]
    fn boxes_keep_apart_and_in_the_ball() {
        let data = small().generate().unwrap();
        assert_eq!(data.truth.junctions.len(), 240);
        assert_eq!(data.truth.edges.len(), 360);
        for (i, corner) in data.truth.junctions.iter().enumerate() {
            assert!(corner.norm() < 1.0);
            for (j, block) in data.blocks.boxes.iter().enumerate() {
                let distance = block.sdf_and_gradient(corner).0;
                assert!(if i / 8 == j {
                    distance.abs() < 1e-12
                } else {
                    distance > 0.0
                });
            }
        }
    }
}
