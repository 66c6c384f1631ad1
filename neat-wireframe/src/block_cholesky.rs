//! Cholesky decomposition of a sparse symmetric matrix of 3×3 blocks, one row of
//! blocks per junction.
//!
//! A wireframe joins a junction to three or four others: eliminated in the order
//! of least degree, it leaves little fill, and time and memory stay near linear.

use nalgebra::{Cholesky, Const, Matrix3, Vector3};
use std::collections::BTreeSet;

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

    /// Solves `H x = right` for the matrix with these blocks; several blocks of
    /// one pair add up. `None` where it is not positive definite.
    ///
    /// Every pair must be one of those given to [`Self::new`].
    pub(crate) fn solve(
        &self,
        diagonal: &[Matrix3<f64>],
        off_diagonal: &[OffDiagonal],
        right: &[Vector3<f64>],
    ) -> Option<Vec<Vector3<f64>>> {
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
        let factors = self.factorise(&mut diagonal, &mut below)?;

        let mut x: Vec<_> = self.order.iter().map(|i| right[*i]).collect();
        for column in 0..x.len() {
            factors[column]
                .l_dirty()
                .solve_lower_triangular_mut(&mut x[column]);
            for entry in self.begins[column]..self.begins[column + 1] {
                let known = below[entry] * x[column];
                x[self.rows[entry]] -= known;
            }
        }
        for column in (0..x.len()).rev() {
            for entry in self.begins[column]..self.begins[column + 1] {
                let known = below[entry].tr_mul(&x[self.rows[entry]]);
                x[column] -= known;
            }
            factors[column]
                .l_dirty()
                .tr_solve_lower_triangular_mut(&mut x[column]);
        }
        Some(self.place.iter().map(|place| x[*place]).collect())
    }

    /// Turns the blocks into those of the factor, column by column.
    fn factorise(
        &self,
        diagonal: &mut [Matrix3<f64>],
        below: &mut [Matrix3<f64>],
    ) -> Option<Vec<Cholesky<f64, Const<3>>>> {
        let mut factors = Vec::with_capacity(diagonal.len());
        for column in 0..diagonal.len() {
            let factor = diagonal[column].cholesky()?;
            let entries = self.begins[column]..self.begins[column + 1];
            for entry in entries.clone() {
                // X Lᵀ = A
                let mut transposed = below[entry].transpose();
                factor.l_dirty().solve_lower_triangular_mut(&mut transposed);
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
            factors.push(factor);
        }
        Some(factors)
    }

    /// Where the block in this row and column, both places, is kept.
    fn find(&self, row: usize, column: usize) -> usize {
        let begin = self.begins[column];
        let rows = &self.rows[begin..self.begins[column + 1]];
        begin + rows.partition_point(|other| *other < row)
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
    fn the_solution_is_that_of_the_full_matrix() {
        let pairs = graph(7);
        let example = example(49, &pairs);
        let mut noise = Noise(5);
        let right: Vec<_> = (0..49).map(|_| noise.vector()).collect();
        let solution = Elimination::new(49, pairs.into_iter())
            .solve(&example.diagonal, &example.off_diagonal, &right)
            .unwrap();
        let flat = DVector::from_iterator(147, right.iter().flatten().copied());
        let expected = example.full.cholesky().unwrap().solve(&flat);
        for (i, x) in solution.iter().enumerate() {
            assert!((x - expected.fixed_rows::<3>(3 * i)).norm() < 1e-9 * expected.norm());
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
        let right = [Vector3::x(); 2];
        assert_eq!(elimination.solve(&identity, &coupling, &right), None);
        assert_eq!(
            elimination.solve(&identity, &[], &right),
            Some(right.to_vec())
        );
        let nan = [Matrix3::repeat(f64::NAN); 2];
        assert_eq!(elimination.solve(&nan, &[], &right), None);
        let none = Elimination::new(0, std::iter::empty());
        assert_eq!(none.solve(&[], &[], &[]), Some(Vec::new()));
    }
}
