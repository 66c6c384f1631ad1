//! A 3D line with the certainty that its 2D segments give it.
//!
//! Few views, short baselines and planes that all but coincide leave a line
//! uncertain in depth while its images are sharp. Whether two lines meet must
//! therefore be asked of their images, not of a distance in space.

use super::graph_adjustment::segment_of_edge;
use super::junction_graph::JunctionGraph;
use super::line_refinement::{LineRefinementConfig, directions_across, normal_equations};
use super::projected_line::ProjectedLine;
use super::view_segments::{SegmentId, TrackView};
use crate::projection::project_in_front;
use nalgebra::{Matrix3, Matrix3x2, Matrix4, Vector3};
use neat_core::LineSegment3;
use rayon::prelude::*;

/// No line is less certain than this, in pixels at its own depth: keeps lines that
/// their views do not determine apart from those that nothing determines.
const FARTHEST_IN_PIXELS: f64 = 100.0;

/// A 3D segment with its covariance and the views that show it.
pub(super) struct CertainLine {
    /// The segment.
    pub line: LineSegment3,
    /// Unit vector from its start to its end.
    pub direction: Vector3<f64>,
    /// Length in the world of one pixel at its middle: the median of its views.
    pub pixel: f64,
    /// The views that show it, ascending.
    pub views: Vec<usize>,
    /// Two unit vectors across it.
    across: Matrix3x2<f64>,
    /// Covariance of the offsets across the line of its start and its end, if 2D
    /// segments have one pixel of noise.
    covariance: Matrix4<f64>,
}

impl CertainLine {
    /// `None` for a segment without length or supports.
    pub(super) fn new(
        views: &[TrackView],
        supports: &[SegmentId],
        line: &LineSegment3,
        refinement: &LineRefinementConfig,
    ) -> Option<Self> {
        let direction = (line.end - line.start).try_normalize(1e-12)?;
        let across = directions_across(line)?;
        let mut views_of_line: Vec<usize> = supports.iter().map(|id| id.view).collect();
        views_of_line.dedup();
        let middle = line.point_at(0.5);
        let mut pixels: Vec<f64> = views_of_line
            .iter()
            .map(|view| views[*view].pixel_size_at(&middle))
            .collect();
        pixels.sort_by(f64::total_cmp);
        let pixel = *pixels.get(pixels.len() / 2)?;
        let (hessian, _) = normal_equations(views, supports, line, &across, refinement.loss());
        let least = (FARTHEST_IN_PIXELS * pixel).powi(-2);
        let covariance = (hessian + Matrix4::identity() * least)
            .cholesky()?
            .inverse();
        Some(Self {
            line: *line,
            direction,
            pixel,
            views: views_of_line,
            across,
            covariance,
        })
    }

    /// Length in pixels.
    pub(super) fn length_in_pixels(&self) -> f64 {
        self.line.length() / self.pixel
    }

    /// What is known of the place of the line's point at `parameter` (0 at the
    /// start, 1 at the end, prolonged beyond): the inverse of its covariance,
    /// without anything along the line.
    pub(super) fn information_at(&self, parameter: f64) -> Matrix3<f64> {
        let shares = [1.0 - parameter, parameter];
        let mut covariance = nalgebra::Matrix2::zeros();
        for (i, first) in shares.iter().enumerate() {
            for (j, second) in shares.iter().enumerate() {
                covariance += self.covariance.fixed_view::<2, 2>(2 * i, 2 * j) * (first * second);
            }
        }
        covariance
            .try_inverse()
            .map_or_else(Matrix3::zeros, |information| {
                self.across * information * self.across.transpose()
            })
    }

    /// Mean distance in pixels of a point's image from the line's, over the views
    /// that show the line; infinite where the point is behind one of them.
    pub(super) fn distance_in_pixels(&self, views: &[TrackView], point: &Vector3<f64>) -> f64 {
        mean_distance_in_pixels(views, &self.views, &self.line, point)
    }
}

/// Every edge with its certainty.
pub(super) fn certain_lines(
    views: &[TrackView],
    graph: &JunctionGraph,
    refinement: &LineRefinementConfig,
) -> Vec<Option<CertainLine>> {
    graph
        .edges
        .par_iter()
        .map(|edge| {
            let line = segment_of_edge(graph, edge);
            CertainLine::new(views, &edge.supports, &line, refinement)
        })
        .collect()
}

/// Mean distance in pixels of a point's image from a line's over some views.
pub(super) fn mean_distance_in_pixels(
    views: &[TrackView],
    of_views: &[usize],
    line: &LineSegment3,
    point: &Vector3<f64>,
) -> f64 {
    let distance = |view: &usize| {
        let camera = &views[*view].camera;
        Option::zip(
            ProjectedLine::new(camera, line),
            project_in_front(camera, point),
        )
        .map_or(f64::INFINITY, |(line, pixel)| line.distance(&pixel).abs())
    };
    of_views.iter().map(distance).sum::<f64>() / of_views.len().max(1) as f64
}

