//! Edges that are one: copies that explain the same 2D segments, and pieces of one
//! line that 2D segments bridge.
//!
//! Close parallel edges, such as those of a window frame, stay apart: views show
//! them by segments of their own.

use super::clustering::view_count;
use super::graph_adjustment::segment_of_edge;
use super::junction_graph::{GraphEdge, JunctionGraph};
use super::projected_line::ProjectedLine;
use super::view_segments::{SegmentId, TrackView, segment_of};
use crate::projection::project_in_front;
use neat_core::LineSegment3;
use std::collections::BTreeMap;

/// The step is repeated while it finds something, up to this many times; 0
/// switches it off.
const ROUNDS: usize = 4;
/// Sine of the angle between edges that are one, at most.
const MAX_SINE: f64 = 0.1;
/// An edge that lies along another one by less than this share is no copy.
const MIN_OVERLAP: f64 = 0.8;
/// A copy shares at least this share of its 2D segments with the other edge.
const MIN_COMMON_SHARE: f64 = 0.7;
/// Edges are not copies if the views that show each by segments of its own are
/// at least this share of the views of the one that fewer show.
const MIN_SEPARATE_SHARE: f64 = 0.34;
/// Views whose segments bridge the gap between two pieces, at least …
const MIN_BRIDGING_VIEWS: usize = 2;
/// … and as a share of the views of the piece that fewer show.
const MIN_BRIDGING_SHARE: f64 = 0.2;
/// The pieces' ends lie this near to the whole, as a multiple of the noise of
/// the 2D segments.
const MAX_BEND_IN_NOISE: f64 = 2.0;

/// What the step has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct MergedEdges {
    /// Copies dropped.
    pub copies: usize,
    /// Pairs of pieces that have become one edge.
    pub pieces: usize,
}

/// Drops copies and merges pieces. Only edges with free ends change: the rest of
/// the graph stays as it is.
pub(super) fn merge_parallel(
    views: &[TrackView],
    graph: &mut JunctionGraph,
    noise_in_pixels: f64,
) -> MergedEdges {
    let mut merged = MergedEdges::default();
    for _ in 0..ROUNDS {
        let before = merged;
        let degree = graph.degrees();
        let mut pairs = pairs_with_common_segments(views, graph);
        pairs.sort_by(|(a, x), (b, y)| view_count(b).cmp(&view_count(a)).then(x.cmp(y)));
        let mut dropped = vec![false; graph.edges.len()];
        let mut changed = vec![false; graph.edges.len()];
        for (common, [a, b]) in pairs {
            if changed[a] || changed[b] {
                continue;
            }
            let pair = Pair {
                views,
                graph,
                degree: &degree,
                edges: [a, b],
                lines: [a, b].map(|edge| segment_of_edge(graph, &graph.edges[edge])),
            };
            if !pair.is_parallel() {
                continue;
            }
            if let Some(side) = pair.copy(common.len()) {
                dropped[[a, b][side]] = true;
                merged.copies += 1;
            } else if let Some(whole) = pair.whole(&common, noise_in_pixels) {
                graph.edges[a] = whole;
                dropped[b] = true;
                merged.pieces += 1;
            } else {
                continue;
            }
            changed[a] = true;
            changed[b] = true;
        }
        let mut dropped = dropped.into_iter();
        graph.edges.retain(|_| !dropped.next().unwrap_or(false));
        if merged == before {
            break;
        }
    }
    graph.edges.sort_by_key(|edge| edge.junctions);
    graph.edges.dedup_by(|later, earlier| {
        let same = later.junctions == earlier.junctions;
        if same {
            earlier.supports.append(&mut later.supports);
            earlier.supports.sort_unstable();
            earlier.supports.dedup();
        }
        same
    });
    merged
}

