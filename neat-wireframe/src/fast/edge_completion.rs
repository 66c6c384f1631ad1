//! Every pair of junctions that detections support, whether a proposal joins
//! them or not.

use crate::ViewObservation;
use crate::evidence::edge_support::{MAX_END_DISTANCE_IN_PIXELS, SupportedEdge, confirms};
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
) -> Vec<SupportedEdge> {
    let pairs_of_views: Vec<BTreeSet<[usize; 2]>> = views
        .par_iter()
        .map(|view| supported_pairs(view, junctions))
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
fn supported_pairs(view: &ViewObservation, junctions: &[Vector3<f64>]) -> BTreeSet<[usize; 2]> {
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
            .map(|end| index.within(&end, MAX_END_DISTANCE_IN_PIXELS));
        for start in &near_start {
            for end in &near_end {
                let edge = LineSegment2::new(pixels[start.index], pixels[end.index]);
                if start.index != end.index && confirms(&edge, &detection.segment) {
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
    use crate::evidence::edge_support::oracle::edge_support;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};

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
        let all_pairs: Vec<_> = (0..60)
            .flat_map(|a| (a + 1..60).map(move |b| [a, b]))
            .collect();
        for required in 1..5 {
            let mut expected = edge_support(&views, &junctions, &all_pairs);
            expected.retain(|edge| edge.support >= required);
            assert!(!expected.is_empty());
            let completed = complete_edges(&views, &junctions, required);
            assert_eq!(completed, expected);
        }
    }

    #[test]
    fn nothing_comes_from_nothing() {
        assert!(complete_edges(&[], &[Vector3::zeros(); 2], 1).is_empty());
        let views = views_of_edges(&cameras_on_sphere(2), &[], &[]);
        assert!(complete_edges(&views, &[], 1).is_empty());
    }
}
