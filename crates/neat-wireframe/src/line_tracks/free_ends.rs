//! Joins the ends of edges that hang free: to each other, to a junction, or to
//! the inside of another edge.
//!
//! Detectors stop short of corners or run past them, and few of their segments
//! share a vertex. Two edges meet if one point lies on both of their images, in
//! all views that show them; their distance in space says less, since few views
//! leave depth uncertain. An end moves along its own edge by a few pixels, or as
//! far as 2D segments cover the gap.

use super::certain_line::{CertainLine, Meeting, meeting};
use super::edge_splitting::Split;
use super::graph_adjustment::segment_of_edge;
use super::junction_graph::JunctionGraph;
use super::line_refinement::{LineRefinementConfig, shown_interval};
use super::projected_line::ProjectedLine;
use super::view_segments::{SegmentId, TrackView, segment_of};
use crate::projection::project_in_front;
use nalgebra::Vector3;
use neat_core::LineSegment2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Which free ends meet something.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FreeEndsConfig {
    /// Joined ends let others find them: the search is repeated up to this many
    /// times. 0 switches the step off.
    pub rounds: usize,
    /// Edges that meet pass each other this near in their images, as a multiple of
    /// the noise of the 2D segments.
    pub max_miss_in_noise: f64,
    /// An edge on which another one ends bends by at most this multiple of the
    /// noise.
    pub max_bend_in_noise: f64,
    /// Sine of the angle between two edges that meet, at least.
    pub min_sine: f64,
    /// An end moves this far along its edge without further evidence …
    pub max_shift_in_pixels: f64,
    /// … and by at most this share of its edge.
    pub max_relative_shift: f64,
    /// It grows by up to this share of its edge where 2D segments cover the gap.
    pub max_covered_extension: f64,
    /// A view covers a gap if its segments on the line show this share of it.
    pub min_covered_share: f64,
    /// Views that cover a gap, at least …
    pub min_covering_views: usize,
    /// … and as a share of the views that show the edge.
    pub min_covering_share: f64,
}

impl Default for FreeEndsConfig {
    fn default() -> Self {
        Self {
            rounds: 3,
            max_miss_in_noise: 3.0,
            max_bend_in_noise: 1.0,
            min_sine: 0.4,
            max_shift_in_pixels: 12.0,
            max_relative_shift: 0.25,
            max_covered_extension: 0.5,
            min_covered_share: 0.6,
            min_covering_views: 2,
            min_covering_share: 0.2,
        }
    }
}

/// What the step has done.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct JoinedEnds {
    /// Pairs of free ends that have become one junction.
    pub corners: usize,
    /// Free ends that have become part of a junction.
    pub attached: usize,
    /// Ends that lie on the inside of another edge now.
    pub on_edges: Vec<Split>,
}

/// Moves and joins free ends. Edges stay whole: those that others end on are to be
/// split.
pub(super) fn join_free_ends(
    views: &[TrackView],
    graph: &mut JunctionGraph,
    noise_in_pixels: f64,
    refinement: &LineRefinementConfig,
    config: &FreeEndsConfig,
) -> JoinedEnds {
    let mut joined = JoinedEnds::default();
    for _ in 0..config.rounds {
        let search = Search::new(
            views,
            graph,
            &joined.on_edges,
            noise_in_pixels,
            refinement,
            config,
        );
        let found: Vec<Vec<Found>> = (0..graph.edges.len())
            .into_par_iter()
            .map(|edge| search.joins_of_edge(edge))
            .collect();
        let mut found: Vec<Found> = found.into_iter().flatten().collect();
        found.sort_by(|a, b| {
            let by_cost = a.cost.total_cmp(&b.cost);
            by_cost.then((a.junction, a.target.order()).cmp(&(b.junction, b.target.order())))
        });
        if !apply(graph, &found, &mut joined) {
            break;
        }
    }
    joined
}

/// What a free end meets.
#[derive(Clone, Copy, Debug)]
enum Target {
    /// Another free end: both move to the place.
    FreeEnd {
        junction: usize,
        place: Vector3<f64>,
    },
    /// A junction of several edges, which stays where it is.
    Junction { junction: usize },
    /// The inside of an edge, named by its junctions.
    Inside { edge: usize, place: Vector3<f64> },
}

