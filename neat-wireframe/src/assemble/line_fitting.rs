//! A 3D line through the edgels beside its projections, in all views at once.

use super::edge_samples::Images;
use super::projected_line::ProjectedLine;
use super::view_segments::PreparedView;
use crate::solve::{Cauchy, LeastSquares, Options, Reweighted, minimise, reweighted};
use nalgebra::{Const, DimMin, Matrix3x2, Matrix4, SVector, Vector2, Vector3, Vector4};
use neat_core::LineSegment3;

/// Fewer edgels determine no line in space.
const MIN_EDGELS: usize = 8;
/// Scale of the Cauchy loss, as a share of the reach: edgels near its end are likelier
/// those of something else.
const LOSS_SCALE: f64 = 0.6;
const OPTIONS: Options = Options {
    max_iterations: 10,
    max_attempts: 6,
    initial_damping: 1e-3,
    min_damping: 1e-9,
    decrease: 0.2,
    relative_tolerance: 1e-4,
};

impl Images<'_> {
    /// The line through the edgels within `reach` pixels beside `line` in `views`. Its ends
    /// move across it only.
    pub(super) fn fit(
        &self,
        line: &LineSegment3,
        views: impl Iterator<Item = usize>,
        reach: f64,
    ) -> LineSegment3 {
        self.problem(line, views, reach)
            .map_or(*line, |problem| minimise(&problem, *line, &OPTIONS).0)
    }

    /// Two directions across a line, and what the edgels beside it in `views` know of the places
    /// of its start and its end along both: the inverse of their covariance, times the variance of
    /// an edgel in square pixels. `None` if there are too few.
    pub(super) fn information(
        &self,
        line: &LineSegment3,
        views: impl Iterator<Item = usize>,
    ) -> Option<(Matrix3x2<f64>, Matrix4<f64>)> {
        let equations = self.problem(line, views, self.reach)?.linearise(line)?;
        Some((equations.across, equations.hessian))
    }

    fn problem(
        &self,
        line: &LineSegment3,
        views: impl Iterator<Item = usize>,
        reach: f64,
    ) -> Option<LineProblem<'_>> {
        let mut observations = Vec::new();
        for view in views {
            let edgels = self.edgels_beside(view, line, reach);
            // Errors of one view are alike: it weighs as the root of its samples.
            let weight = (edgels.len() as f64).sqrt().recip();
            let observed = edgels.into_iter().map(|pixel| Observation {
                view,
                pixel,
                weight,
            });
            observations.extend(observed);
        }
        (observations.len() >= MIN_EDGELS).then_some(LineProblem {
            views: self.views,
            observations,
            loss: Cauchy {
                scale: LOSS_SCALE * self.reach,
            },
        })
    }
}

/// An edgel of the line.
struct Observation {
    view: usize,
    pixel: Vector2<f64>,
    weight: f64,
}

struct LineProblem<'a> {
    views: &'a [PreparedView],
    /// By view.
    observations: Vec<Observation>,
    loss: Cauchy,
}

struct LineEquations {
    across: Matrix3x2<f64>,
    hessian: Matrix4<f64>,
    gradient: Vector4<f64>,
}

impl LeastSquares for LineProblem<'_> {
    type State = LineSegment3;
    type Equations = LineEquations;

    fn cost(&self, line: &LineSegment3) -> f64 {
        let of_view = |observations: &[Observation]| {
            let camera = &self.views[observations[0].view].camera;
            ProjectedLine::new(camera, line).map_or(f64::INFINITY, |line| {
                let cost = |o: &Observation| o.weight * self.loss.cost(line.distance(&o.pixel));
                observations.iter().map(cost).sum()
            })
        };
        (self.observations)
            .chunk_by(|a, b| a.view == b.view)
            .map(of_view)
            .sum()
    }

    fn linearise(&self, line: &LineSegment3) -> Option<LineEquations> {
        let across = directions_across(line)?;
        let mut hessian = Matrix4::zeros();
        let mut gradient = Vector4::zeros();
        for observations in self.observations.chunk_by(|a, b| a.view == b.view) {
            let camera = &self.views[observations[0].view].camera;
            let projected = ProjectedLine::new(camera, line)?;
            for Observation { pixel, weight, .. } in observations {
                let found = projected.distance_with_gradient(camera, pixel);
                let [start, end] = found.by_points.map(|by_point| across.tr_mul(&by_point));
                let row = Vector4::new(start.x, start.y, end.x, end.y);
                let robust = weight * self.loss.weight(found.distance * found.distance);
                hessian += robust * row * row.transpose();
                gradient += robust * found.distance * row;
            }
        }
        Some(LineEquations {
            across,
            hessian,
            gradient,
        })
    }

    fn step(
        &self,
        line: &LineSegment3,
        equations: &LineEquations,
        damping: f64,
    ) -> Option<LineSegment3> {
        let LineEquations {
            across,
            hessian,
            gradient,
        } = equations;
        let damped = hessian + Matrix4::from_diagonal(&hessian.diagonal()) * damping;
        let step = damped.cholesky()?.solve(gradient);
        Some(LineSegment3::new(
            line.start - across * step.fixed_rows::<2>(0),
            line.end - across * step.fixed_rows::<2>(2),
        ))
    }
}

