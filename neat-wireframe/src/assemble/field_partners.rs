//! Partners of a 2D segment that a field knows: 2D segments of other views that it puts at
//! the same place. No view is searched for what looks alike or lies on an epipolar line.

use super::view_segments::{PreparedView, SegmentId};
use crate::paper::NeatLine;
use neat_core::LineSegment3;

/// So many 2D segments of a neighbour, those whose lines are nearest, are tried. On a house
/// after 3000 steps of training F1 at 5 cm is .712, .719 and .712 with 3, 10 and 30.
const PARTNERS: usize = 10;

/// Where a field puts the 2D segments of all views.
#[derive(Clone, Debug)]
pub(super) struct FieldLines {
    /// For each view and prepared segment its line, if the field has one.
    lines: Vec<Vec<Option<LineSegment3>>>,
}

impl FieldLines {
    /// Of the NEAT lines of each view, whose lengths are multiplied by `scale`.
    pub(super) fn new(views: &[PreparedView], lines_by_view: &[Vec<NeatLine>], scale: f64) -> Self {
        let lines = (views.iter().zip(lines_by_view)).map(|(view, lines)| {
            let line_of = |segment_in_view: usize| {
                let line = (lines.iter()).find(|line| line.segment_in_view == segment_in_view)?;
                Some(line.segment.map(|end| end * scale))
            };
            let segments = view.segments.iter();
            segments.map(|s| line_of(s.segment_in_view)).collect()
        });
        Self {
            lines: lines.collect(),
        }
    }

    /// The segments of the view `other` whose lines are nearest to that of `of`, ascending.
    pub(super) fn partners(&self, of: SegmentId, other: usize) -> Vec<usize> {
        let Some(own) = self.lines[of.view][of.segment] else {
            return Vec::new();
        };
        // Nearest first; few, so that a place in the list is found quickly.
        let mut nearest: Vec<(f64, usize)> = Vec::with_capacity(PARTNERS + 1);
        for (segment, line) in self.lines[other].iter().enumerate() {
            let Some(line) = line else {
                continue;
            };
            let gap = gap(&own, line);
            let place = nearest.partition_point(|(other, _)| *other <= gap);
            if place < PARTNERS && gap.is_finite() {
                nearest.insert(place, (gap, segment));
                nearest.truncate(PARTNERS);
            }
        }
        let mut partners: Vec<usize> = nearest.into_iter().map(|(_, segment)| segment).collect();
        partners.sort_unstable();
        partners
    }
}

/// How far the ends of the shorter of two lines lie from the longer one, together: fragments
/// of one edge have none.
fn gap(a: &LineSegment3, b: &LineSegment3) -> f64 {
    let (short, long) = if a.length() < b.length() {
        (a, b)
    } else {
        (b, a)
    };
    let ends = short.ends();
    ends.iter().map(|end| long.distance_to_point(end)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};
    use nalgebra::Vector3;

    #[test]
    fn a_part_of_a_line_is_as_near_as_the_line() {
        let line = LineSegment3::new(Vector3::zeros(), Vector3::x());
        let part = LineSegment3::new(line.point_at(0.6), line.point_at(0.2));
        let beside = LineSegment3::new(Vector3::y() * 0.1, Vector3::new(1.0, 0.1, 0.0));
        assert!(gap(&line, &part) < 1e-12);
        assert!((gap(&line, &beside) - 0.2).abs() < 1e-12);
        assert!((gap(&part, &beside) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn partners_are_the_same_edge_in_spite_of_an_inexact_field() {
        let (corners, edges) = cube();
        let observations = views_of_edges(&cameras_on_sphere(3), &corners, &edges);
        let views: Vec<PreparedView> = (observations.iter())
            .map(|observation| PreparedView::new(observation, 0.5, 1.0))
            .collect();
        let mut noise = Noise(3);
        let mut lines_of_view = |without: usize| -> Vec<NeatLine> {
            let lines = edges.iter().enumerate().map(|(edge, [a, b])| NeatLine {
                segment_in_view: edge,
                segment: LineSegment3::new(
                    corners[*b] + 0.02 * noise.vector(),
                    corners[*a] + 0.02 * noise.vector(),
                ),
                rays: 1,
                support_distance: 0.0,
            });
            lines
                .filter(|line| line.segment_in_view != without)
                .collect()
        };
        let lines = [lines_of_view(12), lines_of_view(5), lines_of_view(12)];
        let field = FieldLines::new(&views, &lines, 0.5);
        for segment in 0..edges.len() {
            let partners = field.partners(SegmentId { view: 0, segment }, 1);
            assert_eq!(partners.len(), PARTNERS);
            // Ten of eleven lines: the nearest is among them, the farthest is not.
            assert_eq!(partners.contains(&segment), segment != 5);
            assert!(partners.is_sorted());
        }
        let lost = SegmentId {
            view: 1,
            segment: 5,
        };
        assert!(field.partners(lost, 0).is_empty());
    }
}
