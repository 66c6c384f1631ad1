//! Edges as points: the sampling and the down-sampling of the ABC-NEF protocols.

use crate::EvalError;
use crate::edge_model::EdgeModel;
use nalgebra::Vector3;
use neat_core::ground_truth::GroundTruth;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How edges become points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeSampling {
    /// As many points as the length holds whole spacings, both ends included: an
    /// edge shorter than the spacing has none, one shorter than two its start.
    Spacing(f64),
    /// So many points, both ends included, equidistant in the parameter.
    Count(usize),
    /// The ends of segments and the given points of curves, as they are.
    GivenPoints,
}

/// A grid whose cells are emptied to the mean of their points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct VoxelGrid {
    /// Edge length of a cell.
    pub cell: f64,
    /// A corner of the grid; `None` is the smallest coordinates of the points
    /// less half a cell.
    pub origin: Option<Vector3<f64>>,
}

impl VoxelGrid {
    /// The mean of the points of every cell, by ascending cell. Points outside of
    /// the box that a protocol names have cells too.
    pub fn averages(&self, points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let origin = self.origin.unwrap_or_else(|| {
            let smallest = points
                .iter()
                .fold(Vector3::repeat(f64::INFINITY), |min, p| min.inf(p));
            smallest.add_scalar(-0.5 * self.cell)
        });
        let mut cells: BTreeMap<[i64; 3], (Vector3<f64>, usize)> = BTreeMap::new();
        for point in points {
            let position = (point - origin) / self.cell;
            let cell = [position.x, position.y, position.z].map(|x| x.floor() as i64);
            let (sum, count) = cells.entry(cell).or_default();
            *sum += point;
            *count += 1;
        }
        cells
            .into_values()
            .map(|(sum, count)| sum / count as f64)
            .collect()
    }
}

/// More points than these are a mistake in the unit of the edges.
const MAX_POINTS: usize = 1 << 24;

/// Points of a prediction: curves first, then segments, as published.
///
/// # Errors
/// If the edges are so long that there would be more than 2²⁴ points.
pub fn sample_prediction(
    model: &EdgeModel,
    sampling: EdgeSampling,
) -> Result<Vec<Vector3<f64>>, EvalError> {
    let mut points = SampledPoints::new("result", sampling);
    for curve in &model.curves {
        points.add(
            &curve.control_points,
            || curve.length(),
            |t| curve.point_at(t),
        )?;
    }
    for segment in model.wireframe.segments() {
        points.add(
            &segment.ends(),
            || segment.length(),
            |t| segment.point_at(t),
        )?;
    }
    Ok(points.points)
}

/// Points of a truth: segments, then curves piece by piece.
///
/// A piece begins to be sampled at its second end, as published, which matters
/// only where a single point fits.
///
/// # Errors
/// As [`sample_prediction`].
pub fn sample_truth(
    truth: &GroundTruth,
    sampling: EdgeSampling,
) -> Result<Vec<Vector3<f64>>, EvalError> {
    let segments = truth.wireframe.segments();
    let segments = segments.iter().map(|segment| segment.ends().to_vec());
    let curves = truth.curves.iter().map(|curve| curve.points.clone());
    let mut points = SampledPoints::new("truth", sampling);
    for polyline in segments.chain(curves) {
        if sampling == EdgeSampling::GivenPoints {
            points.points.extend(polyline);
            continue;
        }
        for piece in polyline.windows(2) {
            let (start, end) = (piece[0], piece[1]);
            points.add(
                piece,
                || (end - start).norm(),
                |t| start * t + end * (1.0 - t),
            )?;
        }
    }
    Ok(points.points)
}

/// Points that are sampled edge by edge.
struct SampledPoints {
    what: &'static str,
    sampling: EdgeSampling,
    points: Vec<Vector3<f64>>,
}

impl SampledPoints {
    fn new(what: &'static str, sampling: EdgeSampling) -> Self {
        Self {
            what,
            sampling,
            points: Vec::new(),
        }
    }

