//! Cholesky decomposition of a sparse symmetric matrix of 3×3 blocks, one row of
//! blocks per junction, and the diagonal of its inverse.
//!
//! A wireframe joins a junction to three or four others: eliminated in the order
//! of least degree, it leaves little fill, and time and memory stay near linear.

use nalgebra::{Cholesky, Const, Matrix3, Vector3};
use std::collections::BTreeSet;
use std::ops::Range;

/// The order of elimination and the places of the blocks. It depends on the
/// graph alone and serves every matrix over it.
pub(crate) struct Elimination {
    /// The junctions in the order of elimination.
    order: Vec<usize>,
    /// The place of each junction in `order`.
    place: Vec<usize>,
    /// Where the blocks of each column begin in `rows`, by place, and where the
    /// last ones end.
    begins: Vec<usize>,
    /// The places of the rows of the factor below its diagonal, column by
    /// column, ascending.
    rows: Vec<usize>,
}

/// A block below the diagonal: the pair `[a, b]` of different junctions, and the
/// block in row a, column b. Its transpose stands in row b, column a.
pub(crate) type OffDiagonal = ([usize; 2], Matrix3<f64>);

impl Elimination {
    /// Minimum degree (Tinney and Walker 1967); of equal ones the first junction.
    ///
    /// Pairs must name two different junctions below `junctions`.
    pub(crate) fn new(junctions: usize, pairs: impl Iterator<Item = [usize; 2]>) -> Self {
        let mut neighbours = vec![BTreeSet::new(); junctions];
        for [a, b] in pairs {
            neighbours[a].insert(b);
            neighbours[b].insert(a);
        }
        let mut queue: BTreeSet<(usize, usize)> = (0..junctions)
            .map(|junction| (neighbours[junction].len(), junction))
            .collect();
        let mut order = Vec::with_capacity(junctions);
        let mut place = vec![0; junctions];
        let mut columns: Vec<BTreeSet<usize>> = Vec::with_capacity(junctions);
        while let Some((_, pivot)) = queue.pop_first() {
            place[pivot] = order.len();
            order.push(pivot);
            let column = std::mem::take(&mut neighbours[pivot]);
            // What hangs on the pivot hangs together once it is gone.
            for &junction in &column {
                let others = &mut neighbours[junction];
                queue.remove(&(others.len(), junction));
                others.remove(&pivot);
                others.extend(column.iter().filter(|other| **other != junction));
                queue.insert((others.len(), junction));
            }
            columns.push(column);
        }
        let mut begins = vec![0];
        let mut rows = Vec::new();
        for column in columns {
            let begin = rows.len();
            rows.extend(column.into_iter().map(|junction| place[junction]));
            rows[begin..].sort_unstable();
            begins.push(rows.len());
        }
        Self {
            order,
            place,
            begins,
            rows,
        }
    }

    /// Factorises the matrix with these blocks; several blocks of one pair add up.
    /// `None` where it is not positive definite.
    ///
    /// Every pair must be one of those given to [`Self::new`].
    pub(crate) fn factor(
        &self,
        diagonal: &[Matrix3<f64>],
        off_diagonal: &[OffDiagonal],
    ) -> Option<BlockCholesky<'_>> {
        let mut diagonal: Vec<_> = self.order.iter().map(|i| diagonal[*i]).collect();
        let mut below = vec![Matrix3::zeros(); self.rows.len()];
        for ([a, b], block) in off_diagonal {
            let (row, column) = (self.place[*a], self.place[*b]);
            if row > column {
                below[self.find(row, column)] += block;
            } else {
                below[self.find(column, row)] += block.transpose();
            }
        }
        let mut pivots = Vec::with_capacity(diagonal.len());
        for column in 0..diagonal.len() {
            let pivot = diagonal[column].cholesky()?;
            let entries = self.entries(column);
            for entry in entries.clone() {
                // X Lᵀ = A
                let mut transposed = below[entry].transpose();
                pivot.l_dirty().solve_lower_triangular_mut(&mut transposed);
                below[entry] = transposed.transpose();
            }
            for left in entries.clone() {
                let block = below[left];
                diagonal[self.rows[left]] -= block * block.transpose();
                for right in left + 1..entries.end {
                    let target = self.find(self.rows[right], self.rows[left]);
                    let product = below[right] * block.transpose();
                    below[target] -= product;
                }
            }
            pivots.push(pivot);
        }
        Some(BlockCholesky {
            elimination: self,
            pivots,
            below,
        })
    }

    /// The indices of a column's blocks in `rows`.
    fn entries(&self, column: usize) -> Range<usize> {
        self.begins[column]..self.begins[column + 1]
    }

    /// Where the block in this row and column, both places, is kept.
    fn find(&self, row: usize, column: usize) -> usize {
        let begin = self.begins[column];
        let rows = &self.rows[begin..self.begins[column + 1]];
        begin + rows.partition_point(|other| *other < row)
    }
}

