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
    /// where it was seen.
    pub covariance: Option<Matrix3<f64>>,
    /// The cameras that saw it: nothing was between them and the point.
    pub seen_from: Vec<Vector3<f64>>,
}

/// Sparse points with their noise, in the frame of the cameras, which are those of all views of
/// the scene in its order.
pub fn surface_points(cameras: &[Camera], points: &[SparsePoint]) -> Vec<SurfacePoint> {
    let mut residuals = Vec::new();
    let informations: Vec<Matrix3<f64>> = (points.iter())
        .map(|point| {
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
            information
        })
        .collect();
    // Each point has taken three of the numbers that speak of the noise.
    let count = residuals.len().max(1) as f64;
    let share_free = ((count - 3.0 * points.len() as f64) / count).max(0.25);
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
