//! Sparse Cholesky decomposition of a graph's information matrix, by blocks of one
//! junction, and the blocks of its inverse on the diagonal.
//!
//! Junctions are eliminated in the order of least degree, which keeps the fill of
//! wireframe graphs near linear. The diagonal of the inverse follows from the
//! recursion of Takahashi, Fagan and Chen (1973), which needs the inverse only
//! where the factor has entries.

use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeMap, BTreeSet};

/// A symmetric matrix of one 3×3 block per junction and per pair of joined ones.
#[derive(Clone, Debug)]
pub(super) struct BlockMatrix {
    diagonal: Vec<Matrix3<f64>>,
    /// Row by row, both triangles.
    off_diagonal: Vec<BTreeMap<usize, Matrix3<f64>>>,
}

impl BlockMatrix {
    /// `scale` times the identity, for this many junctions.
    pub(super) fn identity(junctions: usize, scale: f64) -> Self {
        Self {
            diagonal: vec![Matrix3::identity() * scale; junctions],
            off_diagonal: vec![BTreeMap::new(); junctions],
        }
    }

    /// Adds a block on the diagonal.
    pub(super) fn add_diagonal(&mut self, junction: usize, block: &Matrix3<f64>) {
        self.diagonal[junction] += block;
    }

    /// Adds a block in row `a` and column `b`, and its transpose on the other side
    /// of the diagonal. The two must differ.
    pub(super) fn add_pair(&mut self, [a, b]: [usize; 2], block: &Matrix3<f64>) {
        *self.off_diagonal[a].entry(b).or_default() += block;
        *self.off_diagonal[b].entry(a).or_default() += block.transpose();
    }

    /// The decomposition, or `None` where the matrix is not positive definite.
    pub(super) fn factor(self) -> Option<BlockCholesky> {
        let Self {
            mut diagonal,
            mut off_diagonal,
        } = self;
        let mut by_degree: BTreeSet<(usize, usize)> = off_diagonal
            .iter()
            .enumerate()
            .map(|(junction, row)| (row.len(), junction))
            .collect();
        let mut columns = Vec::with_capacity(diagonal.len());
        while let Some((_, junction)) = by_degree.pop_first() {
            let inverse_pivot = diagonal[junction].cholesky()?.inverse();
            let row = std::mem::take(&mut off_diagonal[junction]);
            for &other in row.keys() {
                by_degree.remove(&(off_diagonal[other].len(), other));
                off_diagonal[other].remove(&junction);
            }
            let below: Vec<(usize, Matrix3<f64>)> = row
                .iter()
                .map(|(other, block)| (*other, block.tr_mul(&inverse_pivot)))
                .collect();
            for (a, lower) in &below {
                for (b, block) in &row {
                    let update = lower * block;
                    if a == b {
                        diagonal[*a] -= update;
                    } else {
                        *off_diagonal[*a].entry(*b).or_default() -= update;
                    }
                }
            }
            for &other in row.keys() {
                by_degree.insert((off_diagonal[other].len(), other));
            }
            columns.push(Column {
                junction,
                inverse_pivot,
                below,
            });
        }
        Some(BlockCholesky { columns })
    }
}

/// One eliminated junction.
#[derive(Clone, Debug)]
struct Column {
    junction: usize,
    /// Inverse of its block of D in L D Lᵀ.
    inverse_pivot: Matrix3<f64>,
    /// The blocks of L below the diagonal, by junction.
    below: Vec<(usize, Matrix3<f64>)>,
}

/// L D Lᵀ with blocks of one junction.
#[derive(Clone, Debug)]
pub(super) struct BlockCholesky {
    /// In the order of elimination.
    columns: Vec<Column>,
}

impl BlockCholesky {
    /// Solves `A x = b`.
    pub(super) fn solve(&self, right: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut x = right.to_vec();
        for column in &self.columns {
            let known = x[column.junction];
            for (other, lower) in &column.below {
                x[*other] -= lower * known;
            }
        }
        for column in self.columns.iter().rev() {
            let mut value = column.inverse_pivot * x[column.junction];
            for (other, lower) in &column.below {
                value -= lower.tr_mul(&x[*other]);
            }
            x[column.junction] = value;
        }
        x
    }

