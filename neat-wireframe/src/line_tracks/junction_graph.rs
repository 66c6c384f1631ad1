//! From tracks to a graph: which ends of tracks are one junction, and where it
//! is.
//!
//! The 2D wireframes are graphs themselves. Where their vertices join members of
//! two tracks in several views, the tracks' ends are one junction; ends that all
//! but meet in space are joined as well.

use super::clustering::{Track, view_count};
use super::end_joining::{Joining, TrackEnds};
use super::track_merging::{TrackOfSegment, tracks_of_segments};
use super::view_segments::{SegmentId, TrackView, VertexEnd};
use crate::index::PointIndex;
use crate::projection::project_in_front;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Views whose vertices must join two ends.
const MIN_VOTES: usize = 2;
/// A vertex belongs to a track's end if it lies this near to its projection …
pub(super) const ATTACH_IN_PIXELS: f64 = 12.0;
/// … or nearer than this share of the track's length, at most twice as far.
const ATTACH_RELATIVE: f64 = 0.15;
/// A junction lies this near to the line of each of its tracks.
pub(super) const MAX_LINE_DISTANCE_IN_PIXELS: f64 = 2.5;
/// Ends nearer to each other than this are joined without any vote …
const NEAR_IN_PIXELS: f64 = 6.0;
/// … and ends of lines that cross at a clear angle up to this distance:
/// detectors stop short of corners.
const NEAR_CORNER_IN_PIXELS: f64 = 18.0;
/// Cosine of that angle at most.
const MAX_CORNER_COSINE: f64 = 0.9;
/// Joining moves no end along its track by more than this share of it.
pub(super) const MAX_RELATIVE_SHIFT: f64 = 0.35;

/// An edge between two junctions with the 2D segments that show it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GraphEdge {
    /// Indices of its junctions, ascending.
    pub junctions: [usize; 2],
    /// The 2D segments, ascending.
    pub supports: Vec<SegmentId>,
}

/// Junctions and edges with their evidence.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct JunctionGraph {
    /// Positions, in the world whose scene ball has radius 1.
    pub junctions: Vec<Vector3<f64>>,
    /// No two edges have the same junctions.
    pub edges: Vec<GraphEdge>,
}

impl JunctionGraph {
    /// Number of edges at each junction.
    pub(super) fn degrees(&self) -> Vec<usize> {
        let mut degrees = vec![0; self.junctions.len()];
        for junction in self.edges.iter().flat_map(|edge| edge.junctions) {
            degrees[junction] += 1;
        }
        degrees
    }

    /// The edges that each 2D segment of each view supports, ascending.
    pub(super) fn edges_of_segments(&self, views: &[TrackView]) -> Vec<Vec<Vec<usize>>> {
        let mut edges_of: Vec<Vec<Vec<usize>>> = views
            .iter()
            .map(|view| vec![Vec::new(); view.segments.len()])
            .collect();
        for (index, edge) in self.edges.iter().enumerate() {
            for id in &edge.supports {
                edges_of[id.view][id.segment].push(index);
            }
        }
        edges_of
    }
}

