//! The normal equations of a graph: one 3×3 block per junction and per edge.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Up to this many junctions a dense Cholesky factor is quicker than an
/// iteration.
const MAX_DENSE_JUNCTIONS: usize = 100;
/// The iteration stops when the residual has shrunk by this factor.
const RELATIVE_RESIDUAL: f64 = 1e-10;
/// Damped, preconditioned systems need far fewer steps.
const MAX_CONJUGATE_GRADIENT_STEPS: usize = 1000;

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
    pub fn solve(&self, damping: f64) -> Option<Vec<Vector3<f64>>> {
        let damped: Vec<Matrix3<f64>> = self
            .diagonal
            .iter()
            .map(|block| {
                block + Matrix3::from_diagonal(&block.diagonal().add_scalar(1.0)) * damping
            })
            .collect();
        if damped.len() <= MAX_DENSE_JUNCTIONS {
            self.solve_dense(&damped)
        } else {
            self.solve_sparse(&damped)
        }
    }

    /// Cholesky decomposition of the whole matrix.
    fn solve_dense(&self, damped_diagonal: &[Matrix3<f64>]) -> Option<Vec<Vector3<f64>>> {
        let unknowns = 3 * damped_diagonal.len();
        let mut matrix = DMatrix::zeros(unknowns, unknowns);
        for (i, block) in damped_diagonal.iter().enumerate() {
            matrix.fixed_view_mut::<3, 3>(3 * i, 3 * i).copy_from(block);
        }
        for ([a, b], block) in &self.off_diagonal {
            let mut view = matrix.fixed_view_mut::<3, 3>(3 * a, 3 * b);
            view += block;
            let mut view = matrix.fixed_view_mut::<3, 3>(3 * b, 3 * a);
            view += block.transpose();
        }
        let gradient = DVector::from_iterator(unknowns, self.gradient.iter().flatten().copied());
        let solution = matrix.cholesky()?.solve(&gradient);
        Some(
            (0..damped_diagonal.len())
                .map(|i| solution.fixed_rows::<3>(3 * i).into_owned())
                .collect(),
        )
    }

    /// Conjugate gradients, preconditioned by the inverse diagonal blocks.
    fn solve_sparse(&self, damped_diagonal: &[Matrix3<f64>]) -> Option<Vec<Vector3<f64>>> {
        let inverse_diagonal = damped_diagonal
            .iter()
            .map(|block| block.cholesky().map(|factor| factor.inverse()))
            .collect::<Option<Vec<_>>>()?;
        let precondition = |residual: &[Vector3<f64>]| multiply(&inverse_diagonal, residual);

        let mut solution = vec![Vector3::zeros(); self.gradient.len()];
        let mut residual = self.gradient.clone();
        let mut preconditioned = precondition(&residual);
        let mut direction = preconditioned.clone();
        let mut energy = dot(&residual, &preconditioned);
        let target = RELATIVE_RESIDUAL * RELATIVE_RESIDUAL * energy;
        for _ in 0..MAX_CONJUGATE_GRADIENT_STEPS {
            if energy <= target {
                break;
            }
            let mut image = multiply(damped_diagonal, &direction);
            for ([a, b], block) in &self.off_diagonal {
                image[*a] += block * direction[*b];
                image[*b] += block.tr_mul(&direction[*a]);
            }
            let curvature = dot(&direction, &image);
            if curvature.is_nan() || curvature <= 0.0 {
                return None;
            }
            let step = energy / curvature;
            for i in 0..solution.len() {
                solution[i] += step * direction[i];
                residual[i] -= step * image[i];
            }
            preconditioned = precondition(&residual);
            let next_energy = dot(&residual, &preconditioned);
            let keep = next_energy / energy;
            for (direction, preconditioned) in direction.iter_mut().zip(&preconditioned) {
                *direction = preconditioned + keep * *direction;
            }
            energy = next_energy;
        }
        Some(solution)
    }
}

fn multiply(blocks: &[Matrix3<f64>], vectors: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    blocks.iter().zip(vectors).map(|(b, v)| b * v).collect()
}

fn dot(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    /// Random residuals on a ring of junctions with some chords.
    fn ring(junctions: usize) -> NormalEquations {
        let mut noise = Noise(23);
        let mut equations = NormalEquations::new(junctions);
        let ring = (0..junctions).map(|a| [a, (a + 1) % junctions]);
        let chords = (0..junctions / 2).map(|a| [a, (a + junctions / 2) % junctions]);
        for [a, b] in ring.chain(chords) {
            let mut coupling = Matrix3::zeros();
            for _ in 0..4 {
                let (at_a, at_b) = (noise.vector(), noise.vector());
                equations.diagonal[a] += at_a * at_a.transpose();
                equations.diagonal[b] += at_b * at_b.transpose();
                coupling += at_a * at_b.transpose();
                equations.gradient[a] += at_a * noise.uniform();
            }
            equations.off_diagonal.push(([a, b], coupling));
        }
        equations
    }

    #[test]
    fn iteration_and_factorisation_agree() {
        let equations = ring(40);
        let damped: Vec<_> = equations
            .diagonal
            .iter()
            .map(|block| block + Matrix3::identity() * 1e-3)
            .collect();
        let dense = equations.solve_dense(&damped).unwrap();
        let sparse = equations.solve_sparse(&damped).unwrap();
        let scale = dot(&dense, &dense).sqrt();
        for (dense, sparse) in dense.iter().zip(&sparse) {
            assert!((dense - sparse).norm() < 1e-6 * scale);
        }
    }

    #[test]
    fn untouched_junctions_do_not_move() {
        for junctions in [3, 2 * MAX_DENSE_JUNCTIONS] {
            let mut equations = NormalEquations::new(junctions);
            equations.diagonal[1] = Matrix3::identity();
            equations.gradient[1] = Vector3::x();
            let step = equations.solve(0.5).unwrap();
            assert_eq!(step[0], Vector3::zeros());
            assert!((step[1] - Vector3::x() * 0.5).norm() < 1e-12);
        }
        assert_eq!(NormalEquations::new(0).solve(0.1), Some(Vec::new()));
    }

    #[test]
    fn indefinite_matrices_have_no_solution() {
        for junctions in [2, 2 * MAX_DENSE_JUNCTIONS] {
            let mut equations = NormalEquations::new(junctions);
            equations.diagonal[0] = -Matrix3::identity() * 5.0;
            equations.gradient[0] = Vector3::x();
            assert_eq!(equations.solve(0.1), None);
        }
    }
}