impl Target {
    fn order(&self) -> (usize, usize) {
        match self {
            Self::FreeEnd { junction, .. } => (0, *junction),
            Self::Junction { junction } => (1, *junction),
            Self::Inside { edge, .. } => (2, *edge),
        }
    }
}

/// A free end and what it meets.
#[derive(Clone, Copy, Debug)]
struct Found {
    /// Pixels by which ends move.
    cost: f64,
    junction: usize,
    target: Target,
}

/// The best first, each free end once. Returns whether anything has been joined.
fn apply(graph: &mut JunctionGraph, found: &[Found], joined: &mut JoinedEnds) -> bool {
    let mut changed = vec![false; graph.junctions.len()];
    let mut pairs: BTreeSet<[usize; 2]> = graph.edges.iter().map(|e| sorted(e.junctions)).collect();
    let mut edge_of: Vec<usize> = vec![usize::MAX; graph.junctions.len()];
    for (i, edge) in graph.edges.iter().enumerate() {
        for junction in edge.junctions {
            edge_of[junction] = i;
        }
    }
    let mut any = false;
    for Found {
        junction, target, ..
    } in found
    {
        if changed[*junction] {
            continue;
        }
        match *target {
            Target::FreeEnd {
                junction: other,
                place,
            } => {
                if changed[other]
                    || !replace(graph, &mut pairs, edge_of[*junction], *junction, other)
                {
                    continue;
                }
                graph.junctions[other] = place;
                changed[other] = true;
                joined.corners += 1;
            }
            Target::Junction { junction: other } => {
                if changed[other]
                    || !replace(graph, &mut pairs, edge_of[*junction], *junction, other)
                {
                    continue;
                }
                joined.attached += 1;
            }
            Target::Inside { edge, place } => {
                graph.junctions[*junction] = place;
                joined.on_edges.push(Split {
                    edge,
                    junction: *junction,
                });
            }
        }
        changed[*junction] = true;
        any = true;
    }
    any
}

/// Gives an edge another junction, unless it would become a loop or a copy.
fn replace(
    graph: &mut JunctionGraph,
    pairs: &mut BTreeSet<[usize; 2]>,
    edge: usize,
    old: usize,
    new: usize,
) -> bool {
    let before = graph.edges[edge].junctions;
    let after = before.map(|junction| if junction == old { new } else { junction });
    if after[0] == after[1] || !pairs.insert(sorted(after)) {
        return false;
    }
    pairs.remove(&sorted(before));
    graph.edges[edge].junctions = after;
    true
}

