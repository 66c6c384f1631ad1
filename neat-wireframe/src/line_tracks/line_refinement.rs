//! The infinite line that a track's 2D segments agree on, and which part of it
//! they show.

use super::projected_line::{LineDistance, ProjectedLine, line_parameter_of_ray};
use super::view_segments::{SegmentId, TrackView, segment_of};
use crate::solve::{Cauchy, LeastSquares, Options, minimise};
use nalgebra::{Matrix3x2, Matrix4, Vector3, Vector4};
use neat_core::LineSegment3;
use serde::{Deserialize, Serialize};

/// Settings of the refinement of a line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LineRefinementConfig {
    /// Scale of the Cauchy loss.
    pub cauchy_scale_in_pixels: f64,
    /// Accepted steps at most.
    pub max_iterations: usize,
    /// A part of the line counts if this many views show it …
    pub min_cover: usize,
    /// … and at least this share of the views that show its best shown part:
    /// single detections often run on past the end.
    pub min_cover_share: f64,
    /// Parts with a smaller gap between them are one.
    pub max_gap_in_pixels: f64,
    /// The same as a share of the shorter part.
    pub max_relative_gap: f64,
}

impl Default for LineRefinementConfig {
    fn default() -> Self {
        Self {
            cauchy_scale_in_pixels: 1.0,
            max_iterations: 15,
            min_cover: 2,
            min_cover_share: 0.34,
            max_gap_in_pixels: 6.0,
            max_relative_gap: 0.15,
        }
    }
}

impl LineRefinementConfig {
    /// Of the distances in pixels.
    pub(super) fn loss(&self) -> Cauchy {
        Cauchy {
            scale: self.cauchy_scale_in_pixels,
        }
    }
}

/// Levenberg–Marquardt on the distances of the members' ends from the projected
/// line. The two points that carry the line move across it only: four degrees of
/// freedom.
pub(super) fn refine_line(
    views: &[TrackView],
    members: &[SegmentId],
    line: &LineSegment3,
    config: &LineRefinementConfig,
) -> LineSegment3 {
    let problem = LineProblem {
        views,
        members,
        loss: config.loss(),
    };
    let options = Options {
        max_iterations: config.max_iterations,
        max_attempts: 6,
        initial_damping: 1e-3,
        min_damping: 1e-9,
        decrease: 0.2,
        relative_tolerance: 1e-5,
    };
    minimise(&problem, *line, &options).0
}

/// A line and the 2D segments that show it.
struct LineProblem<'a> {
    views: &'a [TrackView],
    members: &'a [SegmentId],
    loss: Cauchy,
}

/// The normal equations of a line's two points, each moving across the line.
struct LineEquations {
    across: Matrix3x2<f64>,
    hessian: Matrix4<f64>,
    gradient: Vector4<f64>,
}

impl LeastSquares for LineProblem<'_> {
    type State = LineSegment3;
    type Equations = LineEquations;

    fn cost(&self, line: &LineSegment3) -> f64 {
        let of_member = |id: &SegmentId| {
            let ends = segment_of(self.views, *id).segment.ends();
            ProjectedLine::new(&self.views[id.view].camera, line).map_or(f64::INFINITY, |line| {
                let cost = |end| self.loss.cost(line.distance(end));
                ends.iter().map(cost).sum()
            })
        };
        self.members.iter().map(of_member).sum()
    }

    fn linearise(&self, line: &LineSegment3) -> Option<LineEquations> {
        let across = directions_across(line)?;
        let (hessian, gradient) =
            normal_equations(self.views, self.members, line, &across, self.loss);
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

/// Two unit vectors across a line; `None` for a line without direction.
pub(super) fn directions_across(line: &LineSegment3) -> Option<Matrix3x2<f64>> {
    let direction = (line.end - line.start).try_normalize(1e-12)?;
    let side = Vector3::ith(direction.iamin(), 1.0);
    let first = direction.cross(&side).normalize();
    Some(Matrix3x2::from_columns(&[first, direction.cross(&first)]))
}

/// The normal equations of both points of a line in the frame `across` it, with
/// the weights of the robust loss.
pub(super) fn normal_equations(
    views: &[TrackView],
    members: &[SegmentId],
    line: &LineSegment3,
    across: &Matrix3x2<f64>,
    loss: Cauchy,
) -> (Matrix4<f64>, Vector4<f64>) {
    let mut hessian = Matrix4::zeros();
    let mut gradient = Vector4::zeros();
    for id in members {
        let camera = &views[id.view].camera;
        let Some(projected) = ProjectedLine::new(camera, line) else {
            continue;
        };
        for end in segment_of(views, *id).segment.ends() {
            let LineDistance {
                distance,
                by_points: [by_start, by_end],
            } = projected.distance_with_gradient(camera, &end);
            let [start, end] = [by_start, by_end].map(|by_point| across.tr_mul(&by_point));
            let row = Vector4::new(start.x, start.y, end.x, end.y);
            let robust = loss.weight(distance * distance);
            hessian += robust * row * row.transpose();
            gradient += robust * distance * row;
        }
    }
    (hessian, gradient)
}

/// The interval of a line's parameter that a 2D segment shows, ascending.
pub(super) fn shown_interval(
    views: &[TrackView],
    id: SegmentId,
    line: &LineSegment3,
) -> Option<[f64; 2]> {
    let center = &views[id.view].camera.center_in_world;
    let [a, b] = segment_of(views, id)
        .rays
        .map(|ray| line_parameter_of_ray(line, center, &ray));
    let (a, b) = Option::zip(a, b)?;
    Some([a.min(b), a.max(b)])
}

/// The parts of a line that enough views show, as intervals of its parameter,
/// ascending and with small gaps closed.
pub(super) fn covered_parts(
    views: &[TrackView],
    members: &[SegmentId],
    line: &LineSegment3,
    config: &LineRefinementConfig,
) -> Vec<[f64; 2]> {
    let mut by_view: Vec<(usize, [f64; 2])> = members
        .iter()
        .filter_map(|id| Some((id.view, shown_interval(views, *id, line)?)))
        .collect();
    by_view.sort_by(|(v, a), (w, b)| v.cmp(w).then(a[0].total_cmp(&b[0])));
    // What one view shows twice counts once.
    let mut shown: Vec<(usize, [f64; 2])> = Vec::new();
    for (view, interval) in by_view {
        match shown.last_mut() {
            Some((last, [_, high])) if *last == view && interval[0] <= *high => {
                *high = high.max(interval[1]);
            }
            _ => shown.push((view, interval)),
        }
    }
    let mut steps: Vec<(f64, i32)> = shown
        .iter()
        .flat_map(|(_, [low, high])| [(*low, 1), (*high, -1)])
        .collect();
    steps.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));

    let mut cover = 0;
    let mut most = 0;
    for (_, step) in &steps {
        cover += step;
        most = most.max(cover);
    }
    let share = (config.min_cover_share * f64::from(most)).ceil() as i32;
    let min_cover = share.max(config.min_cover as i32);
    let mut parts: Vec<[f64; 2]> = Vec::new();
    let mut cover = 0;
    let mut begin = None;
    for (place, step) in steps {
        cover += step;
        if cover >= min_cover && begin.is_none() {
            begin = Some(place);
        } else if cover < min_cover
            && let Some(low) = begin.take()
        {
            parts.push([low, place]);
        }
    }
    let pixel = pixel_in_parameters(views, members, line);
    let mut parts = close_gaps(parts, pixel, config);
    // A point is no part: it has no direction.
    parts.retain(|[low, high]| high - low > pixel);
    parts
}