/// The change of a model's parameters that takes away the distances of edgels, by how each
/// distance changes with them: robustly, for edgels within `reach` pixels. Parameters that no
/// edgel tells of are kept by `ridge` per edgel, where a pixel is `pixel` long. `None` with fewer
/// than `least` edgels.
pub(super) fn change_by_edgels<const N: usize>(
    rows: &[(SVector<f64, N>, f64)],
    least: usize,
    reach: f64,
    ridge: f64,
    pixel: f64,
) -> Option<Reweighted<N>>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    if rows.len() < least {
        return None;
    }
    reweighted(
        rows,
        loss_of_reach(reach),
        ridge * rows.len() as f64 / (pixel * pixel),
    )
}

/// Edgels farther off than half the reach count less and less.
pub(super) fn loss_of_reach(reach: f64) -> Cauchy {
    Cauchy { scale: 0.5 * reach }
}

/// Two directions perpendicular to a line and to each other.
pub(super) fn directions_across(line: &LineSegment3) -> Option<Matrix3x2<f64>> {
    let direction = (line.end - line.start).try_normalize(1e-12)?;
    let side = Vector3::ith(direction.iamin(), 1.0);
    let first = direction.cross(&side).normalize();
    Some(Matrix3x2::from_columns(&[first, direction.cross(&first)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, cube_edge};

    #[test]
    fn a_line_beside_an_edge_comes_to_lie_on_it() {
        let cube = TestViews::of_cube(12);
        let images = cube.images();
        let truth = cube_edge(5);
        let offset = Vector3::new(0.004, -0.003, 0.002);
        let beside = LineSegment3::new(truth.start + offset, truth.end - offset);
        let fitted = images.fit(&beside, 0..12, 4.0);
        for end in truth.ends() {
            let foot = fitted.point_at(fitted.line_parameter(&end));
            assert!((foot - end).norm() < 1e-4, "{}", (foot - end).norm());
        }
        // Nothing to go by: it stays.
        let far = truth.map(|end| end * 5.0);
        assert_eq!(images.fit(&far, 0..12, 1.0), far);
    }

    #[test]
    fn gradients_agree_with_finite_differences() {
        let cube = TestViews::of_cube(5);
        let images = cube.images();
        let line = cube_edge(2).map(|end| end + Vector3::new(0.002, 0.001, -0.003));
        let observations = (0..5)
            .flat_map(|view| {
                let edgels = images.edgels_beside(view, &line, 4.0);
                edgels.into_iter().map(move |pixel| Observation {
                    view,
                    pixel,
                    weight: 0.5,
                })
            })
            .collect();
        let problem = LineProblem {
            views: images.views,
            observations,
            loss: Cauchy { scale: 1.0 },
        };
        let equations = problem.linearise(&line).unwrap();
        let step = 1e-6;
        for k in 0..4 {
            let moved = |sign: f64| {
                let mut shift = Vector4::zeros();
                shift[k] = sign * step;
                let across = equations.across;
                problem.cost(&LineSegment3::new(
                    line.start + across * shift.fixed_rows::<2>(0),
                    line.end + across * shift.fixed_rows::<2>(2),
                ))
            };
            let numeric = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            // The loss is a function of the square, which the driver halves.
            let analytic = 2.0 * equations.gradient[k];
            assert!((numeric - analytic).abs() < 1e-4 * (1.0 + analytic.abs()));
        }
    }
}
