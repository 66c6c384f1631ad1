//! Clean-up of the graph: one junction per place, one edge per line, nothing
//! isolated.

use crate::evidence::edge_support::SupportedEdge;
use crate::index::{GrowingPointGrid, PointIndex};
use crate::used_junctions::UsedJunctions;
use nalgebra::Vector3;
use neat_core::LineSegment3;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

// Lengths are shares of the scene's radius.
/// Junctions closer than this become one.
const MERGE_DISTANCE: f64 = 0.015;
/// A junction closer than this to the inside of an edge lies on it.
const COLLINEAR_DISTANCE: f64 = 0.006;
/// The inside of an edge excludes this share of it at both ends.
const END_MARGIN: f64 = 0.02;

/// The edges by their pair of junctions.
type EdgesByPair = BTreeMap<[usize; 2], SupportedEdge>;

/// Merges near junctions, keeps either a long edge or its parts, and drops the
/// junctions without edges.
///
/// Junctions of a pair `[a, b]`, a < b, of `told_apart` stay two however near.
///
/// Indices in the result are those of the returned junctions; edges are sorted.
///
/// # Panics
/// If an edge names a junction that does not exist.
pub fn clean_up(
    junctions: &[Vector3<f64>],
    edges: &[SupportedEdge],
    told_apart: &BTreeSet<[usize; 2]>,
) -> (Vec<Vector3<f64>>, Vec<SupportedEdge>) {
    let merging = Merging::new(junctions, edges, told_apart, MERGE_DISTANCE);
    let mut by_pair = merging.apply(edges);
    resolve_collinear(&mut by_pair, junctions, &merging.kept, COLLINEAR_DISTANCE);
    drop_isolated(junctions, by_pair.into_values())
}

/// Which junction stands for each.
struct Merging {
    /// The junctions that stay, best supported first.
    kept: Vec<usize>,
    /// For every junction the one that stands for it.
    representative: Vec<usize>,
}

impl Merging {
    fn new(
        junctions: &[Vector3<f64>],
        edges: &[SupportedEdge],
        told_apart: &BTreeSet<[usize; 2]>,
        distance: f64,
    ) -> Self {
        let mut support = vec![0; junctions.len()];
        for edge in edges {
            for junction in edge.junctions {
                support[junction] += edge.support;
            }
        }
        let mut order: Vec<usize> = (0..junctions.len()).collect();
        order.sort_by_key(|junction| Reverse(support[*junction]));
        let mut kept: Vec<usize> = Vec::new();
        let mut kept_positions = GrowingPointGrid::new(distance);
        let mut representative: Vec<usize> = (0..junctions.len()).collect();
        for junction in order {
            let position = junctions[junction];
            let stands_for_it = |other: usize, apart: f64| {
                let other = kept[other];
                apart < distance
                    && !told_apart.contains(&[junction.min(other), junction.max(other)])
            };
            match kept_positions.first_near(&position, stands_for_it) {
                Some(other) => representative[junction] = kept[other],
                None => {
                    kept.push(junction);
                    kept_positions.push(position);
                }
            }
        }
        Self {
            kept,
            representative,
        }
    }

    /// The edges between representatives; of parallel ones the best supported.
    fn apply(&self, edges: &[SupportedEdge]) -> EdgesByPair {
        let mut by_pair = EdgesByPair::new();
        for edge in edges {
            let [a, b] = edge.junctions.map(|junction| self.representative[junction]);
            if a == b {
                continue;
            }
            let merged = SupportedEdge {
                junctions: [a.min(b), a.max(b)],
                ..*edge
            };
            by_pair
                .entry(merged.junctions)
                .and_modify(|present| {
                    if merged.support > present.support {
                        *present = merged;
                    }
                })
                .or_insert(merged);
        }
        by_pair
    }
}

