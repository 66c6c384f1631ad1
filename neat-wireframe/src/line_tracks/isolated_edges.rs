//! Drops edges that float alone before or behind everything around them.
//!
//! Repeated structures make wrong tracks that several views support by chance.
//! They betray themselves in the images: the edges around them lie at quite
//! another depth, while a true structure has at least some edges at its own.

use super::clustering::view_count;
use super::graph_adjustment::segment_of_edge;
use super::junction_graph::JunctionGraph;
use super::projected_line::line_parameter_of_ray;
use super::view_segments::{SegmentId, TrackView, segment_of};
use neat_core::LineSegment3;
use rayon::prelude::*;

/// Depths that differ by less than this share are the same.
const MAX_RELATIVE_DEPTH_DIFFERENCE: f64 = 0.08;
/// An edge counts as many views as show it, times the share of its neighbours
/// in the images that have its depth; it stays if that is at least this share
/// of the views that every edge needs. Three views that agree by chance are
/// easily found on a façade, but seldom where all around agrees too.
const MIN_ACCOMPANIED_SHARE: f64 = 0.85;

/// Drops the edges that share no junction with another edge and are alone at
/// their depth.
pub(super) fn drop_isolated(views: &[TrackView], graph: &mut JunctionGraph, min_views: usize) {
    let degree = graph.degrees();
    let lines: Vec<LineSegment3> = graph
        .edges
        .iter()
        .map(|edge| segment_of_edge(graph, edge))
        .collect();
    // Depth of every supporting segment's middle, with the edge it supports.
    let mut shown: Vec<Vec<Option<(usize, f64)>>> = views
        .iter()
        .map(|view| vec![None; view.segments.len()])
        .collect();
    for (edge, line) in lines.iter().enumerate() {
        for id in &graph.edges[edge].supports {
            shown[id.view][id.segment] = depth_of(views, *id, line).map(|depth| (edge, depth));
        }
    }
    let keep: Vec<bool> = graph
        .edges
        .par_iter()
        .enumerate()
        .map(|(i, edge)| {
            let joined = edge.junctions.iter().any(|junction| degree[*junction] > 1);
            if joined {
                return true;
            }
            let (mut same, mut all) = (0_usize, 0_usize);
            for id in &edge.supports {
                let Some(depth) = depth_of(views, *id, &lines[i]) else {
                    continue;
                };
                for (other_depth, _) in neighbours_in_image(views, *id, i, &shown) {
                    all += 1;
                    let difference = (other_depth - depth).abs();
                    same += usize::from(difference < MAX_RELATIVE_DEPTH_DIFFERENCE * depth);
                }
            }
            // One neighbour more of each kind: few say little.
            let share = (same + 1) as f64 / (all + 2) as f64;
            share * view_count(&edge.supports) as f64 >= MIN_ACCOMPANIED_SHARE * min_views as f64
        })
        .collect();
    let mut keep = keep.into_iter();
    graph.edges.retain(|_| keep.next().unwrap_or(true));
}

/// Distance from the camera of the point of `line` that the middle of a 2D segment
/// shows.
fn depth_of(views: &[TrackView], id: SegmentId, line: &LineSegment3) -> Option<f64> {
    let center = &views[id.view].camera.center_in_world;
    let rays = segment_of(views, id).rays;
    let ray = (rays[0] + rays[1]).normalize();
    let place = line_parameter_of_ray(line, center, &ray)?;
    Some((line.point_at(place) - center).norm())
}

/// Depths and indices of the other edges whose supports lie near a 2D segment, one
/// each.
fn neighbours_in_image(
    views: &[TrackView],
    id: SegmentId,
    edge: usize,
    shown: &[Vec<Option<(usize, f64)>>],
) -> Vec<(f64, usize)> {
    let near = views[id.view].index.near(&segment_of(views, id).segment);
    let mut neighbours: Vec<(f64, usize)> = near
        .into_iter()
        .filter_map(|segment| shown[id.view][segment])
        .filter(|(other, _)| *other != edge)
        .map(|(other, depth)| (depth, other))
        .collect();
    neighbours.sort_by(|a, b| a.1.cmp(&b.1).then(a.0.total_cmp(&b.0)));
    neighbours.dedup_by_key(|(_, other)| *other);
    neighbours
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::junction_graph::GraphEdge;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use nalgebra::Vector3;

    #[test]
    fn an_edge_alone_before_a_wall_goes_and_the_wall_stays() {
        // Bars of a wall, all single, and one bar halfway to the cameras.
        let mut junctions = Vec::new();
        for i in 0..12 {
            let x = 0.05 * f64::from(i - 6);
            junctions.extend([-0.4, 0.4].map(|y| Vector3::new(x, y, -0.2)));
        }
        junctions.extend([-0.2, 0.2].map(|y| Vector3::new(0.01, y, 0.9)));
        let pairs: Vec<[usize; 2]> = (0..13).map(|i| [2 * i, 2 * i + 1]).collect();
        let cameras: Vec<_> = cameras_on_sphere(160)
            .into_iter()
            .filter(|camera| camera.center_in_world.z > 2.2)
            .collect();
        let views: Vec<TrackView> = views_of_edges(&cameras, &junctions, &pairs)
            .iter()
            .map(|observation| TrackView::new(observation, 1.0, 1.0))
            .collect();
        let edges = pairs
            .iter()
            .enumerate()
            .map(|(segment, pair)| GraphEdge {
                junctions: *pair,
                supports: (0..views.len())
                    .map(|view| SegmentId { view, segment })
                    .collect(),
            })
            .collect();
        let mut graph = JunctionGraph { junctions, edges };
        drop_isolated(&views, &mut graph, 3);
        assert_eq!(graph.edges.len(), 12);
        assert!(graph.edges.iter().all(|edge| edge.junctions != [24, 25]));
    }
}