/// Length of a pixel on the line in units of its parameter, at the median of the
/// members' views.
fn pixel_in_parameters(views: &[TrackView], members: &[SegmentId], line: &LineSegment3) -> f64 {
    let middle = line.point_at(0.5);
    let mut sizes: Vec<f64> = members
        .iter()
        .map(|id| views[id.view].pixel_size_at(&middle))
        .collect();
    sizes.sort_by(f64::total_cmp);
    sizes
        .get(sizes.len() / 2)
        .map_or(0.0, |size| size / line.length())
}

fn close_gaps(parts: Vec<[f64; 2]>, pixel: f64, config: &LineRefinementConfig) -> Vec<[f64; 2]> {
    let mut closed: Vec<[f64; 2]> = Vec::new();
    for part in parts {
        if let Some(last) = closed.last_mut() {
            let shorter = (last[1] - last[0]).min(part[1] - part[0]);
            let allowed = (config.max_gap_in_pixels * pixel).max(config.max_relative_gap * shorter);
            if part[0] - last[1] <= allowed {
                last[1] = part[1];
                continue;
            }
        }
        closed.push(part);
    }
    closed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::test_tracks::{cube_edge, cube_views, end_distance, members_of_edge};

    #[test]
    fn a_displaced_line_returns_in_spite_of_a_false_member() {
        let views = cube_views(12);
        let mut members = members_of_edge(&views, 5);
        members[3].segment = 6;
        let truth = cube_edge(5);
        let offset = Vector3::new(0.02, -0.015, 0.01);
        let displaced = LineSegment3::new(truth.start + offset, truth.end - offset);
        let config = LineRefinementConfig {
            max_iterations: 60,
            ..Default::default()
        };
        let refined = refine_line(&views, &members, &displaced, &config);
        for end in truth.ends() {
            let foot = refined.point_at(refined.line_parameter(&end));
            assert!((foot - end).norm() < 2e-3, "{}", (foot - end).norm());
        }
    }

    #[test]
    fn covered_parts_are_what_enough_views_show() {
        let views = cube_views(12);
        let members = members_of_edge(&views, 5);
        let truth = cube_edge(5);
        // A line twice as long: the edge is its middle half.
        let long = LineSegment3::new(truth.point_at(-0.5), truth.point_at(1.5));
        let config = LineRefinementConfig::default();
        let parts = covered_parts(&views, &members, &long, &config);
        let [[low, high]] = parts[..] else {
            panic!("{parts:?}");
        };
        let part = LineSegment3::new(long.point_at(low), long.point_at(high));
        assert!(end_distance(&part, &truth) < 1e-6);
        assert!(covered_parts(&views, &members[..1], &long, &config).is_empty());
    }

    #[test]
    fn small_gaps_close_and_large_ones_do_not() {
        let config = LineRefinementConfig::default();
        let parts = vec![[0.0, 0.2], [0.21, 0.4], [0.7, 1.0]];
        assert_eq!(close_gaps(parts, 0.001, &config), [[0.0, 0.4], [0.7, 1.0]]);
    }
}