/// Where two lines meet, if they do.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meeting {
    /// The most likely common point.
    pub place: Vector3<f64>,
    /// Its parameters along both lines.
    pub parameters: [f64; 2],
    /// The larger of its mean distances from both lines in their own images.
    pub miss_in_pixels: f64,
}

/// The most likely common point of two lines that enclose an angle of at least
/// this sine.
pub(super) fn meeting(
    views: &[TrackView],
    a: &CertainLine,
    b: &CertainLine,
    min_sine: f64,
) -> Option<Meeting> {
    let cosine = a.direction.dot(&b.direction);
    let squared_sine = 1.0 - cosine * cosine;
    if squared_sine < min_sine * min_sine {
        return None;
    }
    let offset = b.line.start - a.line.start;
    let along = (offset.dot(&a.direction) - cosine * offset.dot(&b.direction)) / squared_sine;
    let nearest_on_a = a.line.start + along * a.direction;
    let mut place = nearest_on_a;
    // The certainty changes along the lines: once at the nearest points, once at
    // the place itself.
    for _ in 0..2 {
        let mut information = Matrix3::zeros();
        let mut right = Vector3::zeros();
        for line in [a, b] {
            let parameter = line.line.line_parameter(&place);
            let of_line = line.information_at(parameter);
            information += of_line;
            right += of_line * line.line.point_at(parameter);
        }
        place = information.cholesky()?.solve(&right);
    }
    let miss_in_pixels = a
        .distance_in_pixels(views, &place)
        .max(b.distance_in_pixels(views, &place));
    miss_in_pixels.is_finite().then(|| Meeting {
        place,
        parameters: [a, b].map(|line| line.line.line_parameter(&place)),
        miss_in_pixels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::test_tracks::{cube_edge, cube_views, members_of_edge};
    use crate::test_scenes::cube;

    fn certain(views: &[TrackView], edge: usize, shift: Vector3<f64>) -> CertainLine {
        let line = cube_edge(edge).map(|end| end + shift);
        let members = members_of_edge(views, edge);
        CertainLine::new(views, &members, &line, &LineRefinementConfig::default()).unwrap()
    }

    #[test]
    fn edges_of_a_cube_meet_in_their_corner_and_others_miss() {
        let views = cube_views(10);
        let (_, edges) = cube();
        let [a, b] = [0, 1].map(|edge| certain(&views, edge, Vector3::zeros()));
        assert_eq!(edges[0][0], edges[1][0]);
        let found = meeting(&views, &a, &b, 0.5).unwrap();
        assert!((found.place - cube().0[0]).norm() < 1e-9);
        assert!(found.parameters.iter().all(|t| t.abs() < 1e-9));
        assert!(found.miss_in_pixels < 1e-6);

        let beside = certain(&views, 1, 0.05 * b.direction.cross(&a.direction));
        assert!(meeting(&views, &a, &beside, 0.5).unwrap().miss_in_pixels > 3.0);
        assert!(meeting(&views, &a, &a, 0.5).is_none());
    }

    #[test]
    fn a_line_is_less_certain_beyond_its_end_and_with_fewer_views() {
        let views = cube_views(10);
        let line = certain(&views, 3, Vector3::zeros());
        let side = line.across.column(0).into_owned();
        let at =
            |line: &CertainLine, t: f64| line.information_at(t).dot(&(side * side.transpose()));
        assert!(at(&line, 0.5) > 2.0 * at(&line, 2.0));
        assert!(at(&line, 0.5) > 0.0);
        let members = &members_of_edge(&views, 3)[..3];
        let config = LineRefinementConfig::default();
        let few = CertainLine::new(&views, members, &line.line, &config).unwrap();
        assert!(at(&line, 0.5) > 1.5 * at(&few, 0.5));
        assert!(
            line.information_at(0.5) * line.direction == Vector3::zeros()
                || (line.information_at(0.5) * line.direction).norm() < 1e-6 * at(&line, 0.5)
        );
    }

    #[test]
    fn nothing_is_certain_without_supports_or_length() {
        let views = cube_views(4);
        let config = LineRefinementConfig::default();
        let line = cube_edge(0);
        assert!(CertainLine::new(&views, &[], &line, &config).is_none());
        let point = LineSegment3::new(line.start, line.start);
        assert!(CertainLine::new(&views, &members_of_edge(&views, 0), &point, &config).is_none());
    }
}
