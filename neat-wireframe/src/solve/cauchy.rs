//! The robust loss of every adjustment.

/// The Cauchy loss `log(1 + (r / scale)²)` of a residual r: quadratic for small
/// residuals, and outliers hardly count (Triggs et al., *Bundle adjustment – a
/// modern synthesis*, 2000, section 3.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cauchy {
    /// Residuals beyond this are outliers; in their unit.
    pub scale: f64,
}

impl Cauchy {
    /// The loss of a residual.
    pub(crate) fn cost(self, residual: f64) -> f64 {
        (residual / self.scale).powi(2).ln_1p()
    }

    /// What a squared residual counts for in reweighted least squares: the
    /// derivative of the loss by `(r / scale)²`.
    pub(crate) fn weight(self, squared_residual: f64) -> f64 {
        1.0 / (1.0 + squared_residual / self.scale.powi(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_is_the_derivative_of_the_cost() {
        let loss = Cauchy { scale: 1.7 };
        let step = 1e-6;
        for residual in [0.0, 0.3, 2.0, 40.0_f64] {
            let numeric = (loss.cost(residual + step) - loss.cost(residual - step)) / (2.0 * step);
            let expected = 2.0 * residual / (1.7 * 1.7) * loss.weight(residual * residual);
            assert!((numeric - expected).abs() < 1e-8, "{numeric} {expected}");
        }
    }
}
