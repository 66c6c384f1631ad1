//! Bundle adjustment of the graph: all junctions move together until the
//! projected edges lie on the detections.
//!
//! Every (view, edge) pair contributes its best detection: the distances of the
//! detection's two ends from the edge's projected line, and the distances of the
//! projected junctions from the detection's ends where these are near. Cameras
//! stay fixed. Levenberg–Marquardt on Cauchy-weighted residuals with analytic
//! derivatives.

use crate::ViewObservation;
use crate::block_cholesky::Elimination;
use crate::normal_equations::NormalEquations;
use crate::projection::{project_in_front, project_with_jacobian};
use crate::segment_grid::SegmentGrid;
use crate::segment_matching::match_segment;
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use neat_core::{Camera, LineSegment2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Projected edges shorter than this are treated as this long.
const MIN_PROJECTED_LENGTH: f64 = 1e-6;
/// Where detections need not even cover this share of an edge, so many places on
/// it would have to be looked at that all detections are looked at instead.
const MIN_OVERLAP_FOR_INDEX: f64 = 0.05;

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
    /// Accepted steps at most.
    pub max_iterations: usize,
    /// Damping of the first step: times 10 after a failure, times 0.3 after a
    /// success.
    pub initial_damping: f64,
    /// The damping never falls below this.
    pub min_damping: f64,
    /// Attempts to find a step that lowers the cost.
    pub max_attempts: usize,
    /// A smaller relative decrease of the cost ends the iteration.
    pub relative_tolerance: f64,
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
            max_iterations: 25,
            initial_damping: 1e-3,
            min_damping: 1e-6,
            max_attempts: 4,
            relative_tolerance: 1e-6,
        }
    }
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
) -> Vec<Vector3<f64>> {
    let observed = associate_edges(views, junctions, edges, association_in_pixels, config);
    adjust_observed(&observed, junctions, config)
}

/// The edges that at least one view observes, with their detections.
pub(crate) fn associate_edges(
    views: &[ViewObservation],
    junctions: &[Vector3<f64>],
    edges: &[[usize; 2]],
    association_in_pixels: f64,
    config: &BundleAdjustmentConfig,
) -> Vec<ObservedEdge> {
    let views: Vec<IndexedView> = views.par_iter().map(IndexedView::new).collect();
    edges
        .par_iter()
        .filter(|[a, b]| a != b && *a < junctions.len() && *b < junctions.len())
        .map(|edge| {
            ObservedEdge::associate(*edge, &views, junctions, association_in_pixels, config)
        })
        .filter(|edge| !edge.observations.is_empty())
        .collect()
}

/// Levenberg–Marquardt on all junctions, with the correspondences as they are.
///
/// Edges must name two different existing junctions.
pub(crate) fn adjust_observed(
    edges: &[ObservedEdge],
    junctions: &[Vector3<f64>],
    config: &BundleAdjustmentConfig,
) -> Vec<Vector3<f64>> {
    let mut junctions = junctions.to_vec();
    if edges.is_empty() {
        return junctions;
    }
    let pairs = edges.iter().map(|edge| edge.junctions);
    let elimination = Elimination::new(junctions.len(), pairs);
    let mut cost = total_cost(edges, &junctions, config);
    let mut damping = config.initial_damping;
    for _ in 0..config.max_iterations {
        let equations = linearise(edges, &junctions, config);
        let mut accepted = None;
        for _ in 0..config.max_attempts {
            if let Some(step) = equations.solve_in_order(damping, &elimination) {
                let moved: Vec<_> = junctions.iter().zip(&step).map(|(x, dx)| x - dx).collect();
                let moved_cost = total_cost(edges, &moved, config);
                if moved_cost < cost {
                    accepted = Some((moved, moved_cost));
                    break;
                }
            }
            damping *= 10.0;
        }
        let Some((moved, moved_cost)) = accepted else {
            break;
        };
        let converged = cost - moved_cost < config.relative_tolerance * cost;
        (junctions, cost) = (moved, moved_cost);
        damping = (0.3 * damping).max(config.min_damping);
        if converged {
            break;
        }
    }
    junctions
}

