//! A wireframe of photographs against the exact surfaces and creases of a rendered scene.
//!
//! Source: ours, the protocol of the rendered scenes with truth (`SCENE/truth`, see
//! [`SceneTruth`]); their script in Python, with SciPy and trimesh, gives the same numbers.
//! ACC-J and ACC-L are those of NEAT (CVPR 2024) §5.1, eq. 9: 32 points per edge, here with
//! the exact distance from triangles, and all of them in the mean.
//!
//! Everything else is measured by length, so that it does not matter into how many pieces
//! somebody cuts an edge. Lines are sampled every centimetre. A sample follows a line if it is
//! at most a threshold from it and the two are turned by at most 10°: edges that cross are
//! no find. Curved creases are polylines whose pieces turn, so they are allowed twice that.
//! What follows a painted line counts for a precision of its own.
//!
//! Thresholds are 1, 2 and 5 cm of a house. They and the spacing are multiplied by the scale
//! of the scene: 0.05 for things on a desk.

mod edge_views;
mod existing_edges;
mod line_samples;
mod recall_bins;
mod scene_truth;
mod scores;

#[cfg(test)]
mod tests;

pub use existing_edges::existing_edges;
pub use recall_bins::RecallBin;
pub use scene_truth::SceneTruth;
pub use scores::{CreaseCounts, CreaseScores, CreaseShares, MeanAndMedian};

use crate::EvalError;
use crate::total::total;
use crate::triangle_mesh::Surface;
use line_samples::{LineCover, LineSamples};
use nalgebra::Vector3;
use neat_core::{LineSegment3, Wireframe3d};
use neat_wireframe::metrics::{MetricsError, PointCloud, sample_segments};
use neat_wireframe::validity::check_wireframe;
use rayon::prelude::*;
use recall_bins::Recall;
use std::collections::BTreeSet;

/// Edges that are this short are points: they have no direction.
const MIN_LENGTH: f64 = 1e-9;
/// Edges longer than this, in metres of a house, have a row of their own.
const LONG: f64 = 0.5;
/// Coordinates beyond it overflow where they are squared and multiplied.
const MAX_COORDINATE: f64 = 1e30;

/// The constants.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceAndCreases {
    /// Distances at which shares are taken, in metres of a house: times the scale.
    pub thresholds: Vec<f64>,
    /// How far lines may be turned against each other, in degrees; twice as far for curves.
    pub max_angle: f64,
    /// Distance of the samples along lines, in metres of a house.
    pub spacing: f64,
    /// Samples per edge for ACC-L, both ends included.
    pub samples_per_segment: usize,
}

impl Default for SurfaceAndCreases {
    fn default() -> Self {
        Self {
            thresholds: vec![0.01, 0.02, 0.05],
            max_angle: 10.0,
            spacing: 0.01,
            samples_per_segment: 32,
        }
    }
}

/// The result: what of it counts.
struct Prediction {
    junctions: Vec<Vector3<f64>>,
    segments: Vec<LineSegment3>,
}

/// Distances that shares are taken of, in the order of points or samples.
struct Distances {
    /// Of junctions and of points on edges from the surface.
    junctions: Vec<f64>,
    points: Vec<f64>,
    /// Of true corners from junctions, and of junctions from true ones.
    corners: Vec<Option<f64>>,
    at_truth: Vec<Option<f64>>,
    /// Of samples of the result from the surface, from straight creases, from any crease,
    /// and from any crease or painted line.
    surface: Vec<Option<f64>>,
    straight: Vec<Option<f64>>,
    crease: Vec<Option<f64>>,
    line: Vec<Option<f64>>,
}

