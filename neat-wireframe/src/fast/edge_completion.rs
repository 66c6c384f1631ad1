//! Every pair of junctions that detections support, whether a proposal joins
//! them or not.

use crate::ViewObservation;
use crate::evidence::edge_support::{EdgeSupportConfig, SupportedEdge};
use crate::index::PointIndex;
use crate::projection::project_in_front;
use nalgebra::Vector3;
use neat_core::LineSegment2;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// All pairs of junctions with support in at least `required_views` views,
/// sorted.
///
/// Instead of testing each of the J² pairs, every detection names the pairs it
/// supports: a junction near its start with one near its end. The result is that
/// of [`crate::evidence::edge_support::edge_support`] on all pairs.
pub fn complete_edges(
    views: &[ViewObservation],
    junctions: &[Vector3<f64>],
    required_views: usize,
    config: &EdgeSupportConfig,
) -> Vec<SupportedEdge> {
    let pairs_of_views: Vec<BTreeSet<[usize; 2]>> = views
        .par_iter()
        .map(|view| supported_pairs(view, junctions, config))
        .collect();
    let mut support = BTreeMap::new();
    for pair in pairs_of_views.into_iter().flatten() {
        *support.entry(pair).or_insert(0) += 1;
    }
    support
        .into_iter()
        .filter(|(_, support)| *support >= required_views)
        .map(|(junctions, support)| SupportedEdge {
            junctions,
            support,
            visible_views: None,
        })
        .collect()
}

/// The pairs `[a, b]`, a < b, that some detection of the view lies on.
fn supported_pairs(
    view: &ViewObservation,
    junctions: &[Vector3<f64>],
    config: &EdgeSupportConfig,
) -> BTreeSet<[usize; 2]> {
    let (indices, pixels): (Vec<_>, Vec<_>) = junctions
        .iter()
        .enumerate()
        .filter_map(|(index, junction)| Some((index, project_in_front(&view.camera, junction)?)))
        .unzip();
    let index = PointIndex::new(pixels.clone());
    let mut pairs = BTreeSet::new();
    for detection in &view.segments {
        let [near_start, near_end] = detection
            .segment
            .ends()
            .map(|end| index.within(&end, config.max_end_distance_in_pixels));
        for start in &near_start {
            for end in &near_end {
                let edge = LineSegment2::new(pixels[start.index], pixels[end.index]);
                if start.index != end.index && config.confirms(&edge, &detection.segment) {
                    let (a, b) = (indices[start.index], indices[end.index]);
                    pairs.insert([a.min(b), a.max(b)]);
                }
            }
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};
    use rayon::prelude::*;

    /// The support of each given edge, in the same order.
    ///
    /// Edges that name a junction that does not exist have no support.
    fn edge_support(
        views: &[ViewObservation],
        junctions: &[Vector3<f64>],
        edges: &[[usize; 2]],
        config: &EdgeSupportConfig,
    ) -> Vec<SupportedEdge> {
        edges
            .par_iter()
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
                                config.confirms(&edge, &detection.segment)
                                    || config.confirms(&edge, &detection.segment.reversed())
                            })
                        })
                    })
                    .count(),
                visible_views: None,
            })
            .collect()
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
        let config = EdgeSupportConfig::default();
        let support = edge_support(&views, &junctions, &[edges[0], edges[1], [0, 7]], &config);
        assert_eq!(support[0].support, 5);
        assert_eq!(support[1].support, 8);
        assert_eq!(support[2].support, 0);
        let outside = edge_support(&views, &junctions, &[[0, 8]], &config);
        assert_eq!(outside[0].support, 0);
    }

    #[test]
    fn the_result_is_that_of_all_pairs() {
        let mut noise = Noise(17);
        // Junctions in near-coincident groups, so that detections are ambiguous.
        let (corners, edges) = cube();
        let junctions: Vec<_> = (0..60)
            .map(|i| corners[i % 8] + 0.02 * noise.vector())
            .collect();
        let mut views = views_of_edges(&cameras_on_sphere(9), &corners, &edges);
        for view in &mut views {
            for detection in &mut view.segments {
                detection.segment.start += 3.0 * noise.vector().xy();
                detection.segment.end += 3.0 * noise.vector().xy();
            }
        }
        // A camera inside the object has junctions behind it.
        views[0].camera.center_in_world = Vector3::new(0.1, 0.0, 0.2);
        let config = EdgeSupportConfig::default();
        let all_pairs: Vec<_> = (0..60)
            .flat_map(|a| (a + 1..60).map(move |b| [a, b]))
            .collect();
        for required in 1..5 {
            let mut expected = edge_support(&views, &junctions, &all_pairs, &config);
            expected.retain(|edge| edge.support >= required);
            assert!(!expected.is_empty());
            let completed = complete_edges(&views, &junctions, required, &config);
            assert_eq!(completed, expected);
        }
    }

    #[test]
    fn nothing_comes_from_nothing() {
        let config = EdgeSupportConfig::default();
        assert!(complete_edges(&[], &[Vector3::zeros(); 2], 1, &config).is_empty());
        let views = views_of_edges(&cameras_on_sphere(2), &[], &[]);
        assert!(complete_edges(&views, &[], 1, &config).is_empty());
    }
}
