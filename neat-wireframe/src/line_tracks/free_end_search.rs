//! Which free ends of edges meet something, and what.

use super::certain_line::{CertainLine, Meeting, certain_lines, meeting};
use super::edge_splitting::Split;
use super::free_ends;
use super::junction_graph::JunctionGraph;
use super::line_refinement::{LineRefinementConfig, shown_interval};
use super::projected_line::ProjectedLine;
use super::view_segments::{SegmentId, TrackView, segment_of};
use crate::interval_cover::covered_length;
use crate::projection::project_in_front;
use nalgebra::Vector3;
use neat_core::LineSegment2;
use rayon::prelude::*;

/// What a free end meets.
#[derive(Clone, Copy, Debug)]
pub(super) enum Target {
    /// Another free end: both move to the place.
    FreeEnd {
        junction: usize,
        place: Vector3<f64>,
    },
    /// A junction of several edges, which stays where it is.
    Junction { junction: usize },
    /// The inside of an edge.
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
pub(super) struct Found {
    /// Pixels by which ends move.
    cost: f64,
    /// The free end.
    pub junction: usize,
    /// What it meets.
    pub target: Target,
}

/// The graph as it is at the beginning of a round.
pub(super) struct Search<'a> {
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
}

impl<'a> Search<'a> {
    pub(super) fn new(
        views: &'a [TrackView],
        graph: &'a JunctionGraph,
        on_edges: &[Split],
        noise_in_pixels: f64,
        refinement: &LineRefinementConfig,
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
            edges_of: graph.edges_of_segments(views),
            max_miss: free_ends::MAX_MISS_IN_NOISE * noise_in_pixels,
            max_bend: free_ends::MAX_BEND_IN_NOISE * noise_in_pixels,
        }
    }

    /// Everything that free ends meet, what moves them least first.
    pub(super) fn found(&self) -> Vec<Found> {
        let found: Vec<Vec<Found>> = (0..self.graph.edges.len())
            .into_par_iter()
            .map(|edge| self.joins_of_edge(edge))
            .collect();
        let mut found: Vec<Found> = found.into_iter().flatten().collect();
        found.sort_by(|a, b| {
            let by_cost = a.cost.total_cmp(&b.cost);
            by_cost.then((a.junction, a.target.order()).cmp(&(b.junction, b.target.order())))
        });
        found
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
        let found = meeting(self.views, line, other_line, free_ends::MIN_SINE)?;
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
        let relative = free_ends::MAX_RELATIVE_SHIFT * line.length_in_pixels();
        relative.min(free_ends::MAX_SHIFT_IN_PIXELS)
    }

    /// Pixels by which an end moves at most.
    fn max_extension(&self, line: &CertainLine) -> f64 {
        let covered = free_ends::MAX_COVERED_EXTENSION * line.length_in_pixels();
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
        covering >= free_ends::MIN_COVERING_VIEWS
            && covering as f64 >= free_ends::MIN_COVERING_SHARE * line.views.len() as f64
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
        let shown: Vec<[f64; 2]> = prepared
            .index
            .near(&LineSegment2::new(start, end))
            .into_iter()
            .map(|segment| SegmentId { view, segment })
            .filter(|id| {
                on_line.segment_distance(&segment_of(self.views, *id).segment) <= self.max_miss
            })
            .filter_map(|id| shown_interval(self.views, id, &line.line))
            .collect();
        covered_length(shown, [low, high]) >= free_ends::MIN_COVERED_SHARE * (high - low)
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
