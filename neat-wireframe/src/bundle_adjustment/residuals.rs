//! What detections say about an edge: residuals, their loss and their derivatives.

use crate::projection::{project_in_front, project_with_jacobian};
use crate::solve::Cauchy;
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use neat_core::{Camera, LineSegment2};

/// Projected edges shorter than this are treated as this long.
const MIN_PROJECTED_LENGTH: f64 = 1e-6;

/// How residuals count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loss {
    /// Scale of the Cauchy loss of all residuals.
    pub cauchy_scale_in_pixels: f64,
    /// Weight of junction-to-end residuals relative to end-to-line ones.
    pub end_weight: f64,
}

/// An edge with the detections that observe it.
#[derive(Clone, Debug)]
pub struct ObservedEdge {
    /// Indices of its junctions.
    pub junctions: [usize; 2],
    /// One for each detection.
    pub observations: Vec<EdgeObservation>,
}

/// What one detection says about an edge.
#[derive(Clone, Debug)]
pub struct EdgeObservation {
    /// The view's camera. Both junctions lie in front of it.
    pub camera: Camera,
    /// Both ends lie on the edge's line.
    pub detection: LineSegment2,
    /// The detection's end that belongs to each junction, where one is near.
    pub ends: [Option<Vector2<f64>>; 2],
    /// Factor of all residuals.
    pub weight: f64,
}

impl Loss {
    fn cauchy(&self) -> Cauchy {
        Cauchy {
            scale: self.cauchy_scale_in_pixels,
        }
    }
}

/// The contribution of one edge to the normal equations.
#[derive(Default)]
pub(super) struct EdgeBlocks {
    pub diagonal: [Matrix3<f64>; 2],
    pub off_diagonal: Matrix3<f64>,
    pub gradient: [Vector3<f64>; 2],
}

impl ObservedEdge {
    /// The loss of all residuals; infinite where a junction has moved behind a
    /// camera that sees it.
    pub(super) fn cost(&self, junctions: &[Vector3<f64>], loss: &Loss) -> f64 {
        let [a, b] = self.junctions.map(|junction| junctions[junction]);
        let cauchy = loss.cauchy();
        let cost = |weighted_residual: f64| cauchy.cost(weighted_residual);
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
                    sum += cost(loss.end_weight * observation.weight * (pixel - end).norm());
                }
            }
        }
        sum
    }

    /// What the edge contributes to the normal equations.
    pub(super) fn linearise(&self, junctions: &[Vector3<f64>], loss: &Loss) -> EdgeBlocks {
        let [a, b] = self.junctions.map(|junction| junctions[junction]);
        let mut blocks = EdgeBlocks::default();
        let cauchy = loss.cauchy();
        let robust = |squared: f64| cauchy.weight(squared);
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
                    let squared_weight = squared_weight * loss.end_weight * loss.end_weight;
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
}
