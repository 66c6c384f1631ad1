//! Boxes in the cells of a lattice, at most one in each.

use crate::block_scene::{BlockScene, Purpose, stream};
use nalgebra::{Matrix3, Rotation3, Vector3};
use neat_core::{LineSegment3, Wireframe3d};
use rand::RngExt;

/// Half the sides of a box, in sides of its cell: a box turned by any angle and
/// jittered stays in its cell.
const HALF_SIDES: [f64; 2] = [0.2, 0.3];
/// Largest offset of a box from the middle of its cell, in sides of the cell.
const JITTER: f64 = 0.04;

/// One box.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
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

    pub fn segments(&self) -> impl Iterator<Item = LineSegment3> {
        Self::edges().map(|[a, b]| LineSegment3::new(self.corner(a), self.corner(b)))
    }
}

/// The boxes of a scene.
pub fn boxes(config: &BlockScene) -> Vec<Block> {
    let (cells_per_side, cells) = lattice(config.blocks);
    let side = 2.0 / cells_per_side as f64;
    let mut rng = stream(config.seed, 0, Purpose::Blocks);
    let of_cell = |cell| {
        let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let jitter = Vector3::from_fn(|_, _| uniform(-JITTER, JITTER) * side);
        let half_sides = Vector3::from_fn(|_, _| uniform(HALF_SIDES[0], HALF_SIDES[1]) * side);
        let max_yaw = config.max_yaw_in_degrees.to_radians();
        let yaw = Rotation3::from_axis_angle(&Vector3::z_axis(), uniform(-max_yaw, max_yaw));
        Block {
            center: cell_center(cell, cells_per_side) + jitter,
            half_sides,
            world_from_block: yaw.into_inner(),
        }
    };
    cells.into_iter().map(of_cell).collect()
}

/// Junctions and edges of all boxes.
pub fn wireframe(boxes: &[Block]) -> Wireframe3d {
    let corners = |block: &Block| (0..8).map(|i| block.corner(i)).collect::<Vec<_>>();
    let edges = |i: usize| Block::edges().map(move |edge| edge.map(|corner| 8 * i + corner));
    Wireframe3d {
        junctions: boxes.iter().flat_map(corners).collect(),
        edges: (0..boxes.len()).flat_map(edges).collect(),
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

    #[test]
    fn boxes_keep_apart_and_in_the_ball() {
        let config = BlockScene {
            blocks: 30,
            ..BlockScene::default()
        };
        let boxes = boxes(&config);
        let wireframe = wireframe(&boxes);
        assert_eq!(wireframe.junctions.len(), 240);
        assert_eq!(wireframe.edges.len(), 360);
        for (i, corner) in wireframe.junctions.iter().enumerate() {
            assert!(corner.norm() < 1.0);
            for (j, block) in boxes.iter().enumerate() {
                let local = block.world_from_block.tr_mul(&(corner - block.center));
                let beyond = (local.abs() - block.half_sides).max();
                assert!(if i / 8 == j {
                    beyond.abs() < 1e-12
                } else {
                    beyond > 0.0
                });
            }
        }
    }
}
