//! Edges that compete for the same detections: each detection counts for the
//! edge it fits best.
//!
//! Junctions a few pixels apart all lie within the tolerance of the ends around
//! them, and so every edge of the one seems to be an edge of the other, too.

use crate::ViewObservation;
use crate::evidence::edge_support::{MAX_END_DISTANCE_IN_PIXELS, SupportedEdge, confirms};
use crate::index::PointIndex;
use crate::projection::project_in_front;
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment2;
use rayon::prelude::*;

/// Share of an edge's supporting views in which a detection must fit it better than
/// any other edge.
const MIN_EXCLUSIVE_SHARE: f64 = 0.5;

/// The edges, as they are, that win enough views when every detection counts for one
/// edge only: of those it confirms, the one with the smallest squared distance of
/// the ends, the first of equals. Enough are `required_views`, and
/// [`MIN_EXCLUSIVE_SHARE`] of the views that support the edge.
pub fn exclusively_supported(
    views: &[ViewObservation],
    junctions: &[Vector3<f64>],
    edges: &[SupportedEdge],
    required_views: usize,
) -> Vec<SupportedEdge> {
    let won_in_views: Vec<Vec<usize>> = views
        .par_iter()
        .map(|view| edges_with_a_detection(view, junctions, edges))
        .collect();
    let mut support = vec![0; edges.len()];
    for edge in won_in_views.into_iter().flatten() {
        support[edge] += 1;
    }
    edges
        .iter()
        .zip(support)
        .filter(|(edge, support)| {
            let share = (MIN_EXCLUSIVE_SHARE * edge.support as f64).ceil() as usize;
            *support >= required_views.max(share)
        })
        .map(|(edge, _)| *edge)
        .collect()
}

/// The edges, each once, for which some detection of the view counts.
fn edges_with_a_detection(
    view: &ViewObservation,
    junctions: &[Vector3<f64>],
    edges: &[SupportedEdge],
) -> Vec<usize> {
    let pixels: Vec<Option<Vector2<f64>>> = junctions
        .iter()
        .map(|junction| project_in_front(&view.camera, junction))
        .collect();
    let (indices, projected): (Vec<usize>, Vec<LineSegment2>) = edges
        .iter()
        .enumerate()
        .filter_map(|(index, edge)| {
            let [a, b] = edge.junctions;
            Some((index, LineSegment2::new(pixels[a]?, pixels[b]?)))
        })
        .unzip();
    // Ends within the tolerance have middles within it.
    let middles = PointIndex::new(projected.iter().map(|edge| edge.point_at(0.5)).collect());
    let mut won: Vec<usize> = view
        .segments
        .iter()
        .filter_map(|detection| {
            let middle = detection.segment.point_at(0.5);
            let near = middles.within(&middle, MAX_END_DISTANCE_IN_PIXELS);
            near.iter()
                .filter_map(|near| {
                    let misfit = misfit(&projected[near.index], &detection.segment)?;
                    Some((misfit, indices[near.index]))
                })
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .map(|(_, edge)| edge)
        })
        .collect();
    won.sort_unstable();
    won.dedup();
    won
}

/// Sum of the squared distances of the ends, if the detection confirms the edge.
fn misfit(edge: &LineSegment2, detection: &LineSegment2) -> Option<f64> {
    [*detection, detection.reversed()]
        .iter()
        .filter(|detection| confirms(edge, detection))
        .map(|detection| {
            let [start, end] = edge.end_distances(detection);
            start * start + end * end
        })
        .min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::super::edge_completion::complete_edges;
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};

    const REQUIRED: usize = 5;

    /// The edges that detections of `truth` support, all and exclusively.
    fn supported(
        junctions: &[Vector3<f64>],
        truth: &[[usize; 2]],
        noise_in_pixels: f64,
    ) -> [Vec<[usize; 2]>; 2] {
        let mut views = views_of_edges(&cameras_on_sphere(24), junctions, truth);
        let mut noise = Noise(3);
        for detection in views.iter_mut().flat_map(|view| &mut view.segments) {
            detection.segment.start += noise_in_pixels * noise.vector().xy();
            detection.segment.end += noise_in_pixels * noise.vector().xy();
        }
        let all = complete_edges(&views, junctions, REQUIRED);
        let exclusive = exclusively_supported(&views, junctions, &all, REQUIRED);
        [all, exclusive].map(|edges| edges.iter().map(|edge| edge.junctions).collect())
    }

    #[test]
    fn of_edges_to_neighbouring_junctions_only_the_detected_ones_stay() {
        // Junction 8 lies 3 pixels beside corner 0, and only corner 0 has edges.
        let (mut junctions, truth) = cube();
        junctions.push(junctions[0] + Vector3::new(0.0, 0.006, -0.008));
        let [all, exclusive] = supported(&junctions, &truth, 0.3);
        assert!(all.iter().any(|edge| edge.contains(&8)));
        assert_eq!(exclusive, truth);
    }

    #[test]
    fn parallel_edges_that_are_both_detected_stay_both() {
        let at = |x, y| Vector3::new(x, y, 0.0);
        let junctions = [at(-0.5, 0.0), at(0.5, 0.0), at(-0.5, 0.012), at(0.5, 0.012)];
        let truth = [[0, 1], [2, 3]];
        let [all, exclusive] = supported(&junctions, &truth, 0.2);
        assert_eq!(all.len(), 4, "with the two diagonals");
        assert_eq!(exclusive, truth);
    }

    #[test]
    fn edges_without_rivals_keep_their_support() {
        let (junctions, truth) = cube();
        let views = views_of_edges(&cameras_on_sphere(10), &junctions, &truth);
        let all = complete_edges(&views, &junctions, REQUIRED);
        let exclusive = exclusively_supported(&views, &junctions, &all, REQUIRED);
        assert_eq!(exclusive, all);
        assert!(exclusively_supported(&[], &junctions, &all, 1).is_empty());
    }
}