/// `Σ log(1 + (residual / scale)²)`; infinite where a junction has moved behind
/// a camera that sees it.
fn total_cost(
    edges: &[ObservedEdge],
    junctions: &[Vector3<f64>],
    config: &BundleAdjustmentConfig,
) -> f64 {
    let costs: Vec<f64> = edges
        .par_iter()
        .map(|edge| edge.cost(junctions, config))
        .collect();
    // Summed in the order of the edges, whatever the threads did.
    costs.iter().sum()
}

/// The normal equations at `junctions`, assembled edge by edge.
fn linearise(
    edges: &[ObservedEdge],
    junctions: &[Vector3<f64>],
    config: &BundleAdjustmentConfig,
) -> NormalEquations {
    let blocks: Vec<EdgeBlocks> = edges
        .par_iter()
        .map(|edge| edge.linearise(junctions, config))
        .collect();
    let mut equations = NormalEquations::new(junctions.len());
    for (edge, blocks) in edges.iter().zip(blocks) {
        for side in 0..2 {
            equations.diagonal[edge.junctions[side]] += blocks.diagonal[side];
            equations.gradient[edge.junctions[side]] += blocks.gradient[side];
        }
        equations
            .off_diagonal
            .push((edge.junctions, blocks.off_diagonal));
    }
    equations
}

/// The contribution of one edge to the normal equations.
#[derive(Default)]
struct EdgeBlocks {
    diagonal: [Matrix3<f64>; 2],
    off_diagonal: Matrix3<f64>,
    gradient: [Vector3<f64>; 2],
}

/// A view whose detections are found by place.
struct IndexedView<'a> {
    view: &'a ViewObservation,
    grid: SegmentGrid,
}

impl<'a> IndexedView<'a> {
    fn new(view: &'a ViewObservation) -> Self {
        let segments: Vec<_> = view.segments.iter().map(|s| s.segment).collect();
        let grid = SegmentGrid::new(&segments, view.camera.width, view.camera.height);
        Self { view, grid }
    }

    /// Names every detection with all of it at most `max_distance` from the
    /// edge's line that covers more than `min_overlap` of the edge, and others;
    /// some more than once.
    fn for_each_near(
        &self,
        edge: &LineSegment2,
        max_distance: f64,
        min_overlap: f64,
        mut visit: impl FnMut(usize),
    ) {
        if min_overlap >= MIN_OVERLAP_FOR_INDEX {
            // What covers more than this share of the edge covers a multiple of it.
            let places = (1..).map(|i| min_overlap * f64::from(i));
            for place in places.take_while(|place| *place < 1.0) {
                let point = edge.point_at(place);
                self.grid.for_each_near(&point, max_distance, &mut visit);
            }
        } else {
            (0..self.view.segments.len()).for_each(visit);
        }
    }
}

/// An edge with the detections that observe it.
pub(crate) struct ObservedEdge {
    /// Indices of its junctions.
    pub junctions: [usize; 2],
    /// One for each detection.
    pub observations: Vec<EdgeObservation>,
}

/// What one detection says about an edge.
pub(crate) struct EdgeObservation {
    /// The view's camera. Both junctions lie in front of it.
    pub camera: Camera,
    /// Both ends lie on the edge's line.
    pub detection: LineSegment2,
    /// The detection's end that belongs to each junction, where one is near.
    pub ends: [Option<Vector2<f64>>; 2],
    /// Factor of all residuals.
    pub weight: f64,
}

