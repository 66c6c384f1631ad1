//! What of a curve in space profiles ask for, straight or bent.

use super::profile::Sample;
use nalgebra::{SMatrix, SVector, Vector2};
use neat_core::Camera;

/// A change of the parameters of a curve, by which it moves across itself, in the unit of space.
pub(super) type Step<const N: usize> = SVector<f64, N>;

/// A curve that is placed by N parameters. At each of its places there are two directions across
/// it; a *shift* is how far it moves along both.
pub(super) trait Curve<const N: usize>: Sync {
    /// The shift at a place by the parameters.
    fn shift_by_step(&self, place: f64) -> SMatrix<f64, 2, N>;

    /// The step that shifts all of it alike.
    fn step_of_shift(&self, shift: &Vector2<f64>) -> Step<N>;

    /// Where a place is on the way from its start, -1, to its end, 1.
    fn along(&self, place: f64) -> f64;

    /// The place in its middle.
    fn middle(&self) -> f64;

    /// The places where it may move most.
    fn ends(&self) -> Vec<f64>;

    /// Samples of each of its parts that a view holds, at least [`MIN_SAMPLES`] or none.
    ///
    /// [`MIN_SAMPLES`]: super::profile::MIN_SAMPLES
    fn samples(&self, view: usize, camera: &Camera) -> Vec<Vec<Sample>>;
}