    fn add(
        &mut self,
        given: &[Vector3<f64>],
        length: impl Fn() -> f64,
        point_at: impl Fn(f64) -> Vector3<f64>,
    ) -> Result<(), EvalError> {
        let count = match self.sampling {
            EdgeSampling::GivenPoints => {
                self.points.extend(given);
                return Ok(());
            }
            EdgeSampling::Count(count) => count,
            EdgeSampling::Spacing(spacing) => {
                let count = whole_spacings(length(), spacing);
                // An infinite length has NaN spacings, which no range contains.
                let room = MAX_POINTS.saturating_sub(self.points.len()) as f64;
                if !(0.0..=room).contains(&count) {
                    return Err(EvalError::TooManySamples {
                        what: self.what,
                        spacing,
                    });
                }
                count as usize
            }
        };
        // Both ends included; the first parameter alone for one.
        let intervals = count.saturating_sub(1).max(1) as f64;
        let parameters = (0..count).map(|i| i as f64 / intervals);
        self.points.extend(parameters.map(point_at));
        Ok(())
    }
}

/// Python's `length // spacing`: of the exact numbers, so that 1 holds 0.005, which
/// is a little more than that in binary, 199 times and not 200.
fn whole_spacings(length: f64, spacing: f64) -> f64 {
    ((length - length % spacing) / spacing).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::Wireframe3d;
    use neat_core::ground_truth::Curve;

    fn segment(length: f64) -> Wireframe3d {
        Wireframe3d {
            junctions: vec![Vector3::zeros(), Vector3::new(length, 0.0, 0.0)],
            edges: vec![[0, 1]],
        }
    }

    fn x(points: &[Vector3<f64>]) -> Vec<f64> {
        points.iter().map(|p| p.x).collect()
    }

    #[test]
    fn the_number_of_points_follows_the_length() {
        let sample = |length: f64| {
            let model = EdgeModel::from(segment(length));
            x(&sample_prediction(&model, EdgeSampling::Spacing(0.25)).unwrap())
        };
        assert_eq!(sample(1.0), [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0]);
        assert_eq!(sample(0.3), [0.0]);
        assert!(sample(0.2).is_empty());
    }

    #[test]
    fn edges_in_another_unit_do_not_fill_the_memory() {
        for length in [1e6, 1e300] {
            let model = EdgeModel::from(segment(length));
            let error = sample_prediction(&model, EdgeSampling::Spacing(0.005)).unwrap_err();
            assert!(error.to_string().contains("unit cube"), "{error}");
        }
    }

    #[test]
    fn spacings_are_counted_as_python_does() {
        // As printed by Python 3.11.
        for (length, spacings) in [(1.0, 199.0), (0.6, 119.0), (0.01, 2.0), (0.0049, 0.0)] {
            assert_eq!(whole_spacings(length, 0.005), spacings, "{length}");
        }
    }

    #[test]
    fn truth_is_sampled_piece_by_piece_from_the_second_end() {
        let truth = GroundTruth {
            wireframe: segment(0.3),
            curves: vec![Curve {
                kind: "Circle".into(),
                points: [0.0, 0.5, 0.6, 1.1]
                    .map(|x| Vector3::new(x, 1.0, 0.0))
                    .to_vec(),
            }],
        };
        let sampled = sample_truth(&truth, EdgeSampling::Spacing(0.25)).unwrap();
        // 0.3 holds one spacing; 0.5 two; 0.1 none; 0.5 again.
        assert_eq!(x(&sampled), [0.3, 0.5, 0.0, 1.1, 0.6]);
        let given = sample_truth(&truth, EdgeSampling::GivenPoints).unwrap();
        assert_eq!(x(&given), [0.0, 0.3, 0.0, 0.5, 0.6, 1.1]);
    }

    /// Compared with point-cloud-utils 0.34, which the protocols use.
    #[test]
    fn cells_are_averaged_outside_of_the_box_too() {
        let points = [0.1, 0.2, 0.9, 1.5, -0.3].map(|x| Vector3::new(x, 0.1, 0.1));
        let fixed = VoxelGrid {
            cell: 0.5,
            origin: Some(Vector3::zeros()),
        };
        let found = x(&fixed.averages(&points));
        let expected = [-0.3, 0.15, 0.9, 1.5];
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-15);
        }
        let points = [0.0, 0.3, 0.45, 0.55].map(|x| Vector3::new(x, 0.0, 0.0));
        let free = VoxelGrid {
            cell: 0.5,
            origin: None,
        };
        let found = x(&free.averages(&points));
        assert_eq!(found.len(), 2);
        assert!((found[1] - 1.3 / 3.0).abs() < 1e-15);
        assert!(free.averages(&[]).is_empty());
    }
}