impl ObservedEdge {
    fn associate(
        junctions_of_edge: [usize; 2],
        views: &[IndexedView],
        junctions: &[Vector3<f64>],
        association_in_pixels: f64,
        config: &BundleAdjustmentConfig,
    ) -> Self {
        let [a, b] = junctions_of_edge.map(|junction| junctions[junction]);
        let observations = views
            .iter()
            .filter_map(|view| {
                let camera = &view.view.camera;
                let edge =
                    LineSegment2::new(project_in_front(camera, &a)?, project_in_front(camera, &b)?);
                EdgeObservation::best(&edge, view, association_in_pixels, config)
            })
            .collect();
        Self {
            junctions: junctions_of_edge,
            observations,
        }
    }

    fn cost(&self, junctions: &[Vector3<f64>], config: &BundleAdjustmentConfig) -> f64 {
        let [a, b] = self.junctions.map(|junction| junctions[junction]);
        let cost = |weighted_residual: f64| {
            (weighted_residual / config.cauchy_scale_in_pixels)
                .powi(2)
                .ln_1p()
        };
        let mut sum = 0.0;
        for observation in &self.observations {
            let projected = Option::zip(
                project_in_front(&observation.camera, &a),
                project_in_front(&observation.camera, &b),
            );
            let Some((a, b)) = projected else {
                return f64::INFINITY;
            };
            for point in observation.detection.ends() {
                sum += cost(observation.weight * line_residual(&point, &a, &b).distance);
            }
            for (pixel, end) in [a, b].iter().zip(&observation.ends) {
                if let Some(end) = end {
                    sum += cost(config.end_weight * observation.weight * (pixel - end).norm());
                }
            }
        }
        sum
    }

    fn linearise(&self, junctions: &[Vector3<f64>], config: &BundleAdjustmentConfig) -> EdgeBlocks {
        let [a, b] = self.junctions.map(|junction| junctions[junction]);
        let mut blocks = EdgeBlocks::default();
        // Derivative of the Cauchy loss by the squared residual.
        let robust = |squared_weighted_residual: f64| {
            1.0 / (1.0 + squared_weighted_residual / config.cauchy_scale_in_pixels.powi(2))
        };
        for observation in &self.observations {
            let projected = Option::zip(
                project_with_jacobian(&observation.camera, &a),
                project_with_jacobian(&observation.camera, &b),
            );
            // Cannot happen: a state with such a point has infinite cost.
            let Some(((a, jacobian_a), (b, jacobian_b))) = projected else {
                continue;
            };
            let squared_weight = observation.weight * observation.weight;
            for point in observation.detection.ends() {
                let residual = line_residual(&point, &a, &b);
                let by_junctions = [
                    jacobian_a.tr_mul(&residual.by_start),
                    jacobian_b.tr_mul(&residual.by_end),
                ];
                let weight =
                    squared_weight * robust(squared_weight * residual.distance * residual.distance);
                blocks.add_line(residual.distance, &by_junctions, weight);
            }
            let projections = [(a, jacobian_a), (b, jacobian_b)];
            for side in 0..2 {
                if let Some(end) = observation.ends[side] {
                    let (pixel, jacobian) = projections[side];
                    let residual = pixel - end;
                    let squared_weight = squared_weight * config.end_weight * config.end_weight;
                    let weight = squared_weight * robust(squared_weight * residual.norm_squared());
                    blocks.add_end(side, &residual, &jacobian, weight);
                }
            }
        }
        blocks
    }
}

impl EdgeBlocks {
    fn add_line(&mut self, distance: f64, by_junctions: &[Vector3<f64>; 2], weight: f64) {
        let [a, b] = by_junctions;
        self.off_diagonal += weight * a * b.transpose();
        for (side, by_junction) in by_junctions.iter().enumerate() {
            self.diagonal[side] += weight * by_junction * by_junction.transpose();
            self.gradient[side] += weight * distance * by_junction;
        }
    }

    fn add_end(
        &mut self,
        side: usize,
        residual: &Vector2<f64>,
        jacobian: &Matrix2x3<f64>,
        weight: f64,
    ) {
        self.diagonal[side] += weight * jacobian.tr_mul(jacobian);
        self.gradient[side] += weight * jacobian.tr_mul(residual);
    }
}

