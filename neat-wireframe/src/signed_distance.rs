//! What the back end needs to know of a surface.

use nalgebra::Vector3;

/// A signed distance function: negative inside the surface.
///
/// Queries come in batches, so that a network can answer them well.
pub trait SignedDistance {
    /// The signed distance at each point.
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64>;

    /// Distance and its raw gradient (not normalised) at each point.
    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)>;
}
