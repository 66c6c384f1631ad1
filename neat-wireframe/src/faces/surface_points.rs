//! Points of a sparse reconstruction as witnesses of surfaces.

use crate::projection::project_with_jacobian;
use crate::statistics::{SIGMA_BY_MEDIAN, upper_median};
use nalgebra::{Matrix3, Vector3};
use neat_core::{Camera, SparsePoint};

/// A point that lies on some surface, as far as it is known.
#[derive(Clone, Debug)]
pub struct SurfacePoint {
    /// Where it is.
    pub position: Vector3<f64>,
    /// Its covariance by the noise of all points in the images; `None` where the files do not say
    /// where it was seen, or only from one place: then it is as exact as a junction of which nobody
    /// knows more.
    pub covariance: Option<Matrix3<f64>>,
    /// The cameras that saw it: nothing was between them and the point.
    pub seen_from: Vec<Vector3<f64>>,
}

/// Sparse points with their noise, in the frame of the cameras, which are those of all views of
/// the scene in its order.
pub fn surface_points(cameras: &[Camera], points: &[SparsePoint]) -> Vec<SurfacePoint> {
    let (mut residuals, mut projected_points) = (Vec::new(), 0);
    let informations: Vec<Matrix3<f64>> = (points.iter())
        .map(|point| {
            let before = residuals.len();
            let mut information = Matrix3::zeros();
            for seen in &point.observations {
                let camera = cameras.get(seen.view);
                let projected = camera
                    .and_then(|camera| project_with_jacobian(camera, &point.position_in_world));
                if let Some((pixel, by_point)) = projected {
                    residuals.extend((pixel - seen.pixel).iter().map(|r| r.abs()));
                    information += by_point.transpose() * by_point;
                }
            }
            projected_points += usize::from(residuals.len() > before);
            information
        })
        .collect();
    // Each point has taken three of the numbers that speak of the noise: of the four of two views
    // one is left, and a single view says nothing.
    let count = residuals.len().max(1) as f64;
    let share_free = ((count - 3.0 * projected_points as f64) / count).max(0.25);
    let sigma = SIGMA_BY_MEDIAN * upper_median(&mut residuals) / share_free.sqrt();
    let with_covariance = |(point, information): (&SparsePoint, Matrix3<f64>)| SurfacePoint {
        position: point.position_in_world,
        covariance: information.try_inverse().map(|c| c * sigma.powi(2)),
        seen_from: (point.observations.iter())
            .filter_map(|seen| Some(cameras.get(seen.view)?.center_in_world))
            .collect(),
    };
    points
        .iter()
        .zip(informations)
        .map(with_covariance)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere};
    use nalgebra::Vector2;
    use neat_core::Observation;

    /// A point with its pixels moved, where their squared residuals are least.
    fn triangulated(cameras: &[Camera], noise: &mut Noise) -> (Vector3<f64>, SparsePoint) {
        let truth = 0.5 * noise.vector();
        let mut moved = || Vector2::from_fn(|_, _| 0.5 * noise.vector().sum());
        let (mut information, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let observations = (cameras.iter().enumerate())
            .map(|(view, camera)| {
                let (pixel, by_point) = project_with_jacobian(camera, &truth).unwrap();
                let off = moved();
                information += by_point.transpose() * by_point;
                right += by_point.transpose() * off;
                let pixel = pixel + off;
                Observation { view, pixel }
            })
            .collect();
        let position_in_world = truth + information.try_inverse().unwrap() * right;
        let point = SparsePoint {
            position_in_world,
            observations,
        };
        (truth, point)
    }

    #[test]
    fn covariances_are_those_of_the_errors() {
        let cameras = cameras_on_sphere(4);
        let mut noise = Noise(7);
        let (truths, mut points): (Vec<_>, Vec<_>) =
            (0..500).map(|_| triangulated(&cameras, &mut noise)).unzip();
        points.push(SparsePoint::unseen(Vector3::zeros()));
        let found = surface_points(&cameras, &points);
        let squared = |(point, truth): (&SurfacePoint, &Vector3<f64>)| {
            let error = point.position - truth;
            error.dot(&(point.covariance.unwrap().try_inverse().unwrap() * error))
        };
        let sum: f64 = found.iter().zip(&truths).map(squared).sum();
        let by_freedom = sum / (3.0 * truths.len() as f64);
        assert!((by_freedom - 1.0).abs() < 0.15, "{by_freedom}");
        assert_eq!(found[0].seen_from.len(), 4);
        assert!(found[500].covariance.is_none() && found[500].seen_from.is_empty());
    }
}
