//! How sure the centre and the radius of an arc are that no profiles place: by leaving out one view
//! after the other.
//!
//! Edgels along an arc are no witnesses of their own. What is off in a view, its pose, its light,
//! its focus, is off for all of them. Views are: how the circle would move without each of them
//! (the jackknife, in one step of Newton's) tells how it would move with others.

use super::circle_fitting::FoundArc;
use super::curve_samples::SPACING;
use super::edge_samples::Images;
use super::line_fitting::loss_of_reach;
use crate::solve::{NormalEquations, jackknife};
use nalgebra::{DMatrix, DVector, Matrix4, Matrix6, RowVector3, SMatrix, Vector6};
use neat_core::CircularArc;
use rayon::prelude::*;

/// Fewer views do not tell how they differ, judged.
pub(super) const MIN_VIEWS: usize = 4;
/// What all views have in common they do not tell: shading beside an edge, rendering and smoothing
/// move it a little along a stretch, in pixels. So do interpolation, and values that are taken for
/// light, where profiles place an arc: with half of it intervals of radii of parts hold .90 and .86
/// instead of .96 and .91.
pub(super) const SHARED_ERROR: f64 = 0.05;
/// It may be one all along an arc, tilted or bent: as many polynomials.
pub(super) const SHAPES: usize = 3;

/// These polynomials at a place along an arc, which reaches from -1 to 1.
pub(super) fn shapes(along: f64) -> [f64; SHAPES] {
    [1.0, along, 0.5 * (3.0 * along * along - 1.0)]
}

/// What the edgels of one view ask of a circle: the normal equations of its parameters, and how
/// each shape of an error, one pixel large, would change the right side.
struct Asked {
    matrix: Matrix6<f64>,
    right: Vector6<f64>,
    shared: SMatrix<f64, 6, SHAPES>,
}

impl Images<'_> {
    /// The covariance of centre and radius of an arc; `None` if too few views show it, or if it
    /// hangs on one of them.
    pub(super) fn covariance_of_arc(&self, found: &FoundArc) -> Option<Matrix4<f64>> {
        let asked = self.asked_by_views(found)?;
        let matrix: Matrix6<f64> = asked.iter().map(|view| view.matrix).sum();
        let views: Vec<NormalEquations> = (asked.iter())
            .map(|view| NormalEquations {
                matrix: DMatrix::from_iterator(6, 6, view.matrix.iter().copied()),
                right: DVector::from_iterator(6, view.right.iter().copied()),
            })
            .collect();
        let shared: SMatrix<f64, 6, SHAPES> = asked.iter().map(|view| view.shared).sum();
        let moved = matrix.cholesky()?.solve(&shared) * SHARED_ERROR;
        let covariance = jackknife(&views)? + moved * moved.transpose() / SHAPES as f64;
        (covariance.iter().all(|x| x.is_finite()))
            .then(|| covariance.fixed_view::<4, 4>(0, 0).into_owned())
    }

    /// What each view that shows a part of an arc asks of its circle.
    fn asked_by_views(&self, found: &FoundArc) -> Option<Vec<Asked>> {
        let sectors = self.speaking_sectors(&found.arc, found.pixel, 0.0, None)?;
        let in_view = |view| {
            let mut asked = None;
            let showing = (sectors.iter())
                .filter(|sector| sector.evidence.views().any(|other| other == view));
            for sector in showing {
                self.ask(view, &found.arc, sector.angles, &mut asked);
            }
            asked
        };
        let views = 0..self.views.len();
        let asked: Vec<Asked> = views.into_par_iter().filter_map(in_view).collect();
        (asked.len() >= MIN_VIEWS).then_some(asked)
    }

    /// Adds what a view asks by a part of an arc.
    fn ask(&self, view: usize, arc: &CircularArc, part: [f64; 2], asked: &mut Option<Asked>) {
        let loss = loss_of_reach(self.reach);
        let samples = self.samples_of_sector(view, arc, part, SPACING);
        let along = (part[0] + part[1] - arc.angles[0] - arc.angles[1]) / arc.sweep();
        let shapes = RowVector3::from(shapes(along));
        for (row, value) in
            self.rows_of_samples(arc, view, &samples.unwrap_or_default(), self.reach)
        {
            let weight = loss.weight(value * value);
            // Where the circle widens, outward.
            let outward = weight * row[3].signum();
            let asked = asked.get_or_insert(Asked {
                matrix: Matrix6::zeros(),
                right: Vector6::zeros(),
                shared: SMatrix::zeros(),
            });
            asked.matrix += weight * row * row.transpose();
            asked.right += weight * value * row;
            asked.shared += outward * row * shapes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::SHARED_ERROR;
    use crate::assemble::circle_fitting::tests::{arc, views_of_arcs};
    use std::f64::consts::TAU;

    /// Error and standard deviation of the radius, in pixels, where `count` views show it with
    /// errors of their own, even ones up to so many pixels.
    fn radius_found(count: usize, off: f64) -> (f64, Option<f64>) {
        let truth = arc(TAU);
        let pixel = views_of_arcs(1, |_| truth).images().views[0].pixel_size_at(&truth.center);
        let views = views_of_arcs(count, |camera| {
            let chaos = (1e4 * camera.center_in_world.x).sin() * 1e4;
            let mut moved = truth;
            moved.radius += off * pixel * (2.0 * chaos.rem_euclid(1.0) - 1.0);
            moved
        });
        let images = views.images();
        let all: Vec<usize> = (0..count).collect();
        let found = images.follow_arc(&arc(1.5), &all).unwrap();
        let covariance = images.covariance_of_arc(&found);
        let sigma = covariance.map(|covariance| covariance[(3, 3)].sqrt() / pixel);
        ((found.arc.radius - truth.radius).abs() / pixel, sigma)
    }

    #[test]
    fn views_that_differ_tell_how_sure_a_radius_is() {
        for off in [0.0, 0.1, 0.3] {
            let (error, sigma) = radius_found(36, off);
            let sigma = sigma.unwrap();
            // Of the mean of 36 even numbers, and of one error all along the circle.
            let [own, shared] = [off / 3.0_f64.sqrt() / 6.0, SHARED_ERROR / 3.0_f64.sqrt()];
            let expected = own.hypot(shared);
            assert!(
                (0.6 * expected..1.6 * expected).contains(&sigma),
                "{off}: {sigma}, not {expected}"
            );
            assert!(error < 3.0 * sigma, "{off}: {error}, {sigma}");
        }
        assert_eq!(radius_found(3, 0.1).1, None);
    }
}
