//! Steps moved to where they explain the profiles of all views best.
//!
//! Heights are those that are best for the places (variable projection: Golub and Pereyra 1973,
//! with the derivative of Kaufman 1975).

use super::curve::Step;
use super::light::LightProfile;
use super::step_model::{
    MAX_STEPS, NOISE_SQUARES, StepModel, loss, misfit, offset, step_derivative,
};
use crate::solve::{LeastSquares, NormalEquations, Options, minimise};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

const OPTIONS: Options = Options {
    max_iterations: 12,
    max_attempts: 5,
    initial_damping: 1e-2,
    min_damping: 1e-9,
    decrease: 0.2,
    relative_tolerance: 1e-4,
};
/// Damps what no profile tells of.
const RIDGE: f64 = 1e-9;

/// The steps where the sum of the losses of profiles is least, near those given, and that sum.
pub(super) fn fit_steps<const N: usize>(
    profiles: &[&LightProfile<N>],
    steps: Vec<Step<N>>,
    blur: f64,
) -> (Vec<Step<N>>, f64) {
    let (steps, summary) = minimise(&StepProblem { profiles, blur }, steps, &OPTIONS);
    (steps, summary.final_cost)
}

/// What profiles ask of all steps together: the normal equations of a change of them.
pub(super) fn normal_equations<const N: usize>(
    profiles: &[&LightProfile<N>],
    steps: &[Step<N>],
    blur: f64,
) -> NormalEquations {
    let size = N * steps.len();
    let mut matrix = DMatrix::zeros(size, size);
    let mut right = DVector::zeros(size);
    for profile in profiles {
        let by_offset = OffsetEquations::new(profile, steps, blur);
        let offset_by_step = profile.by_step;
        let square = offset_by_step * offset_by_step.transpose();
        for i in 0..steps.len() {
            for j in 0..steps.len() {
                let mut block = matrix.fixed_view_mut::<N, N>(N * i, N * j);
                block += by_offset.hessian[(i, j)] * square;
            }
            let mut part = right.fixed_rows_mut::<N>(N * i);
            part -= by_offset.gradient[i] * offset_by_step;
        }
    }
    NormalEquations { matrix, right }
}

struct StepProblem<'a, const N: usize> {
    profiles: &'a [&'a LightProfile<N>],
    blur: f64,
}

/// What a profile says about the offsets of steps, by its loss.
pub(super) struct OffsetEquations {
    pub hessian: SMatrix<f64, MAX_STEPS, MAX_STEPS>,
    gradient: SVector<f64, MAX_STEPS>,
}

impl OffsetEquations {
    pub(super) fn new<const N: usize>(
        profile: &LightProfile<N>,
        steps: &[Step<N>],
        blur: f64,
    ) -> Self {
        let model = StepModel::new(profile, steps, blur);
        // What of a moving step the others do not make up for; by its height.
        let changes: [[f64; _]; MAX_STEPS] = std::array::from_fn(|k| match steps.get(k) {
            Some(step) => model.rest(&step_derivative(offset(profile, step), blur)).0,
            None => [0.0; _],
        });
        let mut equations = Self {
            hessian: SMatrix::zeros(),
            gradient: SVector::zeros(),
        };
        let mut squares = 0.0;
        for light in &profile.light {
            let (rest, heights) = model.rest(light);
            squares += model.product(&rest, &rest);
            for i in 0..steps.len() {
                for j in 0..steps.len() {
                    let product = model.product(&changes[i], &changes[j]);
                    equations.hessian[(i, j)] += heights[i] * heights[j] * product;
                }
                equations.gradient[i] -= heights[i] * model.product(&changes[i], &rest);
            }
        }
        // Of the logarithm.
        let weight = (NOISE_SQUARES + squares).recip();
        equations.hessian *= weight;
        equations.gradient *= weight;
        equations
    }
}

impl<const N: usize> LeastSquares for StepProblem<'_, N> {
    type State = Vec<Step<N>>;
    type Equations = NormalEquations;

    fn cost(&self, steps: &Vec<Step<N>>) -> f64 {
        let of_profile = |profile: &&LightProfile<N>| loss(misfit(profile, steps, self.blur));
        self.profiles.iter().map(of_profile).sum()
    }

    fn linearise(&self, steps: &Vec<Step<N>>) -> Option<NormalEquations> {
        (!steps.is_empty()).then(|| normal_equations(self.profiles, steps, self.blur))
    }

    fn step(
        &self,
        steps: &Vec<Step<N>>,
        equations: &NormalEquations,
        damping: f64,
    ) -> Option<Vec<Step<N>>> {
        let mut damped = equations.matrix.clone();
        for k in 0..damped.nrows() {
            damped[(k, k)] += damping * damped[(k, k)] + RIDGE;
        }
        let change = damped.cholesky()?.solve(&equations.right);
        let moved = |(k, step): (usize, &Step<N>)| step + change.fixed_rows::<N>(N * k);
        Some(steps.iter().enumerate().map(moved).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::profiles::light::Response;
    use crate::assemble::profiles::test_profiles::Steps;
    use nalgebra::Vector4;

    const RESPONSE: Response = Response {
        exponent: 2.4,
        blur: 0.6,
    };

    fn seen(noise: f64) -> (Vec<Step<4>>, Vec<LightProfile<4>>) {
        let steps = vec![
            Vector4::new(0.001, -0.002, 0.004, 0.0),
            Vector4::new(0.023, 0.004, 0.0, 0.003),
        ];
        let heights = [[150.0, 120.0, 60.0], [-70.0, 60.0, 20.0]];
        let seen = Steps {
            steps: steps.iter().copied().zip(heights).collect(),
            response: RESPONSE,
            noise,
        };
        (steps, seen.in_light(9))
    }

    #[test]
    fn the_gradient_is_that_of_differences() {
        let (truth, profiles) = seen(3.0);
        let profiles: Vec<&LightProfile<4>> = profiles.iter().collect();
        let problem = StepProblem {
            profiles: &profiles,
            blur: RESPONSE.blur,
        };
        let aside = Vector4::new(0.002, 0.001, -0.001, 0.002);
        let steps: Vec<Step<4>> = truth.iter().map(|step| step + aside).collect();
        let gradient = -problem.linearise(&steps).unwrap().right;
        let scale = gradient.amax();
        for k in 0..8 {
            let cost = |change: f64| {
                let mut steps = steps.clone();
                steps[k / 4][k % 4] += change;
                problem.cost(&steps)
            };
            // The equations are those of half the cost.
            let difference = 0.5 * (cost(1e-6) - cost(-1e-6)) / 2e-6;
            let off = (gradient[k] - difference).abs();
            assert!(off < 1e-3 * scale, "{k}: {} {difference}", gradient[k]);
        }
    }

    #[test]
    fn steps_come_to_where_they_are() {
        let (truth, profiles) = seen(0.0);
        let profiles: Vec<&LightProfile<4>> = profiles.iter().collect();
        let aside = Vector4::new(0.004, -0.003, 0.0, 0.0);
        let start = truth.iter().map(|step| step + aside).collect();
        let (found, cost) = fit_steps(&profiles, start, RESPONSE.blur);
        for (found, truth) in found.iter().zip(&truth) {
            assert!((found - truth).norm() < 2e-4, "{found} {truth}");
        }
        assert!(cost < 1e-3 * profiles.len() as f64, "{cost}");
    }
}
