//! NEAT on DTU and BlendedMVS: how near junctions and segments are to scanned
//! surfaces.
//!
//! Source: NEAT (CVPR 2024) §5.1, Tables 1, 4 and 5, eq. 9; on DTU
//! `evaluation/eval-lsr-dtu.py` and `eval-wfr-dtu.py` of cherubicXN/neat, which
//! take the official protocol over from jzhangbs/DTUeval-python; on BlendedMVS
//! `evaluation/eval-lsr-bmvs.py`. Lower is better.
//!
//! 32 points are sampled on every segment. On DTU they are thinned to 0.2 mm;
//! those in cells that the scanner did not see do not count for accuracy, and
//! surface points below the table not for completeness. Distances of 20 mm and
//! more are no part of any mean. On BlendedMVS nothing is thinned or masked.

use crate::EvalError;
use crate::counts::WireframeCounts;
use crate::observation_mask::{GroundPlane, ObservationMask};
use crate::table::{Table, distance};
use crate::thinning::thin_points;
use nalgebra::Vector3;
use neat_core::Wireframe3d;
use neat_wireframe::metrics::{MetricsError, PointCloud, mean_nearest_distance, sample_segments};
use neat_wireframe::validity::check_wireframe;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// What to measure, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NeatSurface {
    /// Samples per segment, both ends included.
    pub samples_per_segment: usize,
    /// Samples that have another one this near are left out; `None` keeps all.
    pub thinning: Option<f64>,
    /// Distances that are this long or longer are ignored.
    pub max_distance: f64,
    /// Seed of the random order in which samples are thinned.
    pub seed: u64,
}

impl Default for NeatSurface {
    fn default() -> Self {
        Self::dtu()
    }
}

/// A scanned surface, in the frame of the result.
#[derive(Clone, Debug, Default)]
pub struct ScannedSurface {
    /// Its points: `stl{scan}_total.ply` on DTU, in millimetres.
    pub points: Vec<Vector3<f64>>,
    /// What the scanner saw; without it all counts.
    pub mask: Option<ObservationMask>,
    /// The table; without it all surface points count.
    pub ground_plane: Option<GroundPlane>,
}

impl ScannedSurface {
    /// Only the points: all of them count.
    pub(crate) fn only_points(&self) -> Self {
        Self {
            points: self.points.clone(),
            ..Self::default()
        }
    }
}

/// Agreement with a scanned surface; lower is better. `None` where no distance
/// counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfaceScores {
    /// Size of the result.
    pub counts: WireframeCounts,
    /// ACC-J: mean distance of the junctions that carry an edge.
    pub junction_accuracy: Option<f64>,
    /// ACC-L: mean distance of the samples of all segments.
    pub segment_accuracy: Option<f64>,
    /// Mean distance of the surface points to those samples.
    pub completeness: Option<f64>,
    /// Samples that were seen, and so could count for `segment_accuracy`.
    pub observed_samples: usize,
}

impl SurfaceScores {
    pub(crate) fn table(&self) -> Table {
        let title = format!("Wireframe: {}.", self.counts);
        let values = [
            ("junctions (ACC-J)", distance(self.junction_accuracy)),
            ("segments (ACC-L)", distance(self.segment_accuracy)),
            ("completeness", distance(self.completeness)),
            ("samples observed", self.observed_samples.to_string()),
        ];
        Table::of_values(title, ["distance to the surface", "mean"], values)
    }
}

impl NeatSurface {
    /// The constants for DTU; lengths in millimetres.
    pub fn dtu() -> Self {
        Self {
            samples_per_segment: 32,
            thinning: Some(0.2),
            max_distance: 20.0,
            seed: 0,
        }
    }

    /// The constants for BlendedMVS; lengths in the unit of the scene.
    pub fn blended_mvs() -> Self {
        Self {
            thinning: None,
            ..Self::dtu()
        }
    }