impl SurfaceAndCreases {
    /// Measures `predicted`, which is in the frame of the truth.
    ///
    /// # Errors
    /// If the result or the truth is not valid, the truth has no edge or no surface, or either
    /// is too large to be of this scene.
    pub fn evaluate(
        &self,
        predicted: &Wireframe3d,
        truth: &SceneTruth,
    ) -> Result<CreaseScores, EvalError> {
        self.check(predicted, truth)?;
        let scale = truth.scale;
        let thresholds: Vec<f64> = self.thresholds.iter().map(|t| t * scale).collect();
        let surface = Surface::new(&truth.surface);
        let prediction = Prediction::of(predicted);
        let of_result = LineSamples::new(&prediction.segments, self.spacing * scale, "result")?;
        let distances = self.distances(&prediction, &of_result, truth, &surface)?;

        let true_segments = truth.wireframe.segments();
        let lengths: Vec<f64> = true_segments.iter().map(LineSegment3::length).collect();
        let of_edges = LineSamples::new(&true_segments, self.spacing * scale, "truth")?;
        let curves = LineSamples::new(&truth.curve_pieces(), self.spacing * scale, "truth")?;
        let cover =
            |angle| LineCover::new(&prediction.segments, self.reach(scale), angle, "result");
        let edge_distances = of_edges.distances(&cover(self.max_angle)?);
        let curve_distances = curves.distances(&cover(2.0 * self.max_angle)?);
        let recall = Recall {
            samples: &of_edges,
            distances: &edge_distances,
            thresholds: &thresholds,
        };
        let recall_of_curves = Recall {
            samples: &curves,
            distances: &curve_distances,
            thresholds: &thresholds,
        };
        let complete = [
            recall.of(|_| true).1,
            recall.of(|edge| lengths[edge] > LONG * scale).1,
            recall_of_curves.of(|_| true).1,
        ];
        let views = edge_views::edge_views(truth, &surface, self.spacing * scale);
        Ok(CreaseScores {
            scale,
            predicted: counts(prediction.junctions.len(), &prediction.segments),
            truth: counts(truth.corners().len(), &true_segments),
            junction_accuracy: mean_and_median(&distances.junctions),
            segment_accuracy: mean_and_median(&distances.points),
            thresholds: (thresholds.iter().enumerate())
                .map(|(index, &threshold)| {
                    let complete = complete.each_ref();
                    let complete = complete.map(|of| of.as_ref().map(|recall| recall[index]));
                    distances.shares(threshold, complete, &of_result)
                })
                .collect(),
            by_length: recall.by_length(&lengths, scale),
            by_views: views.map(|views| recall.by_views(&views)),
        })
    }

    /// Refuses what cannot be measured.
    fn check(&self, predicted: &Wireframe3d, truth: &SceneTruth) -> Result<(), EvalError> {
        check_wireframe(&predicted.junctions, &predicted.edges).map_err(MetricsError::Predicted)?;
        let (wireframe, surface) = (&truth.wireframe, &truth.surface);
        check_wireframe(&wireframe.junctions, &wireframe.edges).map_err(MetricsError::Truth)?;
        let is_missing = [
            ("edges", wireframe.edges.is_empty()),
            ("triangles", surface.triangles.is_empty()),
        ];
        if let Some((missing, _)) = is_missing.into_iter().find(|(_, is_missing)| *is_missing) {
            return Err(EvalError::EmptyTruth {
                protocol: "surface-and-creases",
                missing,
            });
        }
        if let Some(triangle) = surface.broken_triangle() {
            return Err(EvalError::BrokenSurface { triangle });
        }
        let (curves, painted) = (truth.curves.iter().flatten(), &truth.texture_lines);
        let of_truth = (wireframe
            .junctions
            .iter()
            .chain(&surface.vertices)
            .chain(curves))
        .copied()
        .chain(painted.iter().flat_map(|line| line.ends()));
        // No comparison holds of NaN.
        let is_fine = |point: Vector3<f64>| point.iter().all(|x| x.abs() <= MAX_COORDINATE);
        for (what, is_fine) in [
            ("result", predicted.junctions.iter().copied().all(is_fine)),
            (
                "truth",
                of_truth.into_iter().all(is_fine) && is_positive(truth.scale),
            ),
        ] {
            if !is_fine {
                let spacing = self.spacing * truth.scale;
                return Err(EvalError::OutOfScale { what, spacing });
            }
        }
        Ok(())
    }

    /// The largest threshold: nothing farther away is looked for.
    fn reach(&self, scale: f64) -> f64 {
        scale * self.thresholds.iter().copied().fold(0.0, f64::max)
    }

