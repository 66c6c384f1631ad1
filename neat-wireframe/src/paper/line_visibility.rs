//! Views that show an edge along its length, too. Not in the paper.
//!
//! [Visibility](super::visibility) as published asks for a 2D segment between both ends of an
//! edge. On photographs something hides a part of it, or a detector cuts it. But where a face is
//! seen from its side all its edges lie on one line, and so does whatever else runs in it: so
//! each 2D segment speaks for one edge, and which that is the field says.

use super::neat_lines::NeatLine;
use super::visibility::{VisibilityConfig, squared_reprojection_distance};
use crate::ViewObservation;
use crate::interval_cover::covered_length;
use crate::projection::project_in_front;
use nalgebra::{Vector2, Vector3};
use neat_core::{LineSegment2, LineSegment3};
use rayon::prelude::*;

/// In how many views each edge is [seen](super::seeing_views), or 2D segments cover more than
/// half of it.
///
/// A 2D segment that lies on the lines of several edges belongs to the one that is nearest to
/// its NEAT line in space.
pub(super) fn views_that_show(
    edges: &[LineSegment3],
    views: &[ViewObservation],
    lines_by_view: &[Vec<NeatLine>],
    config: &VisibilityConfig,
) -> Vec<usize> {
    let shown: Vec<Vec<bool>> = (views.par_iter().zip(lines_by_view))
        .map(|(view, lines)| shown_in(edges, view, lines, config))
        .collect();
    let count = |edge: usize| shown.iter().filter(|shown| shown[edge]).count();
    (0..edges.len()).map(count).collect()
}

/// Whether one view shows each edge.
fn shown_in(
    edges: &[LineSegment3],
    view: &ViewObservation,
    lines: &[NeatLine],
    config: &VisibilityConfig,
) -> Vec<bool> {
    let project = |edge: &LineSegment3| {
        let [start, end] = edge.ends().map(|end| project_in_front(&view.camera, &end));
        Some(LineSegment2::new(start?, end?))
    };
    let projected: Vec<Option<LineSegment2>> = edges.iter().map(project).collect();
    let mut covered = vec![Vec::new(); edges.len()];
    for line in lines {
        let detected = &view.segments[line.segment_in_view];
        if detected.score <= config.min_segment_score {
            continue;
        }
        let lies_on = |(edge, projected): (usize, &Option<LineSegment2>)| {
            let max = config.max_squared_distance;
            let stretch = stretch_along(projected.as_ref()?, &detected.segment, max)?;
            Some((edge, stretch, distance_to_edge(&line.segment, &edges[edge])))
        };
        let nearest = (projected.iter().enumerate())
            .filter_map(lies_on)
            .min_by(|(.., a), (.., b)| a.total_cmp(b));
        if let Some((edge, stretch, _)) = nearest {
            covered[edge].push(stretch);
        }
    }
    let is_shown = |(edge, stretches): (&LineSegment3, _)| {
        covered_length(stretches, [0.0, 1.0]) > 0.5
            || squared_reprojection_distance(edge, view, config.min_segment_score)
                < config.max_squared_distance
    };
    edges.iter().zip(covered).map(is_shown).collect()
}

/// From where to where along a projected edge, from 0 to 1, a 2D segment runs whose ends lie
/// on its line: nearer than `max_squared_distance` in squared pixels, summed over both. `None`
/// if they do not, or next to the edge.
fn stretch_along(
    edge: &LineSegment2,
    detected: &LineSegment2,
    max_squared_distance: f64,
) -> Option<[f64; 2]> {
    let squared = |end: &Vector2<f64>| edge.distance_to_line(end).powi(2);
    if detected.ends().iter().map(squared).sum::<f64>() >= max_squared_distance {
        return None;
    }
    let mut stretch = detected.ends().map(|end| edge.line_parameter(&end));
    stretch.sort_by(f64::total_cmp);
    (stretch[0] < 1.0 && stretch[1] > 0.0).then_some(stretch)
}

/// Sum of the distances of both ends of a line from an edge.
fn distance_to_edge(line: &LineSegment3, edge: &LineSegment3) -> f64 {
    let distance = |end: &Vector3<f64>| edge.distance_to_point(end);
    line.ends().iter().map(distance).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::observation;

    /// Projects onto pixels (20, 50) and (80, 50).
    fn edge() -> LineSegment3 {
        LineSegment3::new(Vector3::new(-0.6, 0.0, 2.0), Vector3::new(0.6, 0.0, 2.0))
    }

    /// The views that show `edges`, of one with these 2D segments along y = `at`, whose NEAT
    /// lines all lie at `line`.
    fn shown(
        edges: &[LineSegment3],
        stretches: &[[f64; 2]],
        at: f64,
        line: LineSegment3,
    ) -> Vec<usize> {
        let segments: Vec<_> = (stretches.iter())
            .map(|[from, to]| ([*from, at], [*to, at], 0.9))
            .collect();
        let lines = (0..segments.len()).map(|segment_in_view| NeatLine {
            segment_in_view,
            segment: line,
            rays: 1,
            support_distance: 0.0,
        });
        let lines = vec![lines.collect()];
        let config = VisibilityConfig {
            max_squared_distance: 25.0,
            ..Default::default()
        };
        views_that_show(edges, &[observation(&segments)], &lines, &config)
    }

    #[test]
    fn pieces_show_an_edge_together_and_less_than_half_of_it_does_not() {
        let [first, second] = [[10.0, 40.0], [65.0, 80.0]];
        assert_eq!(shown(&[edge()], &[first, second], 51.0, edge()), [1]);
        assert_eq!(shown(&[edge()], &[first], 51.0, edge()), [0]);
        assert_eq!(shown(&[edge()], &[first, second], 54.0, edge()), [0]);
        assert_eq!(shown(&[edge()], &[], 51.0, edge()), [0]);
        assert!(shown(&[], &[first], 51.0, edge()).is_empty());
    }

    #[test]
    fn a_segment_speaks_for_the_edge_that_its_line_is_nearest_to() {
        let behind = edge().map(|end| end * 1.5);
        let stretches = [[10.0, 70.0]];
        let edges = [edge(), behind];
        assert_eq!(shown(&edges, &stretches, 50.0, edge()), [1, 0]);
        assert_eq!(shown(&edges, &stretches, 50.0, behind), [0, 1]);
    }

    #[test]
    fn ends_that_meet_show_an_edge_whatever_the_field_says() {
        let behind = edge().map(|end| end * 1.5);
        assert_eq!(
            shown(&[edge(), behind], &[[20.0, 80.0]], 50.0, edge()),
            [1, 1]
        );
    }
}