/// Where a junction lies on the inside of an edge, removes the edge or its two
/// parts: the long edge stays alone if its support is not less than that of either
/// part, or if nothing else hangs on the junction; it goes if both parts are there.
/// Long edges decide first.
fn resolve_collinear(
    edges: &mut EdgesByPair,
    junctions: &[Vector3<f64>],
    candidates: &[usize],
    collinear_distance: f64,
) {
    let segment = |[a, b]: [usize; 2]| LineSegment3::new(junctions[a], junctions[b]);
    let index = PointIndex::new(candidates.iter().map(|c| junctions[*c]).collect());
    let mut neighbours = vec![BTreeSet::new(); junctions.len()];
    for [a, b] in edges.keys() {
        neighbours[*a].insert(*b);
        neighbours[*b].insert(*a);
    }
    let mut longest_first: Vec<[usize; 2]> = edges.keys().copied().collect();
    longest_first.sort_by(|p, q| f64::total_cmp(&segment(*q).length(), &segment(*p).length()));

    for pair in longest_first {
        let [a, b] = pair;
        let long = segment(pair);
        for c in near_segment(&long, &index, collinear_distance) {
            let c = candidates[c];
            let Some(long_support) = edges.get(&pair).map(|edge| edge.support) else {
                break;
            };
            if c == a || c == b || !lies_inside(&long, &junctions[c], collinear_distance) {
                continue;
            }
            let parts = [[a.min(c), a.max(c)], [b.min(c), b.max(c)]];
            let supports = parts.map(|part| edges.get(&part).map(|part| part.support));
            let part_support = supports.iter().flatten().max().copied().unwrap_or(0);
            let something_else_hangs_here = neighbours[c].iter().any(|d| *d != a && *d != b);
            let removed: &[[usize; 2]] =
                if long_support >= part_support || !something_else_hangs_here {
                    &parts
                } else if supports.iter().all(Option::is_some) {
                    &[pair]
                } else {
                    // Without the long edge there would be a gap.
                    &[]
                };
            for [p, q] in removed {
                edges.remove(&[*p, *q]);
                neighbours[*p].remove(q);
                neighbours[*q].remove(p);
            }
        }
    }
}

/// The points at most `distance` away from a segment, and some farther ones, by
/// ascending index.
pub(crate) fn near_segment(
    segment: &LineSegment3,
    index: &PointIndex<3>,
    distance: f64,
) -> Vec<usize> {
    // A ball around the whole of a long segment would hold much of the scene.
    let pieces = (segment.length() / (8.0 * distance))
        .ceil()
        .clamp(1.0, 1000.0);
    let radius = (0.5 * segment.length() / pieces).hypot(distance);
    let mut near: Vec<usize> = (0..pieces as usize)
        .flat_map(|piece| {
            let middle = segment.point_at((piece as f64 + 0.5) / pieces);
            index.within(&middle, radius * (1.0 + 1e-9))
        })
        .map(|neighbour| neighbour.index)
        .collect();
    near.sort_unstable();
    near.dedup();
    near
}

fn lies_inside(edge: &LineSegment3, point: &Vector3<f64>, collinear_distance: f64) -> bool {
    let t = edge.line_parameter(point);
    t > END_MARGIN && t < 1.0 - END_MARGIN && (edge.point_at(t) - point).norm() < collinear_distance
}