/// The graph of the tracks, completed by edges that 2D segments without a track
/// draw between its junctions in at least `min_views` views.
///
/// These are above all edges along the cameras' baseline, which no pair of views
/// can triangulate: their junctions, found through other edges, hold them.
pub(super) fn junction_graph(
    views: &[TrackView],
    tracks: &[Track],
    min_views: usize,
) -> JunctionGraph {
    let track_of = tracks_of_segments(views, tracks);
    let ends = TrackEnds::new(views, tracks);
    let attached = attached_vertices(views, &ends, &track_of);
    let mut joining = Joining::new(&ends);
    for (_, [a, b]) in votes(&attached) {
        joining.join(a, b, f64::INFINITY);
    }
    for (_, [a, b]) in near_pairs(&ends) {
        joining.join(a, b, NEAR_CORNER_IN_PIXELS);
    }
    let (junctions, junction_of_end) = joining.junctions();

    let mut edges: BTreeMap<[usize; 2], Vec<SegmentId>> = BTreeMap::new();
    for (track, of_track) in tracks.iter().enumerate() {
        let [a, b] = [0, 1].map(|side| junction_of_end[2 * track + side]);
        if a != b {
            let supports = edges.entry([a.min(b), a.max(b)]).or_default();
            supports.extend(&of_track.members);
        }
    }
    let drawn = drawn_edges(views, &track_of, &attached, &junctions, &junction_of_end);
    for (pair, supports) in drawn {
        if view_count(&supports) >= min_views {
            edges.entry(pair).or_default().extend(supports);
        }
    }
    JunctionGraph {
        junctions,
        edges: edges
            .into_iter()
            .map(|(junctions, mut supports)| {
                supports.sort_unstable();
                supports.dedup();
                GraphEdge {
                    junctions,
                    supports,
                }
            })
            .collect(),
    }
}

/// A 2D vertex at an end of a track.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Attached {
    view: usize,
    vertex: usize,
    end: usize,
}

/// The vertices of all members at the ends of their tracks, ascending.
fn attached_vertices(
    views: &[TrackView],
    ends: &TrackEnds,
    track_of: &TrackOfSegment,
) -> Vec<Attached> {
    let mut attached = Vec::new();
    for (view, prepared) in views.iter().enumerate() {
        for (vertex, vertex_ends) in prepared.vertices.iter().enumerate() {
            let pixel = prepared.vertex_position(vertex);
            for VertexEnd { segment, .. } in vertex_ends {
                let Some(track) = track_of[view][*segment] else {
                    continue;
                };
                let projected = Option::zip(
                    project_in_front(&prepared.camera, &ends.positions[2 * track]),
                    project_in_front(&prepared.camera, &ends.positions[2 * track + 1]),
                );
                let Some((start, stop)) = projected else {
                    continue;
                };
                let distances = [(start - pixel).norm(), (stop - pixel).norm()];
                let side = usize::from(distances[1] < distances[0]);
                let relative = ATTACH_RELATIVE * (stop - start).norm();
                let reach = relative.clamp(ATTACH_IN_PIXELS, 2.0 * ATTACH_IN_PIXELS);
                if distances[side] <= reach {
                    attached.push(Attached {
                        view,
                        vertex,
                        end: 2 * track + side,
                    });
                }
            }
        }
    }
    attached.sort_unstable();
    attached.dedup();
    attached
}

/// Pairs of ends that enough views join, most views first.
fn votes(attached: &[Attached]) -> Vec<(usize, [usize; 2])> {
    // The last view that voted, so that a view counts once.
    let mut votes: BTreeMap<[usize; 2], (usize, usize)> = BTreeMap::new();
    for group in attached.chunk_by(|a, b| (a.view, a.vertex) == (b.view, b.vertex)) {
        for (i, a) in group.iter().enumerate() {
            for b in &group[i + 1..] {
                if a.end / 2 == b.end / 2 {
                    continue;
                }
                let (count, last) = votes.entry([a.end, b.end]).or_insert((0, usize::MAX));
                if *last != a.view {
                    *count += 1;
                    *last = a.view;
                }
            }
        }
    }
    let mut pairs: Vec<(usize, [usize; 2])> = votes
        .into_iter()
        .filter(|(_, (count, _))| *count >= MIN_VOTES)
        .map(|(pair, (count, _))| (count, pair))
        .collect();
    pairs.sort_by(|(x, a), (y, b)| y.cmp(x).then(a.cmp(b)));
    pairs
}

