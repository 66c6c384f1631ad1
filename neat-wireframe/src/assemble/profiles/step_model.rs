//! A profile as a slope and steps of light.

use super::curve::Step;
use super::light::LightProfile;
use super::normal_distribution::{FLAT, shares_below};
use super::profile::{PLACES, REACH, places};
use nalgebra::{Cholesky, Const, SMatrix, SVector};
use std::f64::consts::PI;

/// So many steps at most: with one, two and four of them F1 at the least threshold is .419, .476
/// and .491 for a house (.482), .170, .249 and .274 for a façade (.271), .785, .784 and .764 for a
/// table (.784).
pub(super) const MAX_STEPS: usize = 3;
const COLUMNS: usize = 2 + MAX_STEPS;
/// What files are usually off by, in values: sensors and JPEG. With half of it too few profiles
/// of a house are understood, twice of it costs .01 to .03 of F1 at the least threshold.
pub(super) const NOISE: f64 = 3.0;
/// Sum of the squares of as much noise over a profile.
pub(super) const NOISE_SQUARES: f64 = 3.0 * PLACES as f64 * NOISE * NOISE;
/// Keeps heights finite where steps cannot be told apart.
const RIDGE: f64 = 1e-7;

/// How far a step lies beside the curve in a profile, in pixels.
pub(super) fn offset<const N: usize>(profile: &LightProfile<N>, step: &Step<N>) -> f64 {
    profile.by_step.dot(step)
}

/// A step of height 1, blurred by `blur` pixels.
pub(super) fn step_column(offset: f64, blur: f64) -> [f64; PLACES] {
    shares_below(places().map(|place| (place - offset) / blur))
}

/// Its derivative by its offset.
pub(super) fn step_derivative(offset: f64, blur: f64) -> [f64; PLACES] {
    let height = -(blur * (2.0 * PI).sqrt()).recip();
    places().map(|place| {
        let z = (place - offset) / blur;
        if z.abs() < FLAT {
            height * (-0.5 * z * z).exp()
        } else {
            0.0
        }
    })
}

/// The columns that explain a profile: level, slope and steps.
pub(super) struct StepModel {
    columns: [[f64; PLACES]; COLUMNS],
    used: usize,
    weights: [f64; PLACES],
    cholesky: Cholesky<f64, Const<COLUMNS>>,
}

impl StepModel {
    /// With steps at most [`MAX_STEPS`].
    pub(super) fn new<const N: usize>(
        profile: &LightProfile<N>,
        steps: &[Step<N>],
        blur: f64,
    ) -> Self {
        let mut offsets = [0.0; MAX_STEPS];
        for (of_step, step) in offsets.iter_mut().zip(steps) {
            *of_step = offset(profile, step);
        }
        Self::at(&profile.weights, &offsets[..steps.len()], blur)
    }

    /// With steps at some places across the curve, at most [`MAX_STEPS`].
    fn at(weights: &[f64; PLACES], offsets: &[f64], blur: f64) -> Self {
        let mut columns = [[0.0; PLACES]; COLUMNS];
        columns[0] = [1.0; PLACES];
        columns[1] = places().map(|place| place / REACH);
        for (column, offset) in columns[2..].iter_mut().zip(offsets) {
            *column = step_column(*offset, blur);
        }
        let used = 2 + offsets.len();
        let mut normal = SMatrix::<f64, COLUMNS, COLUMNS>::identity();
        for i in 0..used {
            for j in 0..=i {
                let product = product(weights, &columns[i], &columns[j]);
                normal[(i, j)] = product;
                normal[(j, i)] = product;
            }
            normal[(i, i)] += RIDGE;
        }
        Self {
            columns,
            used,
            weights: *weights,
            // Positive definite by the ridge.
            cholesky: Cholesky::new_unchecked(normal),
        }
    }

    /// What the columns do not explain of `values`, and the heights of the steps.
    pub(super) fn rest(&self, values: &[f64; PLACES]) -> ([f64; PLACES], [f64; MAX_STEPS]) {
        let mut right = SVector::<f64, COLUMNS>::zeros();
        for i in 0..self.used {
            right[i] = self.product(&self.columns[i], values);
        }
        self.cholesky.solve_mut(&mut right);
        let mut rest = *values;
        for i in 0..self.used {
            for (rest, column) in rest.iter_mut().zip(&self.columns[i]) {
                *rest -= right[i] * column;
            }
        }
        (rest, std::array::from_fn(|k| right[2 + k]))
    }