    /// The diagonal blocks of the inverse.
    pub(super) fn inverse_diagonal(&self) -> Vec<Matrix3<f64>> {
        let count = self.columns.len();
        let mut diagonal = vec![Matrix3::zeros(); count];
        let mut rows: Vec<BTreeMap<usize, Matrix3<f64>>> = vec![BTreeMap::new(); count];
        for column in self.columns.iter().rev() {
            let j = column.junction;
            let mut own = column.inverse_pivot;
            let mut found = Vec::with_capacity(column.below.len());
            for (k, lower_k) in &column.below {
                let mut block = -diagonal[*k] * lower_k;
                for (l, lower_l) in column.below.iter().filter(|(l, _)| l != k) {
                    // The eliminated junction has joined all its neighbours.
                    block -= rows[*k][l] * lower_l;
                }
                own -= lower_k.tr_mul(&block);
                found.push((*k, block));
            }
            diagonal[j] = 0.5 * (own + own.transpose());
            for (k, block) in found {
                rows[j].insert(k, block.transpose());
                rows[k].insert(j, block);
            }
        }
        diagonal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;
    use nalgebra::{DMatrix, DVector};

    /// A ring of junctions with some chords, and the same as a dense matrix.
    fn ring(junctions: usize) -> (BlockMatrix, DMatrix<f64>) {
        let mut noise = Noise(5);
        let mut sparse = BlockMatrix::identity(junctions, 0.5);
        let mut dense = DMatrix::identity(3 * junctions, 3 * junctions) * 0.5;
        let around = (0..junctions).map(|a| [a, (a + 1) % junctions]);
        let chords = (0..junctions / 3).map(|a| [a, (2 * a + 7) % junctions]);
        for [a, b] in around.chain(chords).filter(|[a, b]| a != b) {
            for _ in 0..3 {
                let (at_a, at_b) = (noise.vector(), noise.vector());
                sparse.add_diagonal(a, &(at_a * at_a.transpose()));
                sparse.add_diagonal(b, &(at_b * at_b.transpose()));
                sparse.add_pair([a, b], &(at_a * at_b.transpose()));
                let mut row = DVector::zeros(3 * junctions);
                row.fixed_rows_mut::<3>(3 * a).copy_from(&at_a);
                row.fixed_rows_mut::<3>(3 * b).copy_from(&at_b);
                dense += &row * row.transpose();
            }
        }
        (sparse, dense)
    }

    #[test]
    fn solution_and_inverse_agree_with_dense_algebra() {
        for junctions in [1, 2, 7, 40] {
            let (sparse, dense) = ring(junctions);
            let inverse = dense.try_inverse().unwrap();
            let factor = sparse.factor().unwrap();
            for (j, block) in factor.inverse_diagonal().iter().enumerate() {
                let expected = inverse.fixed_view::<3, 3>(3 * j, 3 * j);
                assert!((block - expected).amax() < 1e-9);
            }
            let mut noise = Noise(9);
            let right: Vec<_> = (0..junctions).map(|_| noise.vector()).collect();
            let flat = DVector::from_iterator(3 * junctions, right.iter().flatten().copied());
            let expected = inverse * flat;
            for (j, x) in factor.solve(&right).iter().enumerate() {
                assert!((x - expected.fixed_rows::<3>(3 * j)).amax() < 1e-9);
            }
        }
    }

    #[test]
    fn matrices_without_a_decomposition_have_none() {
        let mut indefinite = BlockMatrix::identity(3, 1.0);
        indefinite.add_pair([0, 2], &(Matrix3::identity() * 2.0));
        assert!(indefinite.factor().is_none());
        let mut broken = BlockMatrix::identity(2, 1.0);
        broken.add_diagonal(1, &Matrix3::repeat(f64::NAN));
        assert!(broken.factor().is_none());
        let empty = BlockMatrix::identity(0, 1.0).factor().unwrap();
        assert!(empty.inverse_diagonal().is_empty() && empty.solve(&[]).is_empty());
    }

    #[test]
    fn a_large_grid_takes_little_fill() {
        let side = 40;
        let mut grid = BlockMatrix::identity(side * side, 1.0);
        for row in 0..side {
            for column in 0..side - 1 {
                let along = row * side + column;
                let across = column * side + row;
                let block = -0.1 * Matrix3::identity();
                grid.add_pair([along, along + 1], &block);
                grid.add_pair([across, across + side], &block);
            }
        }
        let factor = grid.factor().unwrap();
        let entries: usize = factor.columns.iter().map(|c| c.below.len()).sum();
        assert!(entries < 14 * side * side, "{entries}");
    }
}
