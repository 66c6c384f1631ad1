//! The one damped least-squares driver of this crate.

/// A least-squares problem over some state, robust or not.
pub(crate) trait LeastSquares {
    /// What is sought.
    type State;
    /// The problem, linearised at a state.
    type Equations;

    /// What is to become least; infinite where a state is impossible.
    fn cost(&self, state: &Self::State) -> f64;

    /// `None` where the problem has no derivatives.
    fn linearise(&self, state: &Self::State) -> Option<Self::Equations>;

    /// The state that the damped equations lead to: the larger the damping, the
    /// nearer. `None` where they have no solution.
    fn step(
        &self,
        state: &Self::State,
        equations: &Self::Equations,
        damping: f64,
    ) -> Option<Self::State>;
}

/// When to stop, and how the damping follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Options {
    /// Accepted steps at most.
    pub max_iterations: usize,
    /// Attempts to find a damping under which a step lowers the cost.
    pub max_attempts: usize,
    /// Damping of the first attempt; ten times more after each failure.
    pub initial_damping: f64,
    /// The damping never falls below this.
    pub min_damping: f64,
    /// Factor of the damping after a success.
    pub decrease: f64,
    /// A smaller relative decrease of the cost is convergence.
    pub relative_tolerance: f64,
}

/// Why a minimisation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Termination {
    /// The cost hardly falls any more.
    Converged,
    /// No step that was tried lowers the cost: a minimum as far as numbers tell.
    NoDescent,
    /// The iterations were used up.
    MaxIterations,
    /// There is nothing to adjust, or no derivative to do it by.
    Undetermined,
}

/// What a minimisation did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Steps taken.
    pub iterations: usize,
    /// The cost at the start …
    pub initial_cost: f64,
    /// … and at the end, never higher.
    pub final_cost: f64,
    /// Why it ended.
    pub termination: Termination,
}

/// Levenberg–Marquardt (Marquardt, *An algorithm for least-squares estimation of
/// nonlinear parameters*, 1963) from `state` on.
pub(crate) fn minimise<P: LeastSquares>(
    problem: &P,
    mut state: P::State,
    options: &Options,
) -> (P::State, Summary) {
    let mut cost = problem.cost(&state);
    let mut summary = Summary {
        iterations: 0,
        initial_cost: cost,
        final_cost: cost,
        termination: Termination::MaxIterations,
    };
    let mut damping = options.initial_damping;
    while summary.iterations < options.max_iterations {
        let Some(equations) = problem.linearise(&state) else {
            summary.termination = Termination::Undetermined;
            break;
        };
        let lower = (0..options.max_attempts).find_map(|_| {
            let lower = (problem.step(&state, &equations, damping))
                .map(|moved| (problem.cost(&moved), moved))
                .filter(|(moved_cost, _)| *moved_cost < cost);
            if lower.is_none() {
                damping *= 10.0;
            }
            lower
        });
        let Some((lower_cost, moved)) = lower else {
            summary.termination = Termination::NoDescent;
            break;
        };
        let converged = cost - lower_cost < options.relative_tolerance * cost;
        (state, cost) = (moved, lower_cost);
        damping = (options.decrease * damping).max(options.min_damping);
        summary.iterations += 1;
        summary.final_cost = cost;
        if converged {
            summary.termination = Termination::Converged;
            break;
        }
    }
    (state, summary)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    const OPTIONS: Options = Options {
        max_iterations: 200,
        max_attempts: 8,
        initial_damping: 1e-3,
        min_damping: 1e-9,
        decrease: 0.3,
        relative_tolerance: 1e-12,
    };

    /// The valley of Rosenbrock: residuals `10 (y - x²)` and `1 - x`.
    struct Valley;

    impl LeastSquares for Valley {
        type State = Vector2<f64>;
        type Equations = (Matrix2<f64>, Vector2<f64>);

        fn cost(&self, at: &Vector2<f64>) -> f64 {
            (10.0 * (at.y - at.x * at.x)).powi(2) + (1.0 - at.x).powi(2)
        }

        fn linearise(&self, at: &Vector2<f64>) -> Option<Self::Equations> {
            let jacobian = Matrix2::new(-20.0 * at.x, 10.0, -1.0, 0.0);
            let residual = Vector2::new(10.0 * (at.y - at.x * at.x), 1.0 - at.x);
            at.x.is_finite()
                .then(|| (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&residual)))
        }

        fn step(
            &self,
            at: &Vector2<f64>,
            (hessian, gradient): &Self::Equations,
            damping: f64,
        ) -> Option<Vector2<f64>> {
            let damped = hessian + Matrix2::identity() * damping;
            Some(at - damped.cholesky()?.solve(gradient))
        }
    }

    #[test]
    fn the_valley_is_followed_to_its_end_and_the_summary_says_so() {
        let start = Vector2::new(-1.2, 1.0);
        let (end, summary) = minimise(&Valley, start, &OPTIONS);
        assert!((end - Vector2::new(1.0, 1.0)).norm() < 1e-6, "{end}");
        assert_eq!(summary.initial_cost, Valley.cost(&start));
        assert_eq!(summary.final_cost, Valley.cost(&end));
        assert!(summary.iterations > 3 && summary.iterations < 200);
        assert_ne!(summary.termination, Termination::MaxIterations);
    }

    #[test]
    fn every_end_has_its_reason() {
        let ended = |start: Vector2<f64>, options: &Options| {
            let (end, summary) = minimise(&Valley, start, options);
            (end, summary.iterations, summary.termination)
        };
        let start = Vector2::new(-1.2, 1.0);
        let brief = Options {
            max_iterations: 2,
            ..OPTIONS
        };
        let (_, iterations, termination) = ended(start, &brief);
        assert_eq!((iterations, termination), (2, Termination::MaxIterations));
        let coarse = Options {
            relative_tolerance: 1.0,
            ..OPTIONS
        };
        let (_, iterations, termination) = ended(start, &coarse);
        assert_eq!((iterations, termination), (1, Termination::Converged));
        let minimum = Vector2::new(1.0, 1.0);
        let at_rest = (minimum, 0, Termination::NoDescent);
        assert_eq!(ended(minimum, &OPTIONS), at_rest);
        let (_, iterations, termination) = ended(Vector2::repeat(f64::NAN), &OPTIONS);
        assert_eq!((iterations, termination), (0, Termination::Undetermined));
    }
}