/// Pairs of ends that all but meet, nearest first.
fn near_pairs(ends: &TrackEnds) -> Vec<(f64, [usize; 2])> {
    let index = PointIndex::new(ends.positions.clone());
    let mut pairs = Vec::new();
    for (a, position) in ends.positions.iter().enumerate() {
        let farthest = NEAR_IN_PIXELS.max(NEAR_CORNER_IN_PIXELS);
        let radius = farthest * ends.pixel_sizes[a];
        for neighbour in index.within(position, radius) {
            let b = neighbour.index;
            let size = ends.pixel_sizes[a].min(ends.pixel_sizes[b]);
            let distance = neighbour.distance / size;
            let cosine = ends.directions[a].dot(&ends.directions[b]).abs();
            let reach = if cosine <= MAX_CORNER_COSINE {
                farthest
            } else {
                NEAR_IN_PIXELS
            };
            if a < b && a / 2 != b / 2 && distance <= reach {
                pairs.push((distance, [a, b]));
            }
        }
    }
    pairs.sort_by(|(x, a), (y, b)| x.total_cmp(y).then(a.cmp(b)));
    pairs
}

/// The 2D segments without a track between two vertices that show junctions, by
/// the pair of junctions.
fn drawn_edges(
    views: &[TrackView],
    track_of: &TrackOfSegment,
    attached: &[Attached],
    junctions: &[Vector3<f64>],
    junction_of_end: &[usize],
) -> BTreeMap<[usize; 2], Vec<SegmentId>> {
    let mut drawn: BTreeMap<[usize; 2], Vec<SegmentId>> = BTreeMap::new();
    for (view, prepared) in views.iter().enumerate() {
        let mut junction_of_vertex: Vec<Option<(f64, usize)>> = vec![None; prepared.vertices.len()];
        let first = attached.partition_point(|a| a.view < view);
        for a in attached[first..].iter().take_while(|a| a.view == view) {
            let junction = junction_of_end[a.end];
            let Some(pixel) = project_in_front(&prepared.camera, &junctions[junction]) else {
                continue;
            };
            let distance = (pixel - prepared.vertex_position(a.vertex)).norm();
            let known = &mut junction_of_vertex[a.vertex];
            if distance <= NEAR_IN_PIXELS && known.is_none_or(|(other, _)| distance < other) {
                *known = Some((distance, junction));
            }
        }
        for (segment, shape) in prepared.segments.iter().enumerate() {
            if track_of[view][segment].is_some() {
                continue;
            }
            let [a, b] = shape.vertices.map(|vertex| junction_of_vertex[vertex]);
            if let (Some((_, a)), Some((_, b))) = (a, b)
                && a != b
            {
                let id = SegmentId { view, segment };
                drawn.entry([a.min(b), a.max(b)]).or_default().push(id);
            }
        }
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::test_tracks::{cube_tracks, cube_views};
    use crate::test_scenes::cube;

    #[test]
    fn the_ends_of_a_cube_meet_in_its_corners() {
        let views = cube_views(12);
        let tracks = cube_tracks(&views);
        let graph = junction_graph(&views, &tracks, 3);
        assert_eq!((graph.junctions.len(), graph.edges.len()), (8, 12));
        for corner in cube().0 {
            assert!(graph.junctions.iter().any(|x| (x - corner).norm() < 1e-9));
        }
    }

    #[test]
    fn edges_without_a_track_are_drawn_between_known_corners() {
        let views = cube_views(12);
        let mut tracks = cube_tracks(&views);
        tracks.remove(7);
        tracks.remove(2);
        let graph = junction_graph(&views, &tracks, 3);
        assert_eq!((graph.junctions.len(), graph.edges.len()), (8, 12));
        assert!(graph.edges.iter().all(|edge| edge.supports.len() == 12));
    }

    #[test]
    fn both_ends_of_a_track_never_become_one_junction() {
        let views = cube_views(12);
        let mut tracks = cube_tracks(&views);
        let short = tracks[0].line;
        tracks[0].line.end = short.point_at(1e-3);
        let graph = junction_graph(&views, &tracks, 3);
        assert!(
            graph
                .edges
                .iter()
                .all(|edge| edge.junctions[0] != edge.junctions[1])
        );
        let nothing = junction_graph(&[], &[], 3);
        assert_eq!(nothing, JunctionGraph::default());
    }
}