impl EdgeObservation {
    /// The detection that lies on the projected edge with the nearest ends, if
    /// any does; of equal ones the first.
    fn best(
        edge: &LineSegment2,
        indexed: &IndexedView,
        association_in_pixels: f64,
        config: &BundleAdjustmentConfig,
    ) -> Option<Self> {
        let length = edge.length();
        if length < config.min_projected_length_in_pixels {
            return None;
        }
        let max_distance = (config.max_relative_distance * length).min(association_in_pixels);
        let view = indexed.view;
        let mut best: Option<(f64, usize)> = None;
        indexed.for_each_near(edge, max_distance, config.min_overlap, |index| {
            let detection = &view.segments[index].segment;
            let fit = match_segment(edge, detection);
            let lies_on_edge = fit.perpendicular_distance < max_distance
                && fit.overlap > config.min_overlap
                && detection.length() < config.max_relative_length * length;
            let candidate = (fit.end_distance, index);
            if lies_on_edge && best.is_none_or(|best| candidate < best) {
                best = Some(candidate);
            }
        });
        let best = view.segments.get(best?.1)?;
        let near_end = |pixel: &Vector2<f64>| {
            let [start, end] = best.segment.ends();
            let nearest = if (end - pixel).norm() < (start - pixel).norm() {
                end
            } else {
                start
            };
            ((nearest - pixel).norm() < association_in_pixels).then_some(nearest)
        };
        Some(Self {
            camera: view.camera,
            detection: best.segment,
            ends: [near_end(&edge.start), near_end(&edge.end)],
            weight: best.score.max(0.0).powf(config.score_exponent),
        })
    }
}

/// Signed distance of a point from the line through two others, with its
/// derivatives by these two.
struct LineResidual {
    distance: f64,
    by_start: Vector2<f64>,
    by_end: Vector2<f64>,
}

