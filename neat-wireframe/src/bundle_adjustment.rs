//! Bundle adjustment of the graph: all junctions move together until the
//! projected edges lie on the detections.
//!
//! Every detection of an edge contributes the distances of its two ends from the edge's
//! projected line, and the distances of the projected junctions from its ends where these
//! are given. Cameras stay fixed. Levenberg–Marquardt on Cauchy-weighted residuals with analytic
//! derivatives.

mod residuals;

use crate::solve::{Elimination, LeastSquares, OffDiagonal, Options, minimise};
pub use crate::solve::{Summary, Termination};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
pub use residuals::{EdgeObservation, Loss, ObservedEdge};

const OPTIONS: Options = Options {
    max_iterations: 25,
    max_attempts: 4,
    initial_damping: 1e-3,
    min_damping: 1e-6,
    decrease: 0.3,
    relative_tolerance: 1e-6,
};

/// Junctions after an adjustment.
#[derive(Clone, Debug, PartialEq)]
pub struct Adjusted {
    /// In the order of those given.
    pub junctions: Vec<Vector3<f64>>,
    /// What the solver did; its costs are sums of robust losses.
    pub summary: Summary,
}

/// Moves all junctions, with the correspondences as they are. Junctions without any observed
/// edge stay.
///
/// # Panics
/// If an edge names a junction that does not exist.
pub fn bundle_adjust(edges: &[ObservedEdge], junctions: &[Vector3<f64>], loss: Loss) -> Adjusted {
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
    use crate::ViewObservation;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};
    use neat_core::Camera;

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

    const LOSS: Loss = Loss {
        cauchy_scale_in_pixels: 1.5,
        end_weight: 0.7,
    };

    /// The edges with their exact detections, whose weight is `weight`.
    fn observed(cameras: &[Camera], cube: &NoisyCube, weight: f64) -> Vec<ObservedEdge> {
        observed_edges(cameras, &cube.truth, &cube.edges, weight)
    }

    fn observed_edges(
        cameras: &[Camera],
        truth: &[Vector3<f64>],
        edges: &[[usize; 2]],
        weight: f64,
    ) -> Vec<ObservedEdge> {
        let views = views_of_edges(cameras, truth, edges);
        let observation = |view: &ViewObservation, edge: usize| {
            let detection = view.segments[edge].segment;
            EdgeObservation {
                camera: view.camera,
                detection,
                ends: detection.ends().map(Some),
                weight,
            }
        };
        (edges.iter().enumerate())
            .map(|(edge, junctions)| ObservedEdge {
                junctions: *junctions,
                observations: views.iter().map(|view| observation(view, edge)).collect(),
            })
            .collect()
    }

    #[test]
    fn gradient_of_the_cost_agrees_with_finite_differences() {
        let cube = noisy_cube(7);
        let mut edges = observed(&cameras_on_sphere(5), &cube, 0.8);
        edges[2].observations[0].ends[1] = None;
        let problem = GraphProblem {
            edges: &edges,
            loss: LOSS,
            elimination: Elimination::new(cube.start.len(), cube.edges.iter().copied()),
        };
        let gradient = problem.linearise(&cube.start).unwrap().gradient;
        let step = 1e-7;
        for (junction, analytic) in gradient.iter().enumerate() {
            for axis in 0..3 {
                let cost_at = |offset: f64| {
                    let mut moved = cube.start.clone();
                    moved[junction][axis] += offset;
                    problem.cost(&moved)
                };
                let numeric = (cost_at(step) - cost_at(-step)) / (2.0 * step);
                // d log(1 + r²/s²) = 2/s² · w r dr
                let expected = 2.0 / LOSS.cauchy_scale_in_pixels.powi(2) * analytic[axis];
                assert!(
                    (numeric - expected).abs() < 1e-3 + 1e-5 * expected.abs(),
                    "{numeric} {expected}"
                );
            }
        }
    }

    #[test]
    fn exact_detections_give_back_the_exact_junctions() {
        let cube = noisy_cube(9);
        let edges = observed(&cameras_on_sphere(10), &cube, 1.0);
        let Adjusted { junctions, summary } = bundle_adjust(&edges, &cube.start, LOSS);
        for (adjusted, truth) in junctions.iter().zip(&cube.truth) {
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
        let observed = observed_edges(&cameras_on_sphere(10), &truth, &edges, 1.0);
        let adjusted = bundle_adjust(&observed, &start, LOSS);
        assert!(adjusted.junctions.len() > 100);
        for (adjusted, truth) in adjusted.junctions.iter().zip(&truth) {
            assert!((adjusted - truth).norm() < 1e-4);
        }
    }

    #[test]
    fn without_observations_nothing_moves() {
        let mut cube = noisy_cube(1);
        for edges in [vec![], observed(&[], &cube, 1.0)] {
            let adjusted = bundle_adjust(&edges, &cube.start, LOSS);
            assert_eq!(adjusted.junctions, cube.start);
        }
        let nothing = bundle_adjust(&[], &cube.start, LOSS);
        assert_eq!(nothing.summary.termination, Termination::Undetermined);
        // A junction of no edge stays where the others move.
        cube.start.push(Vector3::new(0.3, 0.1, 0.2));
        let edges = observed(&cameras_on_sphere(3), &cube, 1.0);
        let adjusted = bundle_adjust(&edges, &cube.start, LOSS);
        assert_eq!(adjusted.junctions[8], cube.start[8]);
        assert_ne!(adjusted.junctions[0], cube.start[0]);
    }
}
