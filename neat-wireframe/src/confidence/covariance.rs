//! Covariances of the junctions.
//!
//! The best estimate of all junctions, given the [`DetectedEnd`]s and their noise,
//! minimises the squared residuals in units of their standard deviations; its
//! covariance is the inverse of the information matrix. The wireframe comes from
//! another estimate, by whichever back end. Best estimates do not correlate with
//! the differences between them and other unbiased ones (Hausman 1978),
//! so the expected square of the error of what is given is the
//! covariance of the best estimate plus the square of the observed difference. That
//! is what is reported: a wireframe that ignores the evidence gets the variance
//! that it deserves, whatever made it.
//!
//! The noise is one per scene. The squared residuals around each junction say how
//! much more or less it is there, and the [`ViewCorrelation`] how much less than
//! their number the views are worth.

use super::config::CovarianceConfig;
use super::detected_ends::{DetectedEnd, Shown};
use super::noise::{DetectionNoise, NoiseKind};
use super::view_correlation::{JunctionView, ViewCorrelation};
use crate::ViewObservation;
use crate::projection::project_with_jacobian;
use crate::solve::{BlockCholesky, Elimination};
use nalgebra::{Matrix3, Vector2, Vector3};
use rayon::prelude::*;

/// Steps shorter than this share of the scene radius end the iteration.
const STEP_TOLERANCE: f64 = 1e-7;
/// Projected edges shorter than this have no direction.
const MIN_PROJECTED_LENGTH: f64 = 1e-6;

/// What the evidence says about the junctions.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct JunctionEstimate {
    /// Expected squared error of each junction as it is given; `None` where the
    /// evidence does not determine it.
    pub covariances: Vec<Option<Matrix3<f64>>>,
    /// Of the detected ends.
    pub noise: DetectionNoise,
}

/// Assesses the junctions of a wireframe. Without a radius of the scene none is
/// determined.
pub(super) fn estimate(
    observations: &[ViewObservation],
    junctions: &[Vector3<f64>],
    ends: &[DetectedEnd],
    scene_radius: Option<f64>,
    config: &CovarianceConfig,
) -> JunctionEstimate {
    let Some(scene_radius) = scene_radius else {
        return JunctionEstimate {
            covariances: vec![None; junctions.len()],
            noise: DetectionNoise::usual(config),
        };
    };
    let lines = ends.iter().filter_map(|end| match &end.shows {
        Shown::Lines(edges) => Some(edges),
        Shown::Junction { .. } => None,
    });
    let adjustment = Adjustment {
        elimination: Elimination::new(junctions.len(), lines.flatten().copied()),
        observations,
        ends,
        given: junctions,
        // Nothing else is known but that junctions lie in the scene.
        prior_information: (scene_radius * scene_radius).recip(),
        config,
    };
    let mut best = junctions.to_vec();
    let mut residuals = adjustment.residuals(&best);
    let mut noise = DetectionNoise::estimate(&as_noise(&residuals), 0, config);
    for _ in 0..config.max_iterations {
        let Some((_, step)) = adjustment.step(&best, &residuals, &noise) else {
            break;
        };
        for (junction, step) in best.iter_mut().zip(&step) {
            *junction += step;
        }
        residuals = adjustment.residuals(&best);
        let parameters = adjustment.parameters(&residuals);
        noise = DetectionNoise::estimate(&as_noise(&residuals), parameters, config);
        let longest = step.iter().map(|step| step.norm()).fold(0.0, f64::max);
        if longest <= STEP_TOLERANCE * scene_radius {
            break;
        }
    }
    let factor = adjustment.step(&best, &residuals, &noise);
    let covariances = match factor {
        Some((factor, _)) => adjustment.second_moments(&factor, &best, &residuals, &noise),
        None => vec![None; junctions.len()],
    };
    let max_variance = (config.max_relative_sigma * scene_radius).powi(2);
    let views = adjustment.view_counts();
    let determined = |(covariance, views): (Option<Matrix3<f64>>, usize)| {
        covariance.filter(|covariance| {
            views >= config.min_views && largest_eigenvalue(covariance) <= max_variance
        })
    };
    JunctionEstimate {
        covariances: covariances.into_iter().zip(views).map(determined).collect(),
        noise,
    }
}

/// The largest eigenvalue of a covariance; infinite if an element is not finite.
pub(super) fn largest_eigenvalue(covariance: &Matrix3<f64>) -> f64 {
    if covariance.iter().all(|x| x.is_finite()) {
        covariance.symmetric_eigenvalues().max()
    } else {
        f64::INFINITY
    }
}

