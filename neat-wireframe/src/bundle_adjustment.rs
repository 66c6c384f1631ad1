//! Bundle adjustment of the graph: all junctions move together until the
//! projected edges lie on the detections.
//!
//! Every (view, edge) pair contributes its best detection: the distances of the
//! detection's two ends from the edge's projected line, and the distances of the
//! projected junctions from the detection's ends where these are near. Cameras
//! stay fixed. Levenberg–Marquardt on Cauchy-weighted residuals with analytic
//! derivatives.

mod association;
mod residuals;

use crate::ViewObservation;
use crate::solve::{Cauchy, Elimination, LeastSquares, OffDiagonal, Options, minimise};
pub use crate::solve::{Summary, Termination};
use association::associate_edges;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
pub(crate) use residuals::{EdgeObservation, Loss, ObservedEdge};
use serde::{Deserialize, Serialize};

const OPTIONS: Options = Options {
    max_iterations: 25,
    max_attempts: 4,
    initial_damping: 1e-3,
    min_damping: 1e-6,
    decrease: 0.3,
    relative_tolerance: 1e-6,
};

/// Settings of [`bundle_adjust`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BundleAdjustmentConfig {
    /// Association distances in pixels of the passes that precede the final
    /// choice of edges, one pass each.
    pub association_in_pixels: Vec<f64>,
    /// Association distance in pixels of the pass on the final graph.
    pub final_association_in_pixels: f64,
    /// The association distance never exceeds this share of the projected edge.
    pub max_relative_distance: f64,
    /// Edges that appear shorter than this are not observed.
    pub min_projected_length_in_pixels: f64,
    /// A detection must cover more than this share of the edge …
    pub min_overlap: f64,
    /// … and be shorter than this multiple of it.
    pub max_relative_length: f64,
    /// Residuals are weighted by the score to this power.
    pub score_exponent: f64,
    /// Weight of junction-to-end residuals relative to end-to-line ones.
    pub end_weight: f64,
    /// Scale of the Cauchy loss.
    pub cauchy_scale_in_pixels: f64,
}

impl Default for BundleAdjustmentConfig {
    fn default() -> Self {
        Self {
            association_in_pixels: vec![6.0, 4.0],
            final_association_in_pixels: 3.0,
            max_relative_distance: 0.2,
            min_projected_length_in_pixels: 10.0,
            min_overlap: 0.4,
            max_relative_length: 1.3,
            score_exponent: 0.25,
            end_weight: 1.0,
            cauchy_scale_in_pixels: 1.0,
        }
    }
}

impl BundleAdjustmentConfig {
    fn loss(&self) -> Loss {
        Loss {
            cauchy: Cauchy {
                scale: self.cauchy_scale_in_pixels,
            },
            end_weight: self.end_weight,
        }
    }
}

/// Junctions after an adjustment.
#[derive(Clone, Debug, PartialEq)]
pub struct Adjusted {
    /// In the order of those given.
    pub junctions: Vec<Vector3<f64>>,
    /// What the solver did; its costs are sums of robust losses.
    pub summary: Summary,
}

/// The junctions after one pass: association within `association_in_pixels` at
/// their present positions, then optimisation.
///
/// Junctions without any observed edge stay. Edges must name two different
/// existing junctions; others are passed over.
pub fn bundle_adjust(
    views: &[ViewObservation],
    junctions: &[Vector3<f64>],
    edges: &[[usize; 2]],
    association_in_pixels: f64,
    config: &BundleAdjustmentConfig,
) -> Adjusted {
    let observed = associate_edges(views, junctions, edges, association_in_pixels, config);
    adjust_observed(&observed, junctions, config.loss())
}