/// The junctions that have edges, with edges that name them by their new index.
fn drop_isolated(
    junctions: &[Vector3<f64>],
    edges: impl Iterator<Item = SupportedEdge>,
) -> (Vec<Vector3<f64>>, Vec<SupportedEdge>) {
    let mut edges: Vec<SupportedEdge> = edges.collect();
    let pairs = edges.iter().map(|edge| &edge.junctions);
    let used = UsedJunctions::new(junctions.len(), pairs);
    let mut kept = junctions.to_vec();
    used.retain(&mut kept);
    for edge in &mut edges {
        edge.junctions = used.renamed(edge.junctions);
    }
    (kept, edges)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    fn edge(a: usize, b: usize, support: usize) -> SupportedEdge {
        SupportedEdge {
            junctions: [a, b],
            support,
            visible_views: None,
        }
    }

    fn at(x: f64, y: f64) -> Vector3<f64> {
        Vector3::new(x, y, 0.0)
    }

    /// Junctions, and the edges with their support.
    type Graph = (Vec<Vector3<f64>>, Vec<([usize; 2], usize)>);

    fn cleaned(junctions: &[Vector3<f64>], edges: &[SupportedEdge]) -> Graph {
        let (junctions, edges) = clean_up(junctions, edges, &BTreeSet::new());
        let edges = edges.iter().map(|e| (e.junctions, e.support)).collect();
        (junctions, edges)
    }

    #[test]
    fn near_junctions_become_the_better_supported_one() {
        let junctions = [at(0.0, 0.0), at(0.01, 0.0), at(1.0, 0.0), at(5.0, 5.0)];
        let edges = [edge(0, 1, 9), edge(0, 2, 3), edge(1, 2, 7)];
        assert_eq!(
            cleaned(&junctions, &edges),
            (vec![junctions[1], junctions[2]], vec![([0, 1], 7)])
        );
    }

    #[test]
    fn a_long_edge_beats_parts_that_are_not_better() {
        let junctions = [at(0.0, 0.0), at(1.0, 0.0), at(0.5, 0.0), at(0.5, 1.0)];
        let edges = [edge(0, 1, 8), edge(0, 2, 8), edge(1, 2, 3), edge(2, 3, 9)];
        let (kept, edges) = cleaned(&junctions, &edges);
        assert_eq!(kept.len(), 4);
        assert_eq!(edges, [([0, 1], 8), ([2, 3], 9)]);
    }

    #[test]
    fn better_parts_at_a_true_junction_beat_the_long_edge() {
        let junctions = [at(0.0, 0.0), at(1.0, 0.0), at(0.5, 0.0), at(0.5, 1.0)];
        let edges = [edge(0, 1, 5), edge(0, 2, 8), edge(1, 2, 3), edge(2, 3, 9)];
        let (_, edges) = cleaned(&junctions, &edges);
        assert_eq!(edges, [([0, 2], 8), ([1, 2], 3), ([2, 3], 9)]);
    }

    #[test]
    fn a_junction_where_nothing_else_hangs_goes() {
        let junctions = [at(0.0, 0.0), at(1.0, 0.0), at(0.5, 0.004)];
        let edges = [edge(0, 1, 5), edge(0, 2, 8), edge(1, 2, 8)];
        assert_eq!(
            cleaned(&junctions, &edges),
            (vec![junctions[0], junctions[1]], vec![([0, 1], 5)])
        );
        assert_eq!(cleaned(&[], &[]), (Vec::new(), Vec::new()));
    }

    /// The definition: every junction that stays is tried on every edge.
    fn resolve_by_scan(
        edges: &mut EdgesByPair,
        junctions: &[Vector3<f64>],
        candidates: &[usize],
        collinear_distance: f64,
    ) {
        let segment = |[a, b]: [usize; 2]| LineSegment3::new(junctions[a], junctions[b]);
        let mut longest_first: Vec<[usize; 2]> = edges.keys().copied().collect();
        longest_first.sort_by(|p, q| f64::total_cmp(&segment(*q).length(), &segment(*p).length()));
        for pair in longest_first {
            let [a, b] = pair;
            for &c in candidates {
                let Some(long_support) = edges.get(&pair).map(|edge| edge.support) else {
                    break;
                };
                if c == a
                    || c == b
                    || !lies_inside(&segment(pair), &junctions[c], collinear_distance)
                {
                    continue;
                }
                let parts = [[a.min(c), a.max(c)], [b.min(c), b.max(c)]];
                let support = |part| edges.get(part).map(|edge: &SupportedEdge| edge.support);
                let part_support = parts.iter().filter_map(support).max().unwrap_or(0);
                let something_else_hangs_here = edges
                    .keys()
                    .any(|other| other.contains(&c) && !parts.contains(other));
                if long_support >= part_support || !something_else_hangs_here {
                    for part in &parts {
                        edges.remove(part);
                    }
                } else if parts.iter().all(|part| edges.contains_key(part)) {
                    edges.remove(&pair);
                }
            }
        }
    }

    #[test]
    fn collinear_edges_are_those_of_a_scan() {
        let mut noise = Noise(13);
        // Near a few lines, so that many junctions lie inside many edges.
        let junctions: Vec<_> = (0..150)
            .map(|i| {
                let along = noise.uniform();
                let line = f64::from(i % 5) * 0.2;
                Vector3::new(along, line, 0.5 * along * line) + 0.01 * noise.vector()
            })
            .collect();
        let mut pick = || ((noise.uniform() + 1.0) * 75.0) as usize;
        let edges: EdgesByPair = (0..400)
            .map(|i| (pick(), pick(), i % 17))
            .filter(|(a, b, _)| a != b)
            .map(|(a, b, support)| edge(a.min(b), a.max(b), support))
            .map(|edge| (edge.junctions, edge))
            .collect();
        let candidates: Vec<usize> = (0..150).rev().filter(|i| i % 7 != 0).collect();
        let distance = 0.03;
        let (mut fast, mut scanned) = (edges.clone(), edges.clone());
        resolve_collinear(&mut fast, &junctions, &candidates, distance);
        resolve_by_scan(&mut scanned, &junctions, &candidates, distance);
        assert_eq!(fast, scanned);
        assert!(fast.len() + 30 < edges.len());
    }
}