/// Pairs of edges with the 2D segments that support both, ascending.
fn pairs_with_common_segments(
    views: &[TrackView],
    graph: &JunctionGraph,
) -> Vec<(Vec<SegmentId>, [usize; 2])> {
    let mut common: BTreeMap<[usize; 2], Vec<SegmentId>> = BTreeMap::new();
    for (view, of_view) in graph.edges_of_segments(views).iter().enumerate() {
        for (segment, edges) in of_view.iter().enumerate() {
            for (i, a) in edges.iter().enumerate() {
                for b in &edges[i + 1..] {
                    let id = SegmentId { view, segment };
                    common.entry([*a, *b]).or_default().push(id);
                }
            }
        }
    }
    common.into_iter().map(|(pair, ids)| (ids, pair)).collect()
}

/// Two edges with 2D segments in common.
struct Pair<'a> {
    views: &'a [TrackView],
    graph: &'a JunctionGraph,
    degree: &'a [usize],
    edges: [usize; 2],
    lines: [LineSegment3; 2],
}

impl Pair<'_> {
    fn edge(&self, side: usize) -> &GraphEdge {
        &self.graph.edges[self.edges[side]]
    }

    fn is_parallel(&self) -> bool {
        let [a, b] = self.lines.map(|line| (line.end - line.start).normalize());
        a.cross(&b).norm() <= MAX_SINE
    }

    /// Which of the two, if any, is a copy of the other: the shorter one, if all
    /// its ends are free and too few views show both apart.
    fn copy(&self, common: usize) -> Option<usize> {
        let side = usize::from(self.lines[1].length() <= self.lines[0].length());
        let (line, other) = (&self.lines[side], &self.lines[1 - side]);
        let free = |junction: usize| self.degree[junction] == 1;
        let [s, t] = line.ends().map(|end| other.line_parameter(&end));
        let along = s.max(t).min(1.0) - s.min(t).max(0.0);
        let lies_along = along >= MIN_OVERLAP * (s - t).abs();
        let own = self.edge(side).supports.len();
        if (common as f64) < MIN_COMMON_SHARE * own as f64 {
            return None;
        }
        if !lies_along || !self.edge(side).junctions.into_iter().all(free) {
            return None;
        }
        let fewer = (0..2)
            .map(|side| view_count(&self.edge(side).supports))
            .min()?;
        let separate = self.separate_views() as f64;
        (separate < MIN_SEPARATE_SHARE * fewer as f64).then_some(side)
    }

    /// The number of views that show each by a segment that is nearer to it than
    /// to the other.
    fn separate_views(&self) -> usize {
        let mut shown: BTreeMap<usize, [bool; 2]> = BTreeMap::new();
        for id in (0..2).flat_map(|side| &self.edge(side).supports) {
            let camera = &self.views[id.view].camera;
            let segment = &segment_of(self.views, *id).segment;
            let [a, b] = [0, 1].map(|side| {
                ProjectedLine::new(camera, &self.lines[side])
                    .map_or(f64::INFINITY, |line| line.segment_distance(segment))
            });
            shown.entry(id.view).or_default()[usize::from(b < a)] = true;
        }
        shown.values().filter(|[a, b]| *a && *b).count()
    }

    /// The edge that both are pieces of, if they lie behind each other with free
    /// ends between and enough views bridge the gap.
    fn whole(&self, common: &[SegmentId], noise_in_pixels: f64) -> Option<GraphEdge> {
        let [first, second] = self.lines;
        // The ends of each that face the other.
        let inner = [(&first, &second), (&second, &first)]
            .map(|(line, other)| usize::from(line.line_parameter(&other.point_at(0.5)) > 0.5));
        let junctions = [0, 1].map(|side| self.edge(side).junctions);
        let [a, b] = [0, 1].map(|side| junctions[side][1 - inner[side]]);
        let between = [0, 1].map(|side| junctions[side][inner[side]]);
        if a == b || between.iter().any(|junction| self.degree[*junction] != 1) {
            return None;
        }
        let bridging = view_count(common);
        let fewer = (0..2)
            .map(|side| view_count(&self.edge(side).supports))
            .min()?;
        if bridging < MIN_BRIDGING_VIEWS || (bridging as f64) < MIN_BRIDGING_SHARE * fewer as f64 {
            return None;
        }
        let whole = LineSegment3::new(self.graph.junctions[a], self.graph.junctions[b]);
        let [s, t] = between.map(|junction| whole.line_parameter(&self.graph.junctions[junction]));
        // Behind each other, with a gap that is no longer than the pieces.
        if !(0.0 < s && s < 1.0 && 0.0 < t && t < 1.0 && (t - s).abs() <= 0.5) {
            return None;
        }
        let mut supports = [self.edge(0).supports.as_slice(), &self.edge(1).supports].concat();
        supports.sort_unstable();
        supports.dedup();
        let max_bend = MAX_BEND_IN_NOISE * noise_in_pixels;
        let straight = between.iter().all(|junction| {
            self.mean_distance(&supports, &whole, &self.graph.junctions[*junction]) <= max_bend
        });
        straight.then(|| GraphEdge {
            junctions: [a.min(b), a.max(b)],
            supports,
        })
    }

    /// Mean distance of a point from a line in the views of some segments.
    fn mean_distance(
        &self,
        supports: &[SegmentId],
        line: &LineSegment3,
        point: &nalgebra::Vector3<f64>,
    ) -> f64 {
        let distances = supports.iter().map(|id| {
            let camera = &self.views[id.view].camera;
            Option::zip(
                ProjectedLine::new(camera, line),
                project_in_front(camera, point),
            )
            .map_or(f64::INFINITY, |(line, pixel)| line.distance(&pixel).abs())
        });
        distances.sum::<f64>() / supports.len().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::test_tracks::{cube_edge, cube_views, members_of_edge};
    use nalgebra::Vector3;

    /// Two edges that are parts of edge 0 of the cube, moved aside.
    fn graph(views: &[TrackView], parts: [[f64; 2]; 2], aside: f64) -> JunctionGraph {
        let line = cube_edge(0);
        let side = Vector3::new(0.3, 0.4, 0.5)
            .cross(&(line.end - line.start))
            .normalize();
        let mut graph = JunctionGraph::default();
        for (i, [low, high]) in parts.into_iter().enumerate() {
            let shift = side * aside * i as f64;
            graph
                .junctions
                .extend([low, high].map(|t| line.point_at(t) + shift));
            graph.edges.push(GraphEdge {
                junctions: [2 * i, 2 * i + 1],
                supports: members_of_edge(views, 0),
            });
        }
        graph
    }

    fn merge(views: &[TrackView], graph: &mut JunctionGraph) -> [usize; 2] {
        let merged = merge_parallel(views, graph, 0.5);
        [merged.copies, merged.pieces]
    }

    #[test]
    fn copies_disappear_and_bridged_pieces_become_one() {
        let views = cube_views(10);
        let mut copies = graph(&views, [[0.0, 1.0], [0.1, 0.9]], 1e-3);
        assert_eq!(merge(&views, &mut copies), [1, 0]);
        assert_eq!(copies.edges[0].junctions, [0, 1]);

        let mut pieces = graph(&views, [[0.0, 0.4], [0.6, 1.0]], 0.0);
        assert_eq!(merge(&views, &mut pieces), [0, 1]);
        assert_eq!(pieces.edges.len(), 1);
        assert_eq!(pieces.edges[0].junctions, [0, 3]);
    }

    #[test]
    fn edges_with_segments_of_their_own_and_pieces_without_a_bridge_stay() {
        let views = cube_views(10);
        // Edge 1 of the cube lends its segments: each edge has some of its own.
        let mut apart = graph(&views, [[0.0, 1.0], [0.0, 1.0]], 0.0);
        let side = cube_edge(1);
        apart.junctions[2..].copy_from_slice(&side.ends());
        apart.edges[1].supports = members_of_edge(&views, 1);
        let before = apart.clone();
        assert_eq!(merge(&views, &mut apart), [0, 0]);
        assert_eq!(apart, before);

        let mut pieces = graph(&views, [[0.0, 0.4], [0.6, 1.0]], 0.0);
        pieces.edges[1].supports.clear();
        assert_eq!(merge(&views, &mut pieces), [0, 0]);
        let mut bent = graph(&views, [[0.0, 0.4], [0.6, 1.0]], 0.1);
        assert_eq!(merge(&views, &mut bent), [0, 0]);
    }
}
