//! Distances between point sets: accuracy (ACC) and completeness of the paper's
//! Tables 1, 4 and 5 (`evaluation/eval-lsr-bmvs.py`).

use super::MetricsError;
use crate::point_index::{PointIndex, TooManyPoints};
use crate::validity::is_finite;
use nalgebra::Vector3;
use neat_core::LineSegment3;
use rayon::prelude::*;

/// Points that can be asked for the nearest of them.
pub struct PointCloud {
    index: PointIndex,
}

impl PointCloud {
    /// Indexes `points`.
    ///
    /// # Errors
    /// If a point is not finite or there are more than fit the index.
    pub fn new(points: &[Vector3<f64>]) -> Result<Self, MetricsError> {
        if let Some(point) = points.iter().position(|p| !is_finite(p)) {
            return Err(MetricsError::NonFiniteSurface { point });
        }
        let index =
            PointIndex::new(points).map_err(|TooManyPoints| MetricsError::TooManyPoints {
                points: points.len(),
            })?;
        Ok(Self { index })
    }

    /// Distance from `point` to the nearest point of the cloud; `None` if the
    /// cloud is empty.
    pub fn distance(&self, point: &Vector3<f64>) -> Option<f64> {
        self.index.distance(point)
    }
}

/// Mean distance from the points of `from` to their nearest point of `to`,
/// without those that are `max_distance` or farther away.
///
/// Accuracy is the mean from samples of a wireframe to a scanned surface,
/// completeness the reverse. `None` if no distance counts.
pub fn mean_nearest_distance(
    from: &[Vector3<f64>],
    to: &PointCloud,
    max_distance: f64,
) -> Option<f64> {
    let distances: Vec<f64> = from
        .par_iter()
        .filter_map(|point| to.distance(point))
        .filter(|distance| *distance < max_distance)
        .collect();
    (!distances.is_empty()).then(|| distances.iter().sum::<f64>() / distances.len() as f64)
}

/// `per_segment` equidistant points on every segment, both ends included; the
/// start alone for 1.
pub fn sample_segments(segments: &[LineSegment3], per_segment: usize) -> Vec<Vector3<f64>> {
    let intervals = per_segment.saturating_sub(1).max(1) as f64;
    segments
        .iter()
        .flat_map(|segment| (0..per_segment).map(move |i| segment.point_at(i as f64 / intervals)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_points_are_ignored_and_nothing_has_no_mean() {
        let cloud = PointCloud::new(&[Vector3::zeros(), Vector3::new(1.0, 0.0, 0.0)]).unwrap();
        let from = [
            Vector3::new(0.0, 3.0, 0.0),
            Vector3::new(1.0, 0.0, 1.0),
            Vector3::new(0.0, 20.0, 0.0),
        ];
        assert_eq!(mean_nearest_distance(&from, &cloud, 20.0), Some(2.0));
        assert_eq!(mean_nearest_distance(&from[2..], &cloud, 20.0), None);
        assert_eq!(mean_nearest_distance(&[], &cloud, 20.0), None);
        let empty = PointCloud::new(&[]).unwrap();
        assert_eq!(mean_nearest_distance(&from, &empty, 20.0), None);
    }

    #[test]
    fn clouds_with_nan_are_refused() {
        let points = [Vector3::zeros(), Vector3::new(f64::NAN, 0.0, 0.0)];
        assert_eq!(
            PointCloud::new(&points).err(),
            Some(MetricsError::NonFiniteSurface { point: 1 })
        );
    }

    /// Scans of boxes have thousands of points with one equal coordinate, and
    /// repeated points: a trap for trees that split by coordinate.
    #[test]
    fn flat_and_repeated_points_give_the_brute_force_distance() {
        let mut points: Vec<Vector3<f64>> = (0..400)
            .map(|i| Vector3::new(f64::from(i % 20), f64::from(i / 20), 0.0))
            .collect();
        points.extend([Vector3::new(5.0, 5.0, 0.0); 200]);
        let cloud = PointCloud::new(&points).unwrap();
        for i in 0..200 {
            let t = f64::from(i);
            let query = Vector3::new((t * 0.37) % 23.0 - 2.0, (t * 0.73) % 23.0 - 2.0, t * 0.01);
            let nearest = points
                .iter()
                .map(|p| (p - query).norm())
                .fold(f64::INFINITY, f64::min);
            assert!((cloud.distance(&query).unwrap() - nearest).abs() < 1e-12);
        }
    }

    #[test]
    fn samples_include_both_ends() {
        let segment = LineSegment3::new(Vector3::zeros(), Vector3::new(4.0, 0.0, 0.0));
        let x: Vec<f64> = sample_segments(&[segment], 5).iter().map(|p| p.x).collect();
        assert_eq!(x, [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert_eq!(sample_segments(&[segment], 1), [Vector3::zeros()]);
        assert!(sample_segments(&[segment], 0).is_empty());
        assert!(sample_segments(&[], 32).is_empty());
    }
}