/// Levenberg–Marquardt on all junctions, with the correspondences as they are.
///
/// Edges must name two different existing junctions.
pub(crate) fn adjust_observed(
    edges: &[ObservedEdge],
    junctions: &[Vector3<f64>],
    loss: Loss,
) -> Adjusted {
    let pairs = edges.iter().map(|edge| edge.junctions);
    let problem = GraphProblem {
        edges,
        loss,
        elimination: Elimination::new(junctions.len(), pairs),
    };
    let (junctions, summary) = minimise(&problem, junctions.to_vec(), &OPTIONS);
    tracing::debug!(
        edges = edges.len(),
        junctions = junctions.len(),
        ?summary,
        "adjusted"
    );
    Adjusted { junctions, summary }
}

/// All junctions of a graph as one problem.
struct GraphProblem<'a> {
    edges: &'a [ObservedEdge],
    loss: Loss,
    elimination: Elimination,
}

/// The normal equations `H x = g`: one 3×3 block per junction and per edge.
struct NormalEquations {
    diagonal: Vec<Matrix3<f64>>,
    off_diagonal: Vec<OffDiagonal>,
    gradient: Vec<Vector3<f64>>,
}

impl LeastSquares for GraphProblem<'_> {
    type State = Vec<Vector3<f64>>;
    type Equations = NormalEquations;

    fn cost(&self, junctions: &Vec<Vector3<f64>>) -> f64 {
        let costs: Vec<f64> = (self.edges.par_iter())
            .map(|edge| edge.cost(junctions, &self.loss))
            .collect();
        // Summed in the order of the edges, whatever the threads did.
        costs.iter().sum()
    }

    fn linearise(&self, junctions: &Vec<Vector3<f64>>) -> Option<NormalEquations> {
        let blocks: Vec<_> = (self.edges.par_iter())
            .map(|edge| edge.linearise(junctions, &self.loss))
            .collect();
        let mut equations = NormalEquations {
            diagonal: vec![Matrix3::zeros(); junctions.len()],
            off_diagonal: Vec::with_capacity(blocks.len()),
            gradient: vec![Vector3::zeros(); junctions.len()],
        };
        for (edge, blocks) in self.edges.iter().zip(blocks) {
            for side in 0..2 {
                equations.diagonal[edge.junctions[side]] += blocks.diagonal[side];
                equations.gradient[edge.junctions[side]] += blocks.gradient[side];
            }
            equations
                .off_diagonal
                .push((edge.junctions, blocks.off_diagonal));
        }
        (!self.edges.is_empty()).then_some(equations)
    }

    /// Damps by `diag(H) + I`: junctions that nothing observes stay.
    fn step(
        &self,
        junctions: &Vec<Vector3<f64>>,
        equations: &NormalEquations,
        damping: f64,
    ) -> Option<Vec<Vector3<f64>>> {
        let damped: Vec<Matrix3<f64>> = (equations.diagonal.iter())
            .map(|block| {
                block + Matrix3::from_diagonal(&block.diagonal().add_scalar(1.0)) * damping
            })
            .collect();
        let factor = self.elimination.factor(&damped, &equations.off_diagonal)?;
        let step = factor.solve(&equations.gradient);
        Some(junctions.iter().zip(&step).map(|(x, dx)| x - dx).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};

    /// The cube, its edges, and junctions to start from that are up to 0.01 off.
    struct NoisyCube {
        truth: Vec<Vector3<f64>>,
        edges: Vec<[usize; 2]>,
        start: Vec<Vector3<f64>>,
    }

    fn noisy_cube(seed: u64) -> NoisyCube {
        let (truth, edges) = cube();
        let mut noise = Noise(seed);
        let start = truth.iter().map(|x| x + 0.01 * noise.vector()).collect();
        NoisyCube {
            truth,
            edges,
            start,
        }
    }

    #[test]
    fn gradient_of_the_cost_agrees_with_finite_differences() {
        let NoisyCube {
            truth,
            edges,
            start,
        } = noisy_cube(7);
        let mut views = views_of_edges(&cameras_on_sphere(5), &truth, &edges);
        views[0].segments[2].score = 0.3;
        let config = BundleAdjustmentConfig {
            end_weight: 0.7,
            cauchy_scale_in_pixels: 1.5,
            ..Default::default()
        };
        let observed = associate_edges(&views, &start, &edges, 20.0, &config);
        assert!(
            observed
                .iter()
                .any(|e| e.observations.iter().any(|o| o.ends[0].is_some()))
        );
        let problem = GraphProblem {
            edges: &observed,
            loss: config.loss(),
            elimination: Elimination::new(start.len(), edges.iter().copied()),
        };
        let gradient = problem.linearise(&start).unwrap().gradient;
        let step = 1e-7;
        for (junction, analytic) in gradient.iter().enumerate() {
            for axis in 0..3 {
                let cost_at = |offset: f64| {
                    let mut moved = start.clone();
                    moved[junction][axis] += offset;
                    problem.cost(&moved)
                };
                let numeric = (cost_at(step) - cost_at(-step)) / (2.0 * step);
                // d log(1 + r²/s²) = 2/s² · w r dr
                let expected = 2.0 / config.cauchy_scale_in_pixels.powi(2) * analytic[axis];
                assert!(
                    (numeric - expected).abs() < 1e-3 + 1e-5 * expected.abs(),
                    "{numeric} {expected}"
                );
            }
        }
    }

    #[test]
    fn exact_detections_give_back_the_exact_junctions() {
        let NoisyCube {
            truth,
            edges,
            start,
        } = noisy_cube(9);
        let views = views_of_edges(&cameras_on_sphere(10), &truth, &edges);
        let config = BundleAdjustmentConfig::default();
        let Adjusted { junctions, summary } = bundle_adjust(&views, &start, &edges, 12.0, &config);
        for (adjusted, truth) in junctions.iter().zip(&truth) {
            assert!((adjusted - truth).norm() < 1e-4, "{adjusted} {truth}");
        }
        assert!(
            summary.final_cost < 1e-3 * summary.initial_cost,
            "{summary:?}"
        );
        assert_ne!(summary.termination, Termination::MaxIterations);
    }

    #[test]
    fn many_junctions_come_to_the_true_place() {
        let (corners, cube_edges) = cube();
        let mut truth = Vec::new();
        let mut edges = Vec::new();
        for i in 0..20 {
            let center = Vector3::new(i as f64 % 5.0 - 2.0, (i / 5) as f64 - 1.5, 0.0) * 0.3;
            edges.extend(cube_edges.iter().map(|[a, b]| [a + 8 * i, b + 8 * i]));
            truth.extend(corners.iter().map(|corner| center + 0.2 * corner));
        }
        let mut noise = Noise(31);
        let start: Vec<_> = truth.iter().map(|x| x + 0.002 * noise.vector()).collect();
        let views = views_of_edges(&cameras_on_sphere(10), &truth, &edges);
        let config = BundleAdjustmentConfig::default();
        let adjusted = bundle_adjust(&views, &start, &edges, 6.0, &config);
        assert!(adjusted.junctions.len() > 100);
        for (adjusted, truth) in adjusted.junctions.iter().zip(&truth) {
            assert!((adjusted - truth).norm() < 1e-4);
        }
    }

    #[test]
    fn without_observations_nothing_moves() {
        let NoisyCube {
            truth,
            edges,
            mut start,
        } = noisy_cube(1);
        let config = BundleAdjustmentConfig::default();
        let views = views_of_edges(&cameras_on_sphere(3), &truth, &edges);
        let wrong = [[0, 8], [1, 1]];
        for (views, edges) in [(&[][..], &edges[..]), (&views, &[]), (&views, &wrong)] {
            let adjusted = bundle_adjust(views, &start, edges, 6.0, &config);
            assert_eq!(adjusted.junctions, start);
            assert_eq!(adjusted.summary.termination, Termination::Undetermined);
        }
        // A junction of no edge stays where the others move.
        start.push(Vector3::new(0.3, 0.1, 0.2));
        let adjusted = bundle_adjust(&views, &start, &edges, 6.0, &config);
        assert_eq!(adjusted.junctions[8], start[8]);
        assert_ne!(adjusted.junctions[0], start[0]);
    }
}
