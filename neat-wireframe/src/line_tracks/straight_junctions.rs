//! Makes one edge of two that continue each other: detectors cut long lines.

use super::junction_graph::{GraphEdge, JunctionGraph};
use super::projected_line::ProjectedLine;
use super::view_segments::TrackView;
use crate::projection::project_in_front;
use neat_core::LineSegment3;
use std::collections::{BTreeMap, BTreeSet};

/// A junction of two edges that lies this near to the line between their
/// other ends, in all their views, is none.
const MAX_DISTANCE_IN_PIXELS: f64 = 1.0;

/// Replaces both edges of every straight junction by one. The junctions stay in
/// the list, without edges.
pub(super) fn dissolve_straight(views: &[TrackView], graph: &mut JunctionGraph) {
    let mut edges: BTreeMap<[usize; 2], Vec<_>> = std::mem::take(&mut graph.edges)
        .into_iter()
        .map(|edge| (edge.junctions, edge.supports))
        .collect();
    let mut neighbours: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); graph.junctions.len()];
    for [a, b] in edges.keys() {
        neighbours[*a].insert(*b);
        neighbours[*b].insert(*a);
    }
    for middle in 0..graph.junctions.len() {
        let ends: Vec<usize> = neighbours[middle].iter().copied().collect();
        let [a, b] = ends[..] else {
            continue;
        };
        let key = |other: usize| [middle.min(other), middle.max(other)];
        if edges.contains_key(&[a, b]) {
            continue;
        }
        let (Some(first), Some(second)) = (edges.get(&key(a)), edges.get(&key(b))) else {
            continue;
        };
        let mut supports = [first.as_slice(), second].concat();
        supports.sort_unstable();
        supports.dedup();
        let line = LineSegment3::new(graph.junctions[a], graph.junctions[b]);
        let place = line.line_parameter(&graph.junctions[middle]);
        let straight = (0.0..1.0).contains(&place)
            && supports.iter().all(|id| {
                let camera = &views[id.view].camera;
                let distance = Option::zip(
                    ProjectedLine::new(camera, &line),
                    project_in_front(camera, &graph.junctions[middle]),
                )
                .map(|(line, pixel)| line.distance(&pixel).abs());
                distance.is_some_and(|d| d <= MAX_DISTANCE_IN_PIXELS)
            });
        if !straight {
            continue;
        }
        edges.remove(&key(a));
        edges.remove(&key(b));
        edges.insert([a, b], supports);
        neighbours[middle].clear();
        for (end, other) in [(a, b), (b, a)] {
            neighbours[end].remove(&middle);
            neighbours[end].insert(other);
        }
    }
    graph.edges = edges
        .into_iter()
        .map(|(junctions, supports)| GraphEdge {
            junctions,
            supports,
        })
        .collect();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::junction_graph::junction_graph;
    use crate::line_tracks::test_tracks::{cube_tracks, cube_views};

    #[test]
    fn two_halves_become_one_edge_and_corners_stay() {
        let views = cube_views(12);
        let tracks = cube_tracks(&views);
        let whole = junction_graph(&views, &tracks, 3);
        let mut cut = whole.clone();
        let [a, b] = cut.edges[5].junctions;
        let middle = cut.junctions.len();
        cut.junctions
            .push(0.5 * (cut.junctions[a] + cut.junctions[b]));
        cut.edges[5].junctions = [a, middle];
        let second = GraphEdge {
            junctions: [b, middle],
            supports: cut.edges[5].supports.clone(),
        };
        cut.edges.push(second);
        dissolve_straight(&views, &mut cut);
        assert_eq!(cut.edges, whole.edges);

        let mut untouched = whole.clone();
        dissolve_straight(&views, &mut untouched);
        assert_eq!(untouched, whole);
    }
}
