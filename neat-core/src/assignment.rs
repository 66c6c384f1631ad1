//! Rectangular minimum-cost assignment by shortest augmenting paths.
//!
//! The algorithm of Jonker and Volgenant, "A shortest augmenting path algorithm
//! for dense and sparse linear assignment problems" (Computing 38, 1987), in the
//! rectangular form of Crouse, "On implementing 2D rectangular assignment
//! algorithms" (IEEE TAES 52, 2016), which SciPy uses too: O(n² m) for n ≤ m.

use thiserror::Error;

/// A matching of rows and columns of least total cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Assignment {
    /// The column of each row. Of a matrix with more rows than columns, the rows
    /// left over have `None`; otherwise every row has a column.
    pub column_of_row: Vec<Option<usize>>,
    /// Sum of the matched costs, added in the order of rows.
    pub total_cost: f64,
}

impl Assignment {
    /// The matched pairs `(row, column)`, rows ascending.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.column_of_row
            .iter()
            .enumerate()
            .filter_map(|(row, column)| column.map(|column| (row, column)))
    }
}

/// Why a cost matrix cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum AssignmentError {
    /// The slice does not have `rows * columns` elements.
    #[error("a cost matrix of {rows} rows and {columns} columns cannot have {len} elements")]
    Len {
        /// Rows asked for.
        rows: usize,
        /// Columns asked for.
        columns: usize,
        /// Elements given.
        len: usize,
    },
    /// NaN, infinite, or so large that sums of costs could overflow.
    #[error("cost {value} at row {row}, column {column} is not a number within ±1e150")]
    Cost {
        /// Row of the first such cost.
        row: usize,
        /// Its column.
        column: usize,
        /// The cost.
        value: f64,
    },
}

/// Costs beyond this are refused, so that path lengths stay finite.
const MAX_COST: f64 = 1e150;

/// Matches rows with columns one to one, as many as the shorter side has, so that
/// the sum of the costs is least.
///
/// `cost` is row-major, [rows, columns]. Of several best matchings the same one is
/// returned every time; which one is not specified.
///
/// # Errors
/// If the slice does not fit the shape, or a cost is NaN, infinite or beyond
/// ±1e150.
///
/// # Example
/// ```
/// use neat_core::assignment::assign;
/// let best = assign(&[4.0, 1.0, 3.0, 2.0, 0.0, 5.0], 2, 3)?;
/// assert_eq!(best.column_of_row, [Some(1), Some(0)]);
/// assert_eq!(best.total_cost, 3.0);
/// # Ok::<(), neat_core::assignment::AssignmentError>(())
/// ```
pub fn assign(cost: &[f64], rows: usize, columns: usize) -> Result<Assignment, AssignmentError> {
    if rows.checked_mul(columns) != Some(cost.len()) {
        let len = cost.len();
        return Err(AssignmentError::Len { rows, columns, len });
    }
    let unusable = |c: &f64| c.is_nan() || c.abs() > MAX_COST;
    if let Some(index) = cost.iter().position(unusable) {
        return Err(AssignmentError::Cost {
            row: index / columns,
            column: index % columns,
            value: cost[index],
        });
    }

    let mut column_of_row = vec![None; rows];
    if rows <= columns {
        for (row, column) in match_every_row(cost, rows, columns).into_iter().enumerate() {
            column_of_row[row] = Some(column);
        }
    } else {
        let transposed: Vec<f64> = (0..cost.len())
            .map(|i| cost[i % rows * columns + i / rows])
            .collect();
        for (column, row) in match_every_row(&transposed, columns, rows)
            .into_iter()
            .enumerate()
        {
            column_of_row[row] = Some(column);
        }
    }
    let mut assignment = Assignment {
        column_of_row,
        total_cost: 0.0,
    };
    assignment.total_cost = assignment
        .pairs()
        .map(|(row, column)| cost[row * columns + column])
        .sum();
    Ok(assignment)
}

/// The column of each row, for `rows <= columns`.
fn match_every_row(cost: &[f64], rows: usize, columns: usize) -> Vec<usize> {
    let mut search = Search {
        cost,
        columns,
        row_potential: vec![0.0; rows],
        column_potential: vec![0.0; columns],
        column_of_row: vec![None; rows],
        row_of_column: vec![None; columns],
        distance: vec![0.0; columns],
        row_before: vec![0; columns],
        open: Vec::with_capacity(columns),
        closed: Vec::with_capacity(columns),
    };
    for row in 0..rows {
        search.augment(row);
    }
    let matched = search
        .column_of_row
        .into_iter()
        .flatten()
        .collect::<Vec<_>>();
    assert_eq!(
        matched.len(),
        rows,
        "match_every_row: {rows} rows, {columns} columns"
    );
    matched
}

/// The state of the successive shortest path searches.
struct Search<'a> {
    cost: &'a [f64],
    columns: usize,
    row_potential: Vec<f64>,
    column_potential: Vec<f64>,
    column_of_row: Vec<Option<usize>>,
    row_of_column: Vec<Option<usize>>,
    /// Length of the shortest path found to each column.
    distance: Vec<f64>,
    /// The row before each column on that path.
    row_before: Vec<usize>,
    /// Columns whose shortest path is not final.
    open: Vec<usize>,
    /// Columns whose shortest path is final, nearest first.
    closed: Vec<usize>,
}