/// A residual of one number.
struct Residual {
    kind: NoiseKind,
    /// In pixels: observed minus predicted.
    value: f64,
    /// Direction in the image along which it is measured.
    axis: Vector2<f64>,
    /// In pixels: by this it is judged whether the observation is an error.
    magnitude: f64,
    /// Its share of the information, where one end has several residuals.
    share: f64,
    /// Derivatives of the prediction by the positions of junctions.
    by_junctions: [Option<(usize, Vector3<f64>)>; 2],
}

fn as_noise(residuals: &[Residual]) -> Vec<(NoiseKind, f64)> {
    residuals.iter().map(|r| (r.kind, r.value)).collect()
}

/// The problem whose solution is the best estimate.
struct Adjustment<'a> {
    elimination: Elimination,
    observations: &'a [ViewObservation],
    ends: &'a [DetectedEnd],
    given: &'a [Vector3<f64>],
    prior_information: f64,
    config: &'a CovarianceConfig,
}

impl Adjustment<'_> {
    /// All residuals with the junctions at these positions.
    fn residuals(&self, junctions: &[Vector3<f64>]) -> Vec<Residual> {
        let of_ends: Vec<Vec<Residual>> = self
            .ends
            .par_iter()
            .map(|end| self.residuals_of_end(end, junctions))
            .collect();
        of_ends.into_iter().flatten().collect()
    }

    fn residuals_of_end(&self, end: &DetectedEnd, junctions: &[Vector3<f64>]) -> Vec<Residual> {
        let camera = &self.observations[end.view].camera;
        match &end.shows {
            Shown::Junction {
                junction,
                direction,
            } => {
                let Some((pixel, jacobian)) = project_with_jacobian(camera, &junctions[*junction])
                else {
                    return Vec::new();
                };
                let offset = end.pixel - pixel;
                let component = |kind: NoiseKind, axis: Vector2<f64>, magnitude: f64| Residual {
                    kind,
                    value: offset.dot(&axis),
                    axis,
                    magnitude,
                    share: 1.0,
                    by_junctions: [Some((*junction, jacobian.tr_mul(&axis))), None],
                };
                match direction {
                    None => [Vector2::x(), Vector2::y()]
                        .map(|axis| component(NoiseKind::Vertex, axis, offset.norm()))
                        .into(),
                    Some(along) => {
                        let across = Vector2::new(-along.y, along.x);
                        let magnitude = |axis: &Vector2<f64>| offset.dot(axis).abs();
                        vec![
                            component(NoiseKind::Along, *along, magnitude(along)),
                            component(NoiseKind::Across, across, magnitude(&across)),
                        ]
                    }
                }
            }
            Shown::Lines(edges) => edges
                .iter()
                .filter_map(|edge| {
                    let [a, b] = edge.map(|j| project_with_jacobian(camera, &junctions[j]));
                    let ((a, jacobian_a), (b, jacobian_b)) = (a?, b?);
                    let length = (b - a).norm().max(MIN_PROJECTED_LENGTH);
                    let along = (b - a) / length;
                    let across = Vector2::new(-along.y, along.x);
                    let offset = end.pixel - a;
                    // The foot of the perpendicular follows both ends in
                    // proportion to its place between them.
                    let place = offset.dot(&along) / length;
                    let value = offset.dot(&across);
                    Some(Residual {
                        kind: NoiseKind::Across,
                        value,
                        axis: across,
                        magnitude: value.abs(),
                        share: (edges.len() as f64).recip(),
                        by_junctions: [
                            Some((edge[0], (1.0 - place) * jacobian_a.tr_mul(&across))),
                            Some((edge[1], place * jacobian_b.tr_mul(&across))),
                        ],
                    })
                })
                .collect(),
        }
    }

    /// Whether a residual is noise, not an error.
    fn is_noise(&self, residual: &Residual, noise: &DetectionNoise) -> bool {
        residual.magnitude <= self.config.max_standard_deviations * noise.of(residual.kind)
    }

    /// How many numbers the residuals determine.
    fn parameters(&self, residuals: &[Residual]) -> usize {
        let mut touched = vec![false; self.given.len()];
        for (junction, _) in residuals.iter().flat_map(|r| r.by_junctions).flatten() {
            touched[junction] = true;
        }
        3 * touched.iter().filter(|touched| **touched).count()
    }

    /// The decomposed information matrix and the step to the best estimate.
    fn step(
        &self,
        junctions: &[Vector3<f64>],
        residuals: &[Residual],
        noise: &DetectionNoise,
    ) -> Option<(BlockCholesky<'_>, Vec<Vector3<f64>>)> {
        let prior = Matrix3::identity() * self.prior_information;
        let mut diagonal = vec![prior; junctions.len()];
        let mut off_diagonal = Vec::new();
        let mut gradient: Vec<Vector3<f64>> = (self.given.iter().zip(junctions))
            .map(|(given, junction)| self.prior_information * (given - junction))
            .collect();
        for residual in residuals.iter().filter(|r| self.is_noise(r, noise)) {
            let weight = residual.share / noise.of(residual.kind).powi(2);
            for (junction, by) in residual.by_junctions.into_iter().flatten() {
                diagonal[junction] += weight * by * by.transpose();
                gradient[junction] += weight * residual.value * by;
            }
            if let [Some((a, by_a)), Some((b, by_b))] = residual.by_junctions {
                off_diagonal.push(([a, b], weight * by_a * by_b.transpose()));
            }
        }
        let factor = self.elimination.factor(&diagonal, &off_diagonal)?;
        let step = factor.solve(&gradient);
        Some((factor, step))
    }

    /// Expected squared errors of the given junctions.
    fn second_moments(
        &self,
        factor: &BlockCholesky,
        best: &[Vector3<f64>],
        residuals: &[Residual],
        noise: &DetectionNoise,
    ) -> Vec<Option<Matrix3<f64>>> {
        let covariances = factor.inverse_diagonal();
        let scales = self.local_variances(residuals, noise);
        let views = self.views_of_junctions(best, noise);
        let correlation = ViewCorrelation::estimate(&views, &covariances);
        (covariances.into_iter().enumerate())
            .map(|(junction, covariance)| {
                let scale = scales[junction] * correlation.design_effect(&views[junction]);
                let difference = best[junction] - self.given[junction];
                let moment = scale * covariance + difference * difference.transpose();
                moment.iter().all(|x| x.is_finite()).then_some(moment)
            })
            .collect()
    }

    /// The variance of the observations around each junction, in units of that of
    /// the scene. Errors count as much as the largest noise.
    fn local_variances(&self, residuals: &[Residual], noise: &DetectionNoise) -> Vec<f64> {
        let mut sums = vec![(0.0, 0.0); self.given.len()];
        let limit = self.config.max_standard_deviations.powi(2);
        for residual in residuals {
            let square = (residual.value / noise.of(residual.kind))
                .powi(2)
                .min(limit);
            let touched = residual.by_junctions.iter().flatten().count() as f64;
            for (junction, _) in residual.by_junctions.into_iter().flatten() {
                sums[junction].0 += residual.share * square / touched;
                sums[junction].1 += residual.share / touched;
            }
        }
        let prior = self.config.prior_degrees_of_freedom;
        let variance = |(squares, count): (f64, f64)| {
            let freedom = prior + (count - 3.0).max(0.0);
            if freedom > 0.0 {
                (prior + squares) / freedom
            } else {
                1.0
            }
        };
        sums.into_iter().map(variance).collect()
    }

    /// The ends that show each junction, but for errors.
    fn views_of_junctions(
        &self,
        best: &[Vector3<f64>],
        noise: &DetectionNoise,
    ) -> Vec<Vec<JunctionView>> {
        let mut views = vec![Vec::new(); best.len()];
        for end in self.ends {
            let Shown::Junction { junction, .. } = end.shows else {
                continue;
            };
            let camera = &self.observations[end.view].camera;
            let residuals = self.residuals_of_end(end, best);
            if residuals.is_empty() || !residuals.iter().all(|r| self.is_noise(r, noise)) {
                continue;
            }
            let mut view = JunctionView {
                toward_camera: (camera.center_in_world - best[junction]).normalize(),
                residual: Vector3::zeros(),
                by_junction: Matrix3::zeros(),
            };
            for residual in &residuals {
                let sigma = noise.of(residual.kind);
                let axis = camera.world_from_camera * residual.axis.push(0.0);
                view.residual += axis * (residual.value / sigma);
                for (_, by) in residual.by_junctions.iter().flatten() {
                    view.by_junction += axis * by.transpose() / sigma;
                }
            }
            views[junction].push(view);
        }
        views
    }

    /// The number of views with an observation of each junction or of its edges.
    fn view_counts(&self) -> Vec<usize> {
        let mut views: Vec<Vec<usize>> = vec![Vec::new(); self.given.len()];
        for end in self.ends {
            let mut seen = |junction: usize| views[junction].push(end.view);
            match &end.shows {
                Shown::Junction { junction, .. } => seen(*junction),
                Shown::Lines(edges) => edges.iter().flatten().for_each(|j| seen(*j)),
            }
        }
        // Ends come by ascending view.
        let count = |mut views: Vec<usize>| {
            views.dedup();
            views.len()
        };
        views.into_iter().map(count).collect()
    }
}
