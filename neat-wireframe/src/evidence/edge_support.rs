//! In how many views a detection confirms an edge end by end.

use neat_core::LineSegment2;

/// Both ends of a detection must be closer than this to the projected ends.
pub(crate) const MAX_END_DISTANCE_IN_PIXELS: f64 = 4.0;
/// The same limit as a share of the projected edge's length.
const MAX_RELATIVE_END_DISTANCE: f64 = 0.15;
/// Share of the views that must support an edge …
const REQUIRED_SHARE_OF_VIEWS: f64 = 0.2;
/// … but at least this number …
const MIN_REQUIRED_VIEWS: usize = 2;
/// … and never more than this.
const MAX_REQUIRED_VIEWS: usize = 5;

/// The number of supporting views that an edge needs in a scene of `views`
/// views: `clip(round(0.2 V), 2, 5)`.
pub fn required_views(views: usize) -> usize {
    let share = (REQUIRED_SHARE_OF_VIEWS * views as f64).round_ties_even();
    (share as usize).clamp(MIN_REQUIRED_VIEWS, MAX_REQUIRED_VIEWS)
}

/// Largest distance between a detection's ends and those of an edge of this
/// projected length; the limit itself is too far.
fn end_tolerance(projected_length: f64) -> f64 {
    (MAX_RELATIVE_END_DISTANCE * projected_length).min(MAX_END_DISTANCE_IN_PIXELS)
}

/// Whether a detection lies on a projected edge, end on end in this order.
pub fn confirms(edge: &LineSegment2, detection: &LineSegment2) -> bool {
    let tolerance = end_tolerance(edge.length());
    let [start, end] = edge.end_distances(detection);
    start < tolerance && end < tolerance
}

/// A pair of junctions with the views that speak for an edge between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SupportedEdge {
    /// The junctions' indices, the smaller first.
    pub junctions: [usize; 2],
    /// Number of views with a detection on the edge.
    pub support: usize,
    /// Number of views in which the surface does not hide the edge, where
    /// that was tested.
    pub visible_views: Option<usize>,
}

/// What faster ways to count are held against.
#[cfg(test)]
pub(crate) mod oracle {
    use super::{SupportedEdge, confirms};
    use crate::ViewObservation;
    use crate::projection::project_in_front;
    use nalgebra::Vector3;
    use neat_core::LineSegment2;

    /// The support of each given edge, in the same order.
    ///
    /// Edges that name a junction that does not exist have no support.
    pub(crate) fn edge_support(
        views: &[ViewObservation],
        junctions: &[Vector3<f64>],
        edges: &[[usize; 2]],
    ) -> Vec<SupportedEdge> {
        edges
            .iter()
            .map(|&[a, b]| SupportedEdge {
                junctions: [a.min(b), a.max(b)],
                support: views
                    .iter()
                    .filter(|view| {
                        let project = |junction| project_in_front(&view.camera, junction);
                        let projected = Option::zip(
                            junctions.get(a).and_then(project),
                            junctions.get(b).and_then(project),
                        );
                        projected.is_some_and(|(start, end)| {
                            let edge = LineSegment2::new(start, end);
                            view.segments.iter().any(|detection| {
                                confirms(&edge, &detection.segment)
                                    || confirms(&edge, &detection.segment.reversed())
                            })
                        })
                    })
                    .count(),
                visible_views: None,
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::oracle::edge_support;
    use super::*;
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};

    #[test]
    fn required_views_follow_the_recipe() {
        let required = [0, 1, 10, 12, 13, 20, 25, 100].map(required_views);
        assert_eq!(required, [2, 2, 2, 2, 3, 4, 5, 5]);
    }

    #[test]
    fn support_counts_the_views_with_a_detection_on_the_edge() {
        let (junctions, edges) = cube();
        let mut views = views_of_edges(&cameras_on_sphere(8), &junctions, &edges);
        for view in &mut views[..3] {
            view.segments.remove(0);
        }
        for view in &mut views[5..] {
            view.segments[1].segment = view.segments[1].segment.reversed();
        }
        let support = edge_support(&views, &junctions, &[edges[0], edges[1], [0, 7]]);
        assert_eq!(support[0].support, 5);
        assert_eq!(support[1].support, 8);
        assert_eq!(support[2].support, 0);
        let outside = edge_support(&views, &junctions, &[[0, 8]]);
        assert_eq!(outside[0].support, 0);
    }
}
