//! How sure a curve is of its place, as profiles tell.

use super::curve::Step;
use super::light::LightProfile;
use super::step_fit::{OffsetEquations, normal_equations};
use crate::assemble::arc_covariance::{MIN_VIEWS, SHAPES, SHARED_ERROR, shapes};
use crate::solve::{NormalEquations, jackknife};
use nalgebra::{DMatrix, SMatrix};

/// The covariance of the step of a curve, which is the `own` one of those that explain its
/// profiles, by leaving out one view after the other, and by what all views have in common. `None`
/// if too few views show it, or if it hangs on one of them.
pub(super) fn covariance<const N: usize>(
    profiles: &[&LightProfile<N>],
    steps: &[Step<N>],
    own: usize,
    blur: f64,
) -> Option<SMatrix<f64, N, N>> {
    let views: Vec<NormalEquations> = (profiles.chunk_by(|a, b| a.view == b.view))
        .map(|of_view| normal_equations(of_view, steps, blur))
        .collect();
    if views.len() < MIN_VIEWS {
        return None;
    }
    let matrix: DMatrix<f64> = views.iter().map(|view| &view.matrix).sum();
    let mut shared = DMatrix::zeros(N * steps.len(), SHAPES);
    for profile in profiles {
        let equations = OffsetEquations::new(profile, steps, blur);
        // Where a circle widens, outward.
        let outward = profile.by_shift.x.signum();
        for k in 0..steps.len() {
            let asked = outward * equations.hessian[(k, own)] * profile.by_step;
            for (shape, value) in shapes(profile.along).into_iter().enumerate() {
                let mut part = shared.fixed_view_mut::<N, 1>(N * k, shape);
                part += value * asked;
            }
        }
    }
    let moved = matrix.cholesky()?.solve(&shared) * SHARED_ERROR;
    let covariance = jackknife(&views)? + &moved * moved.transpose() / SHAPES as f64;
    (covariance.iter().all(|x| x.is_finite()))
        .then(|| covariance.fixed_view::<N, N>(N * own, N * own).into_owned())
}
