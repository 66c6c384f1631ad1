//! The normal equations of a graph: one 3×3 block per junction and per edge.

use crate::block_cholesky::Elimination;
use nalgebra::{Matrix3, Vector3};

/// `H x = g` of a least-squares problem whose unknowns are junctions and whose
/// residuals each touch the two junctions of one edge.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalEquations {
    /// The diagonal block of every junction.
    pub diagonal: Vec<Matrix3<f64>>,
    /// Pairs `[a, b]` of different junctions with the block in row a, column b;
    /// its transpose stands in row b, column a.
    pub off_diagonal: Vec<([usize; 2], Matrix3<f64>)>,
    /// Right-hand side.
    pub gradient: Vec<Vector3<f64>>,
}

impl NormalEquations {
    /// Without any residual yet.
    pub fn new(junctions: usize) -> Self {
        Self {
            diagonal: vec![Matrix3::zeros(); junctions],
            off_diagonal: Vec::new(),
            gradient: vec![Vector3::zeros(); junctions],
        }
    }

    /// Solves `(H + damping · (diag(H) + I)) x = g`, the step of
    /// Levenberg–Marquardt. `None` where that matrix is not positive definite.
    ///
    /// # Panics
    /// If a pair names a junction that does not exist.
    pub fn solve(&self, damping: f64) -> Option<Vec<Vector3<f64>>> {
        let pairs = self.off_diagonal.iter().map(|(pair, _)| *pair);
        self.solve_in_order(damping, &Elimination::new(self.diagonal.len(), pairs))
    }

    /// [`Self::solve`] where the order of elimination is known.
    pub(crate) fn solve_in_order(
        &self,
        damping: f64,
        elimination: &Elimination,
    ) -> Option<Vec<Vector3<f64>>> {
        let damped: Vec<Matrix3<f64>> = self
            .diagonal
            .iter()
            .map(|block| {
                block + Matrix3::from_diagonal(&block.diagonal().add_scalar(1.0)) * damping
            })
            .collect();
        elimination.solve(&damped, &self.off_diagonal, &self.gradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn untouched_junctions_do_not_move() {
        let mut equations = NormalEquations::new(3);
        equations.diagonal[1] = Matrix3::identity();
        equations.gradient[1] = Vector3::x();
        let step = equations.solve(0.5).unwrap();
        assert_eq!(step[0], Vector3::zeros());
        assert!((step[1] - Vector3::x() * 0.5).norm() < 1e-12);
        assert_eq!(NormalEquations::new(0).solve(0.1), Some(Vec::new()));
    }

    #[test]
    fn indefinite_matrices_have_no_solution() {
        let mut equations = NormalEquations::new(2);
        equations.diagonal[0] = -Matrix3::identity() * 5.0;
        equations.gradient[0] = Vector3::x();
        assert_eq!(equations.solve(0.1), None);
    }
}
