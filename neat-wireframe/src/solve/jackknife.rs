//! How sure a solution is: by leaving out one group of observations after the other.

use nalgebra::{DMatrix, DVector};

/// What a group of observations asks of a solution: the normal equations of a step from it.
pub(crate) struct NormalEquations {
    pub matrix: DMatrix<f64>,
    pub right: DVector<f64>,
}

/// The covariance of a solution, by how it would move without each group (the jackknife: Tukey
/// 1958), in one step of Newton's. Groups are independent, what they hold need not be. `None` if the
/// solution hangs on one of them.
pub(crate) fn jackknife(groups: &[NormalEquations]) -> Option<DMatrix<f64>> {
    let matrix: DMatrix<f64> = groups.iter().map(|group| &group.matrix).sum();
    let right: DVector<f64> = groups.iter().map(|group| &group.right).sum();
    let without = |group: &NormalEquations| {
        let cholesky = (&matrix - &group.matrix).cholesky()?;
        Some(cholesky.solve(&(&right - &group.right)))
    };
    let without: Vec<DVector<f64>> = groups.iter().map(without).collect::<Option<_>>()?;
    let count = without.len() as f64;
    let mean = without.iter().sum::<DVector<f64>>() / count;
    let spread: DMatrix<f64> = (without.iter().map(|moved| moved - &mean))
        .map(|off| &off * off.transpose())
        .sum();
    Some(spread * ((count - 1.0) / count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_mean_it_is_the_variance_over_the_count() {
        let values = [0.3, -1.2, 0.8, 2.1, 0.4];
        let groups = values.map(|value| NormalEquations {
            matrix: DMatrix::identity(1, 1),
            right: DVector::from_element(1, value),
        });
        let mean = values.iter().sum::<f64>() / 5.0;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let found = jackknife(&groups).unwrap()[(0, 0)];
        assert!((found - squares / 4.0 / 5.0).abs() < 1e-12, "{found}");
        assert!(jackknife(&groups[..1]).is_none());
    }
}