fn line_residual(point: &Vector2<f64>, start: &Vector2<f64>, end: &Vector2<f64>) -> LineResidual {
    let length = (end - start).norm().max(MIN_PROJECTED_LENGTH);
    let direction = (end - start) / length;
    let normal = Vector2::new(direction.y, -direction.x);
    let offset = point - start;
    // Moving an end turns the line about the other end: the foot of the
    // perpendicular follows in proportion to its place between them.
    let place = offset.dot(&direction) / length;
    LineResidual {
        distance: offset.dot(&normal),
        by_start: -(1.0 - place) * normal,
        by_end: -place * normal,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};
    use nalgebra::SMatrix;

    #[test]
    fn line_residual_agrees_with_finite_differences() {
        let point = Vector2::new(31.0, 12.0);
        let ends = SMatrix::<f64, 4, 1>::new(10.0, 20.0, 90.0, -15.0);
        let residual = |x: &SMatrix<f64, 4, 1>| {
            line_residual(&point, &Vector2::new(x[0], x[1]), &Vector2::new(x[2], x[3]))
        };
        let at = residual(&ends);
        let analytic = [at.by_start.x, at.by_start.y, at.by_end.x, at.by_end.y];
        let step = 1e-5;
        for i in 0..4 {
            let mut offset = SMatrix::<f64, 4, 1>::zeros();
            offset[i] = step;
            let numeric = (residual(&(ends + offset)).distance
                - residual(&(ends - offset)).distance)
                / (2.0 * step);
            assert!((numeric - analytic[i]).abs() < 1e-8, "{i}");
        }
    }

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
        let indexed: Vec<_> = views.iter().map(IndexedView::new).collect();
        let observed: Vec<_> = edges
            .iter()
            .map(|edge| ObservedEdge::associate(*edge, &indexed, &start, 20.0, &config))
            .collect();
        assert!(
            observed
                .iter()
                .any(|e| e.observations.iter().any(|o| o.ends[0].is_some()))
        );
        let gradient = linearise(&observed, &start, &config).gradient;
        let step = 1e-7;
        for (junction, analytic) in gradient.iter().enumerate() {
            for axis in 0..3 {
                let cost_at = |offset: f64| {
                    let mut moved = start.clone();
                    moved[junction][axis] += offset;
                    total_cost(&observed, &moved, &config)
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
    fn the_index_finds_what_a_scan_finds() {
        let mut noise = Noise(41);
        let (junctions, edges) = cube();
        let mut views = views_of_edges(&cameras_on_sphere(6), &junctions, &edges);
        for view in &mut views {
            let segments = view.segments.clone();
            for _ in 0..20 {
                for detection in &segments {
                    let mut cut = *detection;
                    let [from, to] = [noise.uniform(), noise.uniform()].map(|x| 0.5 + 0.6 * x);
                    cut.segment = LineSegment2::new(
                        detection.segment.point_at(from) + 5.0 * noise.vector().xy(),
                        detection.segment.point_at(to) + 5.0 * noise.vector().xy(),
                    );
                    view.segments.push(cut);
                }
            }
            view.segments.extend(segments);
        }
        let moved: Vec<_> = junctions
            .iter()
            .map(|x| x + 0.01 * noise.vector())
            .collect();
        for min_overlap in [0.4, 0.05, 0.7] {
            let config = BundleAdjustmentConfig {
                min_overlap,
                ..Default::default()
            };
            for view in &views {
                let indexed = IndexedView::new(view);
                for [a, b] in &edges {
                    let project = |i: usize| view.camera.project(&moved[i]).pixel;
                    let edge = LineSegment2::new(project(*a), project(*b));
                    let best = EdgeObservation::best(&edge, &indexed, 8.0, &config);
                    assert_eq!(
                        best.map(|best| best.detection),
                        best_by_scan(&edge, view, 8.0, &config)
                    );
                }
            }
        }
    }

    /// The definition: every detection of the view is looked at.
    fn best_by_scan(
        edge: &LineSegment2,
        view: &ViewObservation,
        association_in_pixels: f64,
        config: &BundleAdjustmentConfig,
    ) -> Option<LineSegment2> {
        let length = edge.length();
        let max_distance = (config.max_relative_distance * length).min(association_in_pixels);
        view.segments
            .iter()
            .map(|detection| (match_segment(edge, &detection.segment), detection.segment))
            .filter(|(fit, detection)| {
                fit.perpendicular_distance < max_distance
                    && fit.overlap > config.min_overlap
                    && detection.length() < config.max_relative_length * length
            })
            .min_by(|(a, _), (b, _)| a.end_distance.total_cmp(&b.end_distance))
            .map(|(_, detection)| detection)
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
        let adjusted = bundle_adjust(&views, &start, &edges, 12.0, &config);
        for (adjusted, truth) in adjusted.iter().zip(&truth) {
            assert!((adjusted - truth).norm() < 1e-4, "{adjusted} {truth}");
        }
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
        assert!(adjusted.len() > 100);
        for (adjusted, truth) in adjusted.iter().zip(&truth) {
            assert!((adjusted - truth).norm() < 1e-4);
        }
    }

    #[test]
    fn without_observations_nothing_moves() {
        let NoisyCube {
            truth,
            edges,
            start,
        } = noisy_cube(1);
        let config = BundleAdjustmentConfig::default();
        assert_eq!(bundle_adjust(&[], &start, &edges, 6.0, &config), start);
        let views = views_of_edges(&cameras_on_sphere(3), &truth, &edges);
        assert_eq!(bundle_adjust(&views, &start, &[], 6.0, &config), start);
        let wrong = [[0, 8], [1, 1]];
        assert_eq!(bundle_adjust(&views, &start, &wrong, 6.0, &config), start);
    }
}
