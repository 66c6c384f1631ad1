//! Linear least squares that outliers hardly move.

use super::Cauchy;
use nalgebra::{Const, DimMin, SMatrix, SVector};

/// What was found.
pub(crate) struct Reweighted<const N: usize> {
    /// The parameters x that make `row · x` the values.
    pub solution: SVector<f64, N>,
    /// Their covariance, if rows are independent.
    pub covariance: SMatrix<f64, N, N>,
}

/// Iteratively reweighted least squares under a Cauchy loss, from zero on: the parameters
/// that give the values of most rows. What no row tells of stays zero with a `ridge` above
/// zero, and without one there is no solution.
pub(crate) fn reweighted<const N: usize>(
    rows: &[(SVector<f64, N>, f64)],
    loss: Cauchy,
    ridge: f64,
) -> Option<Reweighted<N>>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    const ROUNDS: usize = 6;
    let mut solution = SVector::<f64, N>::zeros();
    let mut covariance = SMatrix::<f64, N, N>::zeros();
    for _ in 0..ROUNDS {
        let mut matrix = SMatrix::<f64, N, N>::identity() * ridge;
        let mut right = SVector::<f64, N>::zeros();
        let (mut squares, mut weights) = (0.0, 0.0);
        for (row, value) in rows {
            let squared_residual = (value - row.dot(&solution)).powi(2);
            let weight = loss.weight(squared_residual);
            matrix += weight * row * row.transpose();
            right += weight * *value * row;
            squares += weight * squared_residual;
            weights += weight;
        }
        let inverse = matrix.cholesky()?.inverse();
        solution = inverse * right;
        covariance = inverse * (squares / weights);
    }
    (solution.iter().all(|value| value.is_finite())).then_some(Reweighted {
        solution,
        covariance,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn outliers_do_not_move_the_solution() {
        let truth = Vector2::new(0.2, -0.1);
        let rows: Vec<(Vector2<f64>, f64)> = (0..60)
            .map(|k| {
                let angle = f64::from(k);
                let row = Vector2::new(angle.cos(), angle.sin());
                let outlier = if k % 10 == 0 { 5.0 } else { 0.0 };
                (row, row.dot(&truth) - outlier)
            })
            .collect();
        let found = reweighted(&rows, Cauchy { scale: 0.25 }, 1e-6).unwrap();
        assert!((found.solution - truth).norm() < 0.01, "{}", found.solution);
        assert!(found.covariance[(0, 0)] > 0.0 && found.covariance[(0, 0)] < 0.01);
        // One direction only.
        let same = [(Vector2::x(), 0.5); 9];
        assert!(reweighted(&same, Cauchy { scale: 0.25 }, 0.0).is_none());
    }
}
