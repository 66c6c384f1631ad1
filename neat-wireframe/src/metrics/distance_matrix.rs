//! Distances of everything in one list from everything in another.

use neat_core::assignment::{AssignmentError, assign};

/// A dense matrix of distances.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceMatrix {
    rows: usize,
    columns: usize,
    row_major: Vec<f64>,
}

impl DistanceMatrix {
    /// The matrix of `distance(a, b)` with a row per `a` and a column per `b`.
    pub fn between<A, B>(rows: &[A], columns: &[B], distance: impl Fn(&A, &B) -> f64) -> Self {
        Self {
            rows: rows.len(),
            columns: columns.len(),
            row_major: rows
                .iter()
                .flat_map(|a| columns.iter().map(move |b| (a, b)))
                .map(|(a, b)| distance(a, b))
                .collect(),
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The same matrix with `f` applied to every distance.
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Self {
            row_major: self.row_major.iter().map(|d| f(*d)).collect(),
            ..*self
        }
    }

    /// Pairs rows and columns one to one so that the sum of distances is
    /// smallest; pairs ascend by row.
    ///
    /// # Errors
    /// If a distance is not finite.
    pub fn assign(&self) -> Result<Vec<MatchedPair>, AssignmentError> {
        let assignment = assign(&self.row_major, self.rows, self.columns)?;
        Ok(assignment
            .pairs()
            .map(|(row, column)| MatchedPair {
                row,
                column,
                distance: self.row_major[row * self.columns + column],
            })
            .collect())
    }
}

/// A row and a column that were assigned to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchedPair {
    /// Index of the row.
    pub row: usize,
    /// Index of the column.
    pub column: usize,
    /// Their distance.
    pub distance: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn between(rows: &[f64], columns: &[f64]) -> DistanceMatrix {
        DistanceMatrix::between(rows, columns, |a, b| (a - b).abs())
    }

    #[test]
    fn pairs_have_the_smallest_sum_and_their_distance() {
        let pairs = between(&[5.0, 1.0, 9.0], &[1.5, 9.25]).assign().unwrap();
        let expected = [(1, 0, 0.5), (2, 1, 0.25)];
        assert_eq!(
            pairs,
            expected.map(|(row, column, distance)| MatchedPair {
                row,
                column,
                distance
            })
        );
    }

    #[test]
    fn empty_sides_have_no_pairs_and_nan_is_an_error() {
        for (rows, columns) in [(&[][..], &[1.0][..]), (&[1.0], &[]), (&[], &[])] {
            let matrix = between(rows, columns);
            assert_eq!(
                (matrix.rows(), matrix.columns()),
                (rows.len(), columns.len())
            );
            assert_eq!(matrix.assign(), Ok(vec![]));
        }
        assert!(between(&[1.0, f64::NAN], &[1.0]).assign().is_err());
    }
}