impl Search<'_> {
    /// Gives `start` a column by the shortest augmenting path.
    fn augment(&mut self, start: usize) {
        let (sink, length) = self.shortest_path(start);

        self.row_potential[start] += length;
        for &column in &self.closed {
            let slack = length - self.distance[column];
            self.column_potential[column] -= slack;
            if let Some(row) = self.row_of_column[column] {
                self.row_potential[row] += slack;
            }
        }

        let mut column = sink;
        loop {
            let row = self.row_before[column];
            self.row_of_column[column] = Some(row);
            match self.column_of_row[row].replace(column) {
                Some(previous) => column = previous,
                // Only `start` had no column yet.
                None => return,
            }
        }
    }

    /// Dijkstra on reduced costs from row `start` to the nearest free column; the
    /// columns on the way are left in `closed`. Returns that column and its
    /// distance.
    fn shortest_path(&mut self, start: usize) -> (usize, f64) {
        self.distance.fill(f64::INFINITY);
        self.open.clear();
        self.open.extend(0..self.columns);
        self.closed.clear();

        let (mut row, mut length) = (start, 0.0);
        loop {
            let mut nearest = 0;
            let mut nearest_key = (f64::INFINITY, true);
            for (position, &column) in self.open.iter().enumerate() {
                let reduced = self.cost[row * self.columns + column]
                    - self.row_potential[row]
                    - self.column_potential[column];
                if length + reduced < self.distance[column] {
                    self.distance[column] = length + reduced;
                    self.row_before[column] = row;
                }
                // Of equally near columns a free one ends the search.
                let key = (self.distance[column], self.row_of_column[column].is_some());
                if key < nearest_key {
                    (nearest, nearest_key) = (position, key);
                }
            }
            let column = self.open.swap_remove(nearest);
            length = self.distance[column];
            match self.row_of_column[column] {
                None => return (column, length),
                Some(matched) => row = matched,
            }
            self.closed.push(column);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pathfinding::kuhn_munkres::kuhn_munkres_min;
    use pathfinding::matrix::Matrix;
    use proptest::prelude::*;

    fn total(cost: &[f64], rows: usize, columns: usize) -> f64 {
        let assignment = assign(cost, rows, columns).unwrap();
        assert_eq!(assignment.column_of_row.len(), rows);
        let mut used: Vec<_> = assignment.pairs().map(|(_, column)| column).collect();
        used.sort_unstable();
        used.dedup();
        assert_eq!(used.len(), rows.min(columns), "one to one");
        assignment.total_cost
    }

    /// The least cost over all injections of the rows from `row` on.
    fn brute_force(cost: &[f64], rows: usize, columns: usize, row: usize, used: u32) -> f64 {
        if row == rows {
            return 0.0;
        }
        (0..columns)
            .filter(|column| used & (1 << column) == 0)
            .map(|column| {
                cost[row * columns + column]
                    + brute_force(cost, rows, columns, row + 1, used | (1 << column))
            })
            .fold(f64::INFINITY, f64::min)
    }

    fn matrix(
        entry: impl Strategy<Value = i64>,
        side: usize,
    ) -> impl Strategy<Value = (usize, usize, Vec<i64>)> {
        let shape = (1..=side, 1..=side);
        let entries = prop::collection::vec(entry, side * side);
        (shape, entries).prop_map(|((a, b), mut entries)| {
            let (rows, columns) = (a.min(b), a.max(b));
            entries.truncate(rows * columns);
            (rows, columns, entries)
        })
    }

    /// Compares with an independent implementation, on costs that are exact in
    /// both; and the transposed problem with this one.
    fn check((rows, columns, entries): (usize, usize, Vec<i64>)) -> Result<(), TestCaseError> {
        let cost: Vec<f64> = entries.iter().map(|&e| e as f64 / 1024.0).collect();
        let oracle = Matrix::from_vec(rows, columns, entries).unwrap();
        let (expected, _) = kuhn_munkres_min(&oracle);
        prop_assert_eq!(total(&cost, rows, columns), expected as f64 / 1024.0);
        let transposed: Vec<f64> = (0..columns)
            .flat_map(|column| cost.iter().skip(column).step_by(columns).copied())
            .collect();
        prop_assert_eq!(total(&transposed, columns, rows), expected as f64 / 1024.0);
        Ok(())
    }

    proptest! {
        #[test]
        fn equals_the_oracle_where_ties_abound(problem in matrix(0i64..5, 20)) {
            check(problem)?;
        }

        #[test]
        fn equals_the_oracle_on_wide_ranges(problem in matrix(-(1i64 << 40)..1 << 40, 30)) {
            check(problem)?;
        }

        #[test]
        fn equals_brute_force(problem in matrix(-9i64..9, 6)) {
            let (rows, columns, entries) = problem;
            let cost: Vec<f64> = entries.iter().map(|&e| e as f64).collect();
            prop_assert_eq!(total(&cost, rows, columns), brute_force(&cost, rows, columns, 0, 0));
        }
    }

    #[test]
    fn empty_sides_match_nothing() {
        assert_eq!(assign(&[], 0, 5).unwrap().column_of_row, []);
        assert_eq!(assign(&[], 2, 0).unwrap().column_of_row, [None, None]);
    }

    #[test]
    fn bad_costs_are_named() {
        let error = assign(&[0.0, 1.0, 2.0, f64::NAN], 2, 2).unwrap_err();
        assert!(matches!(
            error,
            AssignmentError::Cost {
                row: 1,
                column: 1,
                ..
            }
        ));
        assert!(assign(&[f64::INFINITY], 1, 1).is_err());
        assert!(assign(&[1e200], 1, 1).is_err());
        assert!(matches!(
            assign(&[0.0], usize::MAX, 2),
            Err(AssignmentError::Len { len: 1, .. })
        ));
    }
}