    fn distances(
        &self,
        prediction: &Prediction,
        samples: &LineSamples,
        truth: &SceneTruth,
        surface: &Surface,
    ) -> Result<Distances, EvalError> {
        let nearest = |from: &[Vector3<f64>], to: &[Vector3<f64>]| -> Result<_, EvalError> {
            let cloud = PointCloud::new(to)?;
            Ok(from
                .par_iter()
                .map(|point| cloud.distance(point))
                .collect::<Vec<_>>())
        };
        let reach = self.reach(truth.scale);
        let to_lines = |lines: &[LineSegment3], angle: f64| -> Result<_, EvalError> {
            let cover = LineCover::new(lines, reach, angle, "truth")?;
            Ok(samples.distances(&cover))
        };
        let straight = to_lines(&truth.wireframe.segments(), self.max_angle)?;
        let curved = to_lines(&truth.curve_pieces(), 2.0 * self.max_angle)?;
        let painted = to_lines(&truth.texture_lines, self.max_angle)?;
        let crease = nearer(&straight, &curved);
        // Line by line: of many lines the points would take more memory than the rest.
        let on_line = |line: &LineSegment3| -> Vec<f64> {
            let points = sample_segments(std::slice::from_ref(line), self.samples_per_segment);
            points.iter().map(|point| surface.distance(point)).collect()
        };
        Ok(Distances {
            junctions: (prediction.junctions.par_iter())
                .map(|point| surface.distance(point))
                .collect(),
            points: (prediction.segments.par_iter())
                .flat_map_iter(on_line)
                .collect(),
            corners: nearest(&truth.corners(), &prediction.junctions)?,
            at_truth: nearest(&prediction.junctions, &truth.wireframe.junctions)?,
            surface: (samples.points.par_iter())
                .map(|point| surface.distance_within(point, reach))
                .collect(),
            line: nearer(&crease, &painted),
            straight,
            crease,
        })
    }
}

impl Prediction {
    /// Of a valid wireframe: edges that have a length, and the junctions that carry edges.
    fn of(wireframe: &Wireframe3d) -> Self {
        let used: BTreeSet<usize> = wireframe.edges.iter().flatten().copied().collect();
        let mut segments = wireframe.segments();
        segments.retain(|segment| segment.length() > MIN_LENGTH);
        Self {
            junctions: used
                .into_iter()
                .map(|index| wireframe.junctions[index])
                .collect(),
            segments,
        }
    }
}

impl Distances {
    /// Everything at one threshold; `complete` is completeness of all, long and curved edges.
    fn shares(
        &self,
        threshold: f64,
        complete: [Option<f64>; 3],
        samples: &LineSamples,
    ) -> CreaseShares {
        let near = |distance: &Option<f64>| distance.is_some_and(|d| d <= threshold);
        let of_number = |count: usize, all: usize| (all > 0).then(|| count as f64 / all as f64);
        let of_finite = |distances: &[f64]| {
            let count = distances.iter().filter(|d| **d <= threshold).count();
            of_number(count, distances.len())
        };
        let of_points = |distances: &[Option<f64>]| {
            of_number(
                distances.iter().filter(|d| near(d)).count(),
                distances.len(),
            )
        };
        let all = samples.length_of(|_, _| true);
        let of_length = |distances: &[Option<f64>]| {
            let length = samples.length_of(|sample, _| near(&distances[sample]));
            (all > 0.0).then(|| length / all)
        };
        let [completeness, completeness_of_long, completeness_of_curved] = complete;
        let length_on_crease = of_length(&self.crease);
        CreaseShares {
            threshold,
            junctions_on_surface: of_finite(&self.junctions),
            points_on_surface: of_finite(&self.points),
            completeness,
            completeness_of_long,
            completeness_of_curved,
            junction_recall: of_points(&self.corners),
            junction_precision: of_points(&self.at_truth),
            length_on_surface: of_length(&self.surface),
            length_on_straight_crease: of_length(&self.straight),
            length_on_crease,
            length_on_crease_or_texture: of_length(&self.line),
            f1: f1(length_on_crease.unwrap_or(0.0), completeness.unwrap_or(0.0)),
        }
    }
}

fn f1(precision: f64, recall: f64) -> f64 {
    2.0 * precision * recall / (precision + recall).max(1e-9)
}

fn is_positive(scale: f64) -> bool {
    scale.is_normal() && scale > 0.0
}

fn nearer(a: &[Option<f64>], b: &[Option<f64>]) -> Vec<Option<f64>> {
    let pairs = a.iter().zip(b);
    let of_pair =
        |(a, b): (&Option<f64>, &Option<f64>)| a.iter().chain(b).copied().reduce(f64::min);
    pairs.map(of_pair).collect()
}

fn counts(junctions: usize, segments: &[LineSegment3]) -> CreaseCounts {
    CreaseCounts {
        junctions,
        edges: segments.len(),
        length: total(segments.iter().map(LineSegment3::length)),
    }
}

fn mean_and_median(distances: &[f64]) -> Option<MeanAndMedian> {
    let mut sorted = distances.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let count = sorted.len();
    let upper = sorted.get(count / 2)?;
    Some(MeanAndMedian {
        mean: total(distances.iter().copied()) / count as f64,
        // Of an even number, the middle between the two middle ones.
        median: 0.5 * (sorted[(count - 1) / 2] + upper),
    })
}