    /// The weighted product of two profiles.
    pub(super) fn product(&self, a: &[f64; PLACES], b: &[f64; PLACES]) -> f64 {
        product(&self.weights, a, b)
    }
}

/// Independent sums, which a processor adds at the same time.
const SUMS: usize = 5;
const _: () = assert!(PLACES.is_multiple_of(SUMS));

fn product(weights: &[f64; PLACES], a: &[f64; PLACES], b: &[f64; PLACES]) -> f64 {
    let mut sums = [0.0; SUMS];
    for k in (0..PLACES).step_by(SUMS) {
        for (j, sum) in sums.iter_mut().enumerate() {
            *sum += weights[k + j] * a[k + j] * b[k + j];
        }
    }
    sums.iter().sum()
}

/// The sum of the squares of what steps do not explain of a profile, by that of noise.
pub(super) fn misfit<const N: usize>(
    profile: &LightProfile<N>,
    steps: &[Step<N>],
    blur: f64,
) -> f64 {
    misfit_of(&StepModel::new(profile, steps, blur), profile)
}

/// Likewise, of a single step at a place across the curve.
pub(super) fn misfit_at<const N: usize>(profile: &LightProfile<N>, place: f64, blur: f64) -> f64 {
    misfit_of(&StepModel::at(&profile.weights, &[place], blur), profile)
}

fn misfit_of<const N: usize>(model: &StepModel, profile: &LightProfile<N>) -> f64 {
    let squares = profile.light.iter().map(|light| {
        let (rest, _) = model.rest(light);
        model.product(&rest, &rest)
    });
    squares.sum::<f64>() / NOISE_SQUARES
}

/// The loss of a profile by its misfit: how much it is off matters the less the more it is, since
/// something else is there then.
pub(super) fn loss(misfit: f64) -> f64 {
    misfit.ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::profiles::light::Response;
    use crate::assemble::profiles::test_profiles::Steps;
    use nalgebra::{DMatrix, DVector, Vector4};

    const RESPONSE: Response = Response {
        exponent: 2.4,
        blur: 0.6,
    };

    #[test]
    fn what_is_left_is_what_a_decomposition_leaves() {
        let seen = Steps {
            steps: vec![
                (
                    Vector4::new(0.001, -0.002, 0.001, 0.0),
                    [150.0, 120.0, 60.0],
                ),
                (Vector4::new(0.022, 0.004, 0.0, 0.002), [-90.0, 40.0, 20.0]),
            ],
            response: RESPONSE,
            noise: 4.0,
        };
        let tried = [
            Vector4::new(0.003, 0.0, 0.0, 0.0),
            Vector4::new(0.02, 0.0, 0.0, 0.0),
        ];
        for profile in seen.in_light(5) {
            let mut columns = vec![[1.0; PLACES], places().map(|place| place / REACH)];
            for step in &tried {
                columns.push(step_column(offset(&profile, step), RESPONSE.blur));
            }
            let root = |k: usize| profile.weights[k].sqrt();
            let matrix = DMatrix::from_fn(PLACES, columns.len(), |k, column| {
                root(k) * columns[column][k]
            });
            let svd = matrix.clone().svd(true, true);
            let squares = profile.light.iter().map(|light| {
                let values = DVector::from_fn(PLACES, |k, _| root(k) * light[k]);
                let heights = svd.solve(&values, 1e-9).unwrap();
                (values - &matrix * heights).norm_squared()
            });
            let expected = squares.sum::<f64>() / NOISE_SQUARES;
            let found = misfit(&profile, &tried, RESPONSE.blur);
            assert!(
                (found - expected).abs() < 1e-3 * expected,
                "{found} {expected}"
            );
        }
    }

    #[test]
    fn a_step_changes_by_its_derivative() {
        for offset in [-3.0, -0.2, 0.1, 2.7] {
            let [low, high] = [offset - 1e-5, offset + 1e-5].map(|at| step_column(at, 0.6));
            let derivative = step_derivative(offset, 0.6);
            for k in 0..PLACES {
                let difference = (high[k] - low[k]) / 2e-5;
                let found = derivative[k];
                assert!((found - difference).abs() < 1e-6, "{found} {difference}");
            }
        }
    }
}