/// The factor L of a matrix `L Lᵀ`.
pub(crate) struct BlockCholesky<'a> {
    elimination: &'a Elimination,
    /// The blocks on the diagonal, by place.
    pivots: Vec<Cholesky<f64, Const<3>>>,
    /// The blocks below it, as in [`Elimination::rows`].
    below: Vec<Matrix3<f64>>,
}

impl BlockCholesky<'_> {
    /// Solves `H x = right`.
    pub(crate) fn solve(&self, right: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let Elimination {
            order, place, rows, ..
        } = self.elimination;
        let mut x: Vec<_> = order.iter().map(|i| right[*i]).collect();
        for (column, pivot) in self.pivots.iter().enumerate() {
            pivot.l_dirty().solve_lower_triangular_mut(&mut x[column]);
            for entry in self.elimination.entries(column) {
                let known = self.below[entry] * x[column];
                x[rows[entry]] -= known;
            }
        }
        for (column, pivot) in self.pivots.iter().enumerate().rev() {
            for entry in self.elimination.entries(column) {
                let known = self.below[entry].tr_mul(&x[rows[entry]]);
                x[column] -= known;
            }
            pivot
                .l_dirty()
                .tr_solve_lower_triangular_mut(&mut x[column]);
        }
        place.iter().map(|place| x[*place]).collect()
    }

    /// The blocks of the inverse on its diagonal, by the recursion of Takahashi,
    /// Fagan and Chen (1973): it needs the inverse only where the factor has blocks.
    pub(crate) fn inverse_diagonal(&self) -> Vec<Matrix3<f64>> {
        let Elimination { place, rows, .. } = self.elimination;
        let mut diagonal = vec![Matrix3::zeros(); self.pivots.len()];
        let mut below = vec![Matrix3::zeros(); rows.len()];
        for (column, pivot) in self.pivots.iter().enumerate().rev() {
            let entries = self.elimination.entries(column);
            // The column of the factor with the identity on its diagonal.
            let unit: Vec<Matrix3<f64>> = (self.below[entries.clone()].iter())
                .map(|block| {
                    let mut transposed = block.transpose();
                    pivot
                        .l_dirty()
                        .tr_solve_lower_triangular_mut(&mut transposed);
                    transposed.transpose()
                })
                .collect();
            let rows = &rows[entries.clone()];
            let mut own = pivot.inverse();
            for (i, row) in rows.iter().enumerate() {
                let mut block = -diagonal[*row] * unit[i];
                for (j, other) in rows.iter().enumerate() {
                    // What hangs on the column hangs together: the block exists.
                    if other < row {
                        block -= below[self.elimination.find(*row, *other)] * unit[j];
                    } else if other > row {
                        block -= below[self.elimination.find(*other, *row)].tr_mul(&unit[j]);
                    }
                }
                own -= unit[i].tr_mul(&block);
                below[entries.start + i] = block;
            }
            diagonal[column] = 0.5 * (own + own.transpose());
        }
        place.iter().map(|place| diagonal[*place]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;
    use nalgebra::{DMatrix, DVector};

    /// A random positive definite matrix over a graph, as blocks and in full.
    struct Example {
        diagonal: Vec<Matrix3<f64>>,
        off_diagonal: Vec<OffDiagonal>,
        full: DMatrix<f64>,
    }

    fn example(junctions: usize, pairs: &[[usize; 2]]) -> Example {
        let mut noise = Noise(11);
        let mut diagonal = vec![Matrix3::identity() * 0.1; junctions];
        let mut off_diagonal = Vec::new();
        for [a, b] in pairs {
            for _ in 0..3 {
                let (at_a, at_b) = (noise.vector(), noise.vector());
                diagonal[*a] += at_a * at_a.transpose();
                diagonal[*b] += at_b * at_b.transpose();
                off_diagonal.push(([*a, *b], at_a * at_b.transpose()));
            }
        }
        let mut full = DMatrix::zeros(3 * junctions, 3 * junctions);
        for (i, block) in diagonal.iter().enumerate() {
            full.fixed_view_mut::<3, 3>(3 * i, 3 * i).copy_from(block);
        }
        for ([a, b], block) in &off_diagonal {
            let mut view = full.fixed_view_mut::<3, 3>(3 * a, 3 * b);
            view += block;
            let mut view = full.fixed_view_mut::<3, 3>(3 * b, 3 * a);
            view += block.transpose();
        }
        Example {
            diagonal,
            off_diagonal,
            full,
        }
    }

    /// A grid of junctions with some long chords.
    fn graph(side: usize) -> Vec<[usize; 2]> {
        let at = |x: usize, y: usize| y * side + x;
        let mut pairs = Vec::new();
        for y in 0..side {
            for x in 1..side {
                pairs.push([at(x, y), at(x - 1, y)]);
                pairs.push([at(y, x - 1), at(y, x)]);
            }
            pairs.push([at(y, 0), at(side - 1 - y, side - 1)]);
        }
        pairs
    }

    #[test]
    fn solution_and_inverse_are_those_of_the_full_matrix() {
        for (junctions, pairs) in [(49, graph(7)), (2, vec![[1, 0]]), (1, Vec::new())] {
            let example = example(junctions, &pairs);
            let inverse = example.full.try_inverse().unwrap();
            let mut noise = Noise(5);
            let right: Vec<_> = (0..junctions).map(|_| noise.vector()).collect();
            let flat = DVector::from_iterator(3 * junctions, right.iter().flatten().copied());
            let expected = &inverse * flat;
            let elimination = Elimination::new(junctions, pairs.into_iter());
            let factor = elimination
                .factor(&example.diagonal, &example.off_diagonal)
                .unwrap();
            for (i, x) in factor.solve(&right).iter().enumerate() {
                assert!((x - expected.fixed_rows::<3>(3 * i)).norm() < 1e-9 * expected.norm());
            }
            for (i, block) in factor.inverse_diagonal().iter().enumerate() {
                let expected = inverse.fixed_view::<3, 3>(3 * i, 3 * i);
                assert!((block - expected).norm() < 1e-9 * inverse.norm());
            }
        }
    }

    #[test]
    fn fill_stays_small() {
        let pairs = graph(40);
        let elimination = Elimination::new(1600, pairs.iter().copied());
        assert!(elimination.rows.len() < 10 * pairs.len());
        // A path has none.
        let path = (1..100).map(|i| [i - 1, i]);
        assert_eq!(Elimination::new(100, path).rows.len(), 99);
    }

    #[test]
    fn indefinite_and_empty_matrices() {
        let elimination = Elimination::new(2, [[0, 1]].into_iter());
        let coupling = [([0, 1], Matrix3::identity() * 2.0)];
        let identity = [Matrix3::identity(); 2];
        assert!(elimination.factor(&identity, &coupling).is_none());
        let right = [Vector3::x(); 2];
        let factor = elimination.factor(&identity, &[]).unwrap();
        assert_eq!(factor.solve(&right), right);
        assert_eq!(factor.inverse_diagonal(), identity);
        let nan = [Matrix3::repeat(f64::NAN); 2];
        assert!(elimination.factor(&nan, &[]).is_none());
        let none = Elimination::new(0, std::iter::empty());
        let factor = none.factor(&[], &[]).unwrap();
        assert!(factor.solve(&[]).is_empty() && factor.inverse_diagonal().is_empty());
    }
}
