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

/// A surface in the world whose scene ball is the unit ball.
pub(crate) struct UnitBallSurface<'a> {
    /// Asked in the original world.
    pub surface: &'a dyn SignedDistance,
    /// The original radius of the scene ball.
    pub scene_radius: f64,
}

impl UnitBallSurface<'_> {
    fn in_world(&self, points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        points.iter().map(|x| x * self.scene_radius).collect()
    }
}

impl SignedDistance for UnitBallSurface<'_> {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        let mut sdf = self.surface.sdf(&self.in_world(points));
        for distance in &mut sdf {
            *distance /= self.scene_radius;
        }
        sdf
    }

    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        // Distances and points scale alike: the gradient stays.
        let mut answers = self.surface.sdf_and_gradient(&self.in_world(points));
        for (distance, _) in &mut answers {
            *distance /= self.scene_radius;
        }
        answers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scaled_surface_answers_in_the_unit_of_the_radius() {
        /// A sphere of radius 2.
        struct Sphere;
        impl SignedDistance for Sphere {
            fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
                points.iter().map(|p| p.norm() - 2.0).collect()
            }
            fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
                points
                    .iter()
                    .map(|p| (p.norm() - 2.0, p.normalize()))
                    .collect()
            }
        }
        let surface = UnitBallSurface {
            surface: &Sphere,
            scene_radius: 4.0,
        };
        let point = [Vector3::x()];
        assert_eq!(surface.sdf(&point), [0.5]);
        assert_eq!(surface.sdf_and_gradient(&point), [(0.5, Vector3::x())]);
    }
}