    /// Measures `predicted` against `surface`.
    ///
    /// Junctions are not thinned: two that matter are never 0.2 mm apart.
    ///
    /// # Errors
    /// If the wireframe or a surface point is not valid, or there is no point.
    pub fn evaluate(
        &self,
        predicted: &Wireframe3d,
        surface: &ScannedSurface,
    ) -> Result<SurfaceScores, EvalError> {
        check_wireframe(&predicted.junctions, &predicted.edges).map_err(MetricsError::Predicted)?;
        if surface.points.is_empty() {
            return Err(EvalError::EmptyTruth {
                protocol: "neat-dtu",
                missing: "surface points",
            });
        }
        let scan = PointCloud::new(&surface.points)?;
        let used: BTreeSet<usize> = predicted.edges.iter().flatten().copied().collect();
        let ends: Vec<_> = used.iter().map(|&i| predicted.junctions[i]).collect();
        let mut samples = sample_segments(&predicted.segments(), self.samples_per_segment);
        if let Some(radius) = self.thinning {
            samples = thin_points(&samples, radius, self.seed);
        }
        if let Some(mask) = &surface.mask {
            samples.retain(|sample| mask.is_near(sample));
        }
        let observed = |points: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
            let is_observed = |point: &&Vector3<f64>| {
                let mask = surface.mask.as_ref();
                mask.is_none_or(|mask| mask.is_near(point) && mask.is_observed(point))
            };
            points.iter().filter(is_observed).copied().collect()
        };
        let above: Vec<_> = surface
            .points
            .iter()
            .filter(|point| {
                surface
                    .ground_plane
                    .is_none_or(|plane| plane.is_above(point))
            })
            .copied()
            .collect();
        let observed_samples = observed(&samples);
        let mean = |from: &[_], to: &_| mean_nearest_distance(from, to, self.max_distance);
        Ok(SurfaceScores {
            counts: WireframeCounts::of(predicted),
            junction_accuracy: mean(&observed(&ends), &scan),
            segment_accuracy: mean(&observed_samples, &scan),
            completeness: mean(&above, &PointCloud::new(&samples)?),
            observed_samples: observed_samples.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation_mask::tests::mask_file;
    use nalgebra::Vector4;

    /// A segment along x at height 2 above the surface points (0, 0, 0), (10, 0, 0).
    fn segment() -> Wireframe3d {
        Wireframe3d {
            junctions: vec![
                Vector3::new(0.0, 0.0, 2.0),
                Vector3::new(10.0, 0.0, 2.0),
                Vector3::new(500.0, 0.0, 2.0),
            ],
            edges: vec![[0, 1]],
        }
    }

    fn surface() -> ScannedSurface {
        ScannedSurface {
            points: vec![Vector3::zeros(), Vector3::new(10.0, 0.0, 0.0)],
            ..Default::default()
        }
    }

    #[test]
    fn three_samples_by_hand() {
        let protocol = NeatSurface {
            samples_per_segment: 3,
            ..NeatSurface::blended_mvs()
        };
        let scores = protocol.evaluate(&segment(), &surface()).unwrap();
        // The isolated junction does not count.
        assert_eq!(scores.junction_accuracy, Some(2.0));
        let expected = (2.0 + 2.0 + 29.0_f64.sqrt()) / 3.0;
        assert!((scores.segment_accuracy.unwrap() - expected).abs() < 1e-15);
        assert_eq!(scores.completeness, Some(2.0));
        assert_eq!(scores.observed_samples, 3);
    }

    #[test]
    fn far_distances_are_cut_and_thinning_leaves_one() {
        let mut far = segment();
        far.junctions[1].x = 31.0;
        let protocol = NeatSurface {
            samples_per_segment: 2,
            ..NeatSurface::dtu()
        };
        // The end is 21 from the surface: ignored.
        let scores = protocol.evaluate(&far, &surface()).unwrap();
        assert_eq!(scores.segment_accuracy, Some(2.0));
        let thin = NeatSurface {
            thinning: Some(100.0),
            samples_per_segment: 32,
            ..NeatSurface::dtu()
        };
        let scores = thin.evaluate(&segment(), &surface()).unwrap();
        assert_eq!(scores.observed_samples, 1);
    }

    /// With the mask of `observation_mask.rs`: cells along x from -5, the fourth
    /// (from 20 on) unseen, the box to 35, the margin to 155.
    #[test]
    fn mask_and_plane_leave_out_what_they_must() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ObsMask1_10.mat");
        std::fs::write(&path, mask_file()).unwrap();
        let mut masked = surface();
        masked.mask = Some(ObservationMask::read(&path).unwrap());
        let mut predicted = segment();
        predicted.junctions[0].z = 0.5;
        predicted.junctions[1] = Vector3::new(30.0, 0.0, 1.0);
        let protocol = NeatSurface {
            samples_per_segment: 2,
            ..NeatSurface::dtu()
        };
        let scores = protocol.evaluate(&predicted, &masked).unwrap();
        // (30, 0, 1) was not seen, but it is near enough for completeness: the
        // surface point (10, 0, 0) is √100.25 from the first end.
        assert_eq!(scores.observed_samples, 1);
        assert_eq!(scores.junction_accuracy, Some(0.5));
        let expected = (0.5 + 100.25_f64.sqrt()) / 2.0;
        assert!((scores.completeness.unwrap() - expected).abs() < 1e-15);

        // A plane that has the first surface point below it.
        masked.ground_plane = Some(GroundPlane {
            coefficients: Vector4::new(1.0, 0.0, 0.0, -5.0),
        });
        let scores = protocol.evaluate(&predicted, &masked).unwrap();
        assert!((scores.completeness.unwrap() - 100.25_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn no_surface_is_an_error_and_no_prediction_has_no_distance() {
        let protocol = NeatSurface::default();
        assert!(
            protocol
                .evaluate(&segment(), &ScannedSurface::default())
                .is_err()
        );
        let scores = protocol
            .evaluate(&Wireframe3d::default(), &surface())
            .unwrap();
        assert_eq!((scores.segment_accuracy, scores.completeness), (None, None));
    }
}