fn sorted([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

/// The graph as it is at the beginning of a round.
struct Search<'a> {
    views: &'a [TrackView],
    graph: &'a JunctionGraph,
    lines: Vec<Option<CertainLine>>,
    /// Edges at each junction.
    degree: Vec<usize>,
    /// Ends that lie on the inside of an edge are not free.
    anchored: Vec<bool>,
    /// The edges that each 2D segment supports.
    edges_of: Vec<Vec<Vec<usize>>>,
    max_miss: f64,
    max_bend: f64,
    config: &'a FreeEndsConfig,
}

impl<'a> Search<'a> {
    fn new(
        views: &'a [TrackView],
        graph: &'a JunctionGraph,
        on_edges: &[Split],
        noise_in_pixels: f64,
        refinement: &LineRefinementConfig,
        config: &'a FreeEndsConfig,
    ) -> Self {
        let mut anchored = vec![false; graph.junctions.len()];
        for split in on_edges {
            anchored[split.junction] = true;
        }
        Self {
            views,
            graph,
            lines: certain_lines(views, graph, refinement),
            degree: graph.degrees(),
            anchored,
            edges_of: edges_of_segments(views, graph),
            max_miss: config.max_miss_in_noise * noise_in_pixels,
            max_bend: config.max_bend_in_noise * noise_in_pixels,
            config,
        }
    }

    fn is_free(&self, junction: usize) -> bool {
        self.degree[junction] == 1 && !self.anchored[junction]
    }

    /// Everything that the free ends of an edge meet.
    fn joins_of_edge(&self, edge: usize) -> Vec<Found> {
        let mut found = Vec::new();
        let Some(line) = &self.lines[edge] else {
            return found;
        };
        for side in 0..2 {
            if !self.is_free(self.graph.edges[edge].junctions[side]) {
                continue;
            }
            for other in self.edges_near(edge, side) {
                if let Some(other_line) = &self.lines[other] {
                    found.extend(self.meets(edge, side, line, other, other_line));
                }
            }
        }
        found
    }

    /// The edges whose 2D segments pass near an end or the line beyond it, in a
    /// view that shows the edge.
    fn edges_near(&self, edge: usize, side: usize) -> Vec<usize> {
        let Some(line) = &self.lines[edge] else {
            return Vec::new();
        };
        let beyond = self.max_extension(line) / line.length_in_pixels();
        let [end, farthest] = [0.0, beyond].map(|by| {
            let parameter = if side == 0 { -by } else { 1.0 + by };
            line.line.point_at(parameter)
        });
        let mut near = Vec::new();
        for view in &line.views {
            let prepared = &self.views[*view];
            let piece = Option::zip(
                project_in_front(&prepared.camera, &end),
                project_in_front(&prepared.camera, &farthest),
            );
            if let Some((start, end)) = piece {
                for segment in prepared.index.near(&LineSegment2::new(start, end)) {
                    near.extend(&self.edges_of[*view][segment]);
                }
            }
        }
        near.sort_unstable();
        near.dedup();
        near.retain(|other| *other != edge);
        near
    }

    fn meets(
        &self,
        edge: usize,
        side: usize,
        line: &CertainLine,
        other: usize,
        other_line: &CertainLine,
    ) -> Option<Found> {
        let junction = self.graph.edges[edge].junctions[side];
        let found = meeting(self.views, line, other_line, self.config.min_sine)?;
        let shift = outward_shift(line, side, found.parameters[0]);
        let parameter = found.parameters[1];
        let other_side = usize::from(parameter > 0.5);
        let other_shift = outward_shift(other_line, other_side, parameter);
        let other_junction = self.graph.edges[other].junctions[other_side];
        // So near to an end of the other edge that it is that end which is meant.
        let at_end = -other_shift <= self.max_shift(other_line);
        let (cost, target) = if !at_end {
            if !self.may_move(edge, side, shift) {
                return None;
            }
            let (place, miss) = self.place_inside(line, other_line, &found)?;
            (shift.abs() + miss, Target::Inside { edge: other, place })
        } else if self.is_free(other_junction) {
            let fits = found.miss_in_pixels <= self.max_miss
                && self.may_move(edge, side, shift)
                && self.may_move(other, other_side, other_shift);
            if !fits {
                return None;
            }
            let target = Target::FreeEnd {
                junction: other_junction,
                place: found.place,
            };
            (
                shift.abs() + other_shift.abs() + found.miss_in_pixels,
                target,
            )
        } else {
            let place = self.graph.junctions[other_junction];
            let miss = line.distance_in_pixels(self.views, &place);
            let shift = outward_shift(line, side, line.line.line_parameter(&place));
            if miss > self.max_miss || !self.may_move(edge, side, shift) {
                return None;
            }
            let target = Target::Junction {
                junction: other_junction,
            };
            (shift.abs() + miss, target)
        };
        Some(Found {
            cost,
            junction,
            target,
        })
    }

    /// Where an edge ends on the inside of another one, which goes on and so stays
    /// straight, unless it is the less certain of the two: then it may bend by as
    /// much as nobody sees.
    fn place_inside(
        &self,
        line: &CertainLine,
        other: &CertainLine,
        found: &Meeting,
    ) -> Option<(Vector3<f64>, f64)> {
        let on_other = other.line.point_at(found.parameters[1]);
        let miss = line.distance_in_pixels(self.views, &on_other);
        if miss <= self.max_miss {
            return Some((on_other, miss));
        }
        let bend = other.distance_in_pixels(self.views, &found.place);
        let fits = found.miss_in_pixels <= self.max_miss && bend <= self.max_bend;
        fits.then_some((found.place, found.miss_in_pixels))
    }

    /// Pixels by which an end moves without evidence for more.
    fn max_shift(&self, line: &CertainLine) -> f64 {
        let relative = self.config.max_relative_shift * line.length_in_pixels();
        relative.min(self.config.max_shift_in_pixels)
    }

    /// Pixels by which an end moves at most.
    fn max_extension(&self, line: &CertainLine) -> f64 {
        let covered = self.config.max_covered_extension * line.length_in_pixels();
        covered.max(self.max_shift(line))
    }

    /// Whether the images let an end move by that many pixels, outward if positive.
    fn may_move(&self, edge: usize, side: usize, shift: f64) -> bool {
        let Some(line) = &self.lines[edge] else {
            return false;
        };
        shift.abs() <= self.max_shift(line)
            || (shift > 0.0
                && shift <= self.max_extension(line)
                && self.is_covered(line, side, shift))
    }

    /// Whether enough views show the line beyond an end.
    fn is_covered(&self, line: &CertainLine, side: usize, shift: f64) -> bool {
        let beyond = shift / line.length_in_pixels();
        let gap = if side == 0 {
            [-beyond, 0.0]
        } else {
            [1.0, 1.0 + beyond]
        };
        let covering = line
            .views
            .iter()
            .filter(|view| self.covers(**view, line, gap))
            .count();
        covering >= self.config.min_covering_views
            && covering as f64 >= self.config.min_covering_share * line.views.len() as f64
    }

    /// Whether the segments of a view that lie on the line show enough of an
    /// interval of it.
    fn covers(&self, view: usize, line: &CertainLine, [low, high]: [f64; 2]) -> bool {
        let prepared = &self.views[view];
        let [start, end] = [low, high].map(|t| line.line.point_at(t));
        let projected = Option::zip(
            project_in_front(&prepared.camera, &start),
            project_in_front(&prepared.camera, &end),
        );
        let Some(((start, end), on_line)) =
            projected.zip(ProjectedLine::new(&prepared.camera, &line.line))
        else {
            return false;
        };
        let mut shown: Vec<[f64; 2]> = prepared
            .index
            .near(&LineSegment2::new(start, end))
            .into_iter()
            .map(|segment| SegmentId { view, segment })
            .filter(|id| {
                on_line.segment_distance(&segment_of(self.views, *id).segment) <= self.max_miss
            })
            .filter_map(|id| shown_interval(self.views, id, &line.line))
            .collect();
        shown.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let (mut covered, mut reached) = (0.0, low);
        for [from, to] in shown {
            let (from, to) = (from.max(reached), to.min(high));
            if to > from {
                covered += to - from;
                reached = to;
            }
        }
        covered >= self.config.min_covered_share * (high - low)
    }
}

/// Pixels by which a place on a line lies beyond one of its ends; negative within.
fn outward_shift(line: &CertainLine, side: usize, parameter: f64) -> f64 {
    let beyond = if side == 0 {
        -parameter
    } else {
        parameter - 1.0
    };
    beyond * line.length_in_pixels()
}

/// Every edge with its certainty.
pub(super) fn certain_lines(
    views: &[TrackView],
    graph: &JunctionGraph,
    refinement: &LineRefinementConfig,
) -> Vec<Option<CertainLine>> {
    graph
        .edges
        .par_iter()
        .map(|edge| {
            let line = segment_of_edge(graph, edge);
            CertainLine::new(views, &edge.supports, &line, refinement)
        })
        .collect()
}

/// The edges that each 2D segment of each view supports, ascending.
pub(super) fn edges_of_segments(
    views: &[TrackView],
    graph: &JunctionGraph,
) -> Vec<Vec<Vec<usize>>> {
    let mut edges_of: Vec<Vec<Vec<usize>>> = views
        .iter()
        .map(|view| vec![Vec::new(); view.segments.len()])
        .collect();
    for (edge, of_graph) in graph.edges.iter().enumerate() {
        for id in &of_graph.supports {
            edges_of[id.view][id.segment].push(edge);
        }
    }
    edges_of
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::junction_graph::GraphEdge;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};

    /// Every edge with junctions of its own, as it is seen by ten cameras, and the
    /// graph of shown edges, which may be shorter.
    fn scene(seen: &[[[f64; 3]; 2]], known: &[[[f64; 3]; 2]]) -> (Vec<TrackView>, JunctionGraph) {
        let junctions = |edges: &[[[f64; 3]; 2]]| -> Vec<Vector3<f64>> {
            edges.iter().flatten().map(|x| Vector3::from(*x)).collect()
        };
        let pairs: Vec<[usize; 2]> = (0..seen.len()).map(|i| [2 * i, 2 * i + 1]).collect();
        let views = views_of_edges(&cameras_on_sphere(10), &junctions(seen), &pairs)
            .iter()
            .map(|observation| TrackView::new(observation, 1.0, 1.0))
            .collect();
        let edges = (0..known.len())
            .map(|segment| GraphEdge {
                junctions: pairs[segment],
                supports: (0..10).map(|view| SegmentId { view, segment }).collect(),
            })
            .collect();
        let graph = JunctionGraph {
            junctions: junctions(known),
            edges,
        };
        (views, graph)
    }

    fn join(views: &[TrackView], graph: &mut JunctionGraph) -> JoinedEnds {
        let refinement = LineRefinementConfig::default();
        join_free_ends(views, graph, 0.5, &refinement, &FreeEndsConfig::default())
    }

    #[test]
    fn a_bar_that_runs_past_a_post_ends_on_it() {
        // A post, a bar that runs 0.01 (about 3 pixels) past it, and one that
        // crosses it.
        let edges = [
            [[0.0, -0.4, 0.0], [0.0, 0.4, 0.0]],
            [[-0.01, 0.1, 0.0], [0.5, 0.1, 0.0]],
            [[-0.3, -0.1, 0.0], [0.3, -0.1, 0.0]],
        ];
        let (views, mut graph) = scene(&edges, &edges);
        let before = graph.clone();
        let joined = join(&views, &mut graph);
        assert_eq!((joined.corners, joined.attached), (0, 0));
        assert_eq!(
            joined.on_edges,
            [Split {
                edge: 0,
                junction: 2
            }]
        );
        assert!((graph.junctions[2] - Vector3::new(0.0, 0.1, 0.0)).norm() < 1e-9);
        for untouched in [0, 1, 3, 4, 5] {
            assert_eq!(graph.junctions[untouched], before.junctions[untouched]);
        }
    }

    #[test]
    fn ends_that_stop_short_of_a_corner_meet_in_it() {
        let edges = [
            [[0.02, 0.0, 0.0], [0.4, 0.0, 0.0]],
            [[0.0, 0.015, 0.0], [0.0, 0.4, 0.0]],
            [[0.0, 0.0, 0.01], [0.0, 0.0, 0.4]],
        ];
        let (views, mut graph) = scene(&edges, &edges);
        let joined = join(&views, &mut graph);
        assert_eq!((joined.corners, joined.attached), (1, 1));
        let corner = graph.edges[0].junctions[0];
        assert!(
            graph
                .edges
                .iter()
                .all(|edge| edge.junctions.contains(&corner))
        );
        assert!(graph.junctions[corner].norm() < 1e-9);
    }

    #[test]
    fn an_edge_grows_only_where_segments_show_it() {
        let seen = [
            [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]],
            [[0.0, -0.3, 0.0], [0.0, 0.3, 0.0]],
        ];
        let short = [[[0.1, 0.0, 0.0], [0.4, 0.0, 0.0]], seen[1]];
        let (views, mut graph) = scene(&seen, &short);
        let joined = join(&views, &mut graph);
        assert_eq!(
            joined.on_edges,
            [Split {
                edge: 1,
                junction: 0
            }]
        );
        assert!(graph.junctions[0].norm() < 1e-9);

        let (views, mut graph) = scene(&short, &short);
        assert_eq!(join(&views, &mut graph), JoinedEnds::default());
    }

    #[test]
    fn edges_that_cross_in_some_images_only_do_not_meet() {
        let edges = [
            [[0.0, -0.4, 0.0], [0.0, 0.4, 0.0]],
            [[0.01, 0.1, 0.06], [0.5, 0.1, 0.06]],
        ];
        let (views, mut graph) = scene(&edges, &edges);
        assert_eq!(join(&views, &mut graph), JoinedEnds::default());
    }
}
