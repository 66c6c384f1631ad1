//! Creases that the wireframe lacks: where two planes of it meet, between corners at which both
//! have only one curve.
//!
//! A face ends where its plane meets the next one. Where images do not show that edge, or only a
//! piece of it, two corners are left at which a curve of either plane ends and none goes on. Between
//! two such corners, one after the other on the line in which the planes meet, an edge is inferred.
//! An edge that leads to such a corner and stops short of it is gone on with; one that runs past it
//! ends there. An edge that ends at nothing goes on to the next junction on its line that lacks an edge,
//! whatever lies between. Like any inferred line it costs nothing by itself, but wants two faces
//! (`selection.rs`).

use super::bounds::Bounds;
use super::curves::{Curve, Curves, sorted};
use super::face::CurveIndex;
use super::planes::CoplanarCurves;
use super::rulings::inferred_line;
use nalgebra::Vector3;
use neat_core::LineSegment3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Planes that meet at a smaller sine do not say where.
const MIN_SINE: f64 = 0.03;
/// Corners that are nearer to each other, in standard deviations of an arc, are one; what lies
/// beside a line within so many of a junction lies on it.
const REACH: f64 = 4.0;
/// At a corner of a solid at least so many curves end.
const CURVES_OF_CORNER: usize = 3;

/// The lines from the ends of edges that lead to nowhere to the nearest junction ahead of each on its
/// line, if that lacks an edge: an end that faces it, or a corner that it stops short of. Those first
/// that lead to where only one curve ends, and go on by the least part of their edge.
pub(super) fn continued_ends(curves: &Curves) -> Vec<Curve> {
    let mut corners = Corners::new(curves);
    let reach = REACH * curves.arc_sigma();
    let pieces: Vec<[usize; 2]> = (curves.observed())
        .filter_map(|curve| corners.free_end(curve))
        .collect();
    let mut continued: Vec<(usize, f64, [usize; 2])> = (pieces.par_iter())
        .filter_map(|piece| {
            let (part, next) = corners.ahead(*piece, reach)?;
            Some((corners.counts[&next], part, [piece[1], next]))
        })
        .collect();
    continued.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    let mut lines = Vec::new();
    for (_, _, [end, next]) in continued {
        if corners.counts[&end] == 1 && corners.counts[&next] < CURVES_OF_CORNER {
            lines.push(inferred_line(
                curves,
                [end, next].map(|junction| (junction, corners.points[&junction])),
            ));
            for junction in [end, next] {
                *corners.counts.entry(junction).or_default() += 1;
            }
        }
    }
    lines
}

/// What planes have with inferred creases.
pub(super) struct MissingCreases {
    /// In the order of their ends.
    pub lines: Vec<Curve>,
    /// For each plane the lines that it gains and the edges that these replace.
    pub changes: Vec<Change>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Change {
    pub gained: BTreeSet<CurveIndex>,
    pub replaced: BTreeSet<CurveIndex>,
}

/// The creases that are missing between planes, by their places.
pub(super) fn missing_creases(curves: &Curves, planes: &[CoplanarCurves]) -> MissingCreases {
    let corners = Corners::new(curves);
    let open: Vec<OpenCorners> = (planes.iter())
        .map(|plane| corners.open(curves, plane))
        .collect();
    let mut changes = vec![Change::default(); planes.len()];
    let mut lines: BTreeMap<CurveIndex, Curve> = BTreeMap::new();
    for (second, other) in planes.iter().enumerate() {
        for (first, one) in planes[..second].iter().enumerate() {
            let direction = one.normal.cross(&other.normal);
            if direction.norm() < MIN_SINE {
                continue;
            }
            let common = corners.on_both([one, other], [&open[first], &open[second]], curves);
            if common.len() < 2 {
                continue;
            }
            let in_both: Vec<&Curve> = (one.curves.iter())
                .filter(|place| other.curves.binary_search(place).is_ok())
                .map(|place| &curves.all[*place])
                .collect();
            let meet = Meeting {
                corners: &corners,
                curves,
                direction: direction.normalize(),
                in_both,
            };
            let (pairs, replaced) = meet.pairs(common);
            for ends in pairs {
                let points = ends.map(|end| corners.points[&end]);
                let line = inferred_line(curves, [(ends[0], points[0]), (ends[1], points[1])]);
                for plane in [first, second] {
                    changes[plane].gained.insert(line.index);
                    changes[plane].replaced.extend(&replaced);
                }
                lines.insert(line.index, line);
            }
        }
    }
    MissingCreases {
        lines: lines.into_values().collect(),
        changes,
    }
}

/// Where a plane lacks a curve.
struct OpenCorners {
    /// Where one of its curves ends and none goes on.
    of_curves: BTreeSet<usize>,
    /// Junctions of others in it that lack a curve.
    of_others: BTreeSet<usize>,
}

/// The ends of curves.
struct Corners {
    points: BTreeMap<usize, Vector3<f64>>,
    /// How many curves end at each.
    counts: BTreeMap<usize, usize>,
    joined: BTreeSet<[usize; 2]>,
    /// The direction of the only curve that ends at a junction, for straight edges.
    leading_to: BTreeMap<usize, Vector3<f64>>,
}

impl Corners {
    fn new(curves: &Curves) -> Self {
        let mut points = BTreeMap::new();
        let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
        let mut joined = BTreeSet::new();
        for curve in &curves.all {
            let Some([start, end]) = curve.ends else {
                continue;
            };
            let last = curve.points.len() - 1;
            points.extend([(start, curve.points[0]), (end, curve.points[last])]);
            for junction in [start, end] {
                *counts.entry(junction).or_default() += 1;
            }
            joined.insert(sorted([start, end]));
        }
        let mut corners = Self {
            points,
            counts,
            joined,
            leading_to: BTreeMap::new(),
        };
        let leading = curves.all.iter().filter_map(|curve| {
            let [start, end] = corners.free_end(curve)?;
            let along = corners.points[&end] - corners.points[&start];
            Some((end, along.normalize()))
        });
        corners.leading_to = leading.collect();
        corners
    }

    /// The nearest junction on the line of an edge beyond its second end, and how far that is, as a
    /// part of the edge. It is on the line within a reach beside it; one at which an edge ends that
    /// leads to nowhere, within another along that edge.
    fn ahead(&self, [start, end]: [usize; 2], reach: f64) -> Option<(f64, usize)> {
        let [from, to] = [start, end].map(|junction| self.points[&junction]);
        let others = (self.points.iter()).filter(|(junction, _)| {
            ![start, end].contains(junction) && !self.joined.contains(&sorted([start, **junction]))
        });
        let beyond = others.filter(|(junction, point)| {
            let aim = match self.leading_to.get(junction) {
                Some(other) => nearest_on(&LineSegment3::new(from, to), point, other, reach),
                None => **point,
            };
            let whole = LineSegment3::new(from, aim);
            (0.0..1.0).contains(&whole.line_parameter(&to))
                && whole.distance_to_point(&to) <= reach
                && LineSegment3::new(from, to).distance_to_line(&aim) <= reach
        });
        let part = |point: &Vector3<f64>| (point - to).norm() / (to - from).norm();
        (beyond.map(|(junction, point)| (part(point), *junction)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The end of a straight edge at which nothing else ends, after the other one.
    fn free_end(&self, curve: &Curve) -> Option<[usize; 2]> {
        let is_edge = matches!(curve.index, CurveIndex::Edge(_));
        let [start, end] = curve.ends.filter(|_| is_edge)?;
        match [start, end].map(|junction| self.counts[&junction] == 1) {
            [false, true] => Some([start, end]),
            [true, false] => Some([end, start]),
            _ => None,
        }
    }

    /// The junctions of a plane at which only one of its curves ends, but for edges that lead from
    /// there to nowhere; and those that lack an edge and lie in it, no farther from its curves than
    /// these are from each other.
    fn open(&self, curves: &Curves, plane: &CoplanarCurves) -> OpenCorners {
        let mut in_plane: BTreeMap<usize, usize> = BTreeMap::new();
        for curve in plane.curves.iter().map(|place| &curves.all[*place]) {
            let leads_away = self.free_end(curve).map(|[from, _]| from);
            for end in curve.ends.into_iter().flatten() {
                let count = in_plane.entry(end).or_default();
                *count += usize::from(leads_away != Some(end));
            }
        }
        let of_plane = plane.curves.iter().map(|place| &curves.all[*place].points);
        let around = Bounds::of(of_plane.flatten());
        let around = around.widened(around.extent());
        let reach = REACH * curves.arc_sigma();
        let lacking = self.points.iter().filter(|(junction, point)| {
            self.counts[junction] < CURVES_OF_CORNER
                && !in_plane.contains_key(junction)
                && (plane.normal.dot(point) - plane.offset).abs() <= reach
                && around.contain(point)
        });
        let lacking = lacking.map(|(junction, _)| *junction);
        let open = in_plane.iter().filter(|(_, count)| **count < 2);
        OpenCorners {
            of_curves: open.map(|(junction, _)| *junction).collect(),
            of_others: lacking.collect(),
        }
    }

    /// The corners that two planes lack on the line in which they meet, of which one at least has
    /// curves of both.
    fn on_both(
        &self,
        planes: [&CoplanarCurves; 2],
        open: [&OpenCorners; 2],
        curves: &Curves,
    ) -> Vec<usize> {
        let [one, other] = open;
        let of_curves: Vec<usize> =
            (one.of_curves.intersection(&other.of_curves).copied()).collect();
        let Some(first) = of_curves.first().map(|junction| self.points[junction]) else {
            return of_curves;
        };
        let direction = planes[0].normal.cross(&planes[1].normal).normalize();
        let reach = REACH * curves.arc_sigma();
        let is_own = |junction: &usize| {
            let from_first = self.points[junction] - first;
            let beside = from_first.cross(&direction).norm();
            let apart = of_curves.iter().all(|other| {
                direction
                    .dot(&(self.points[junction] - self.points[other]))
                    .abs()
                    > reach
            });
            beside <= reach && apart
        };
        let all = |open: &OpenCorners| &open.of_curves | &open.of_others;
        (all(one).intersection(&all(other)).copied())
            .filter(|junction| of_curves.contains(junction) || is_own(junction))
            .collect()
    }
}

/// The point on a line through `end` that is nearest to another line, at most so far from the end.
fn nearest_on(
    other: &LineSegment3,
    end: &Vector3<f64>,
    direction: &Vector3<f64>,
    most: f64,
) -> Vector3<f64> {
    let along = (other.end - other.start).normalize();
    let offset = other.start - end;
    let cosine = direction.dot(&along);
    let squared_sine = 1.0 - cosine * cosine;
    let place = (offset.dot(direction) - cosine * offset.dot(&along)) / squared_sine;
    // Parallel ones are everywhere as near.
    let place = if place.is_finite() { place } else { 0.0 };
    end + place.clamp(-most, most) * direction
}

/// The line in which two planes meet.
struct Meeting<'a> {
    corners: &'a Corners,
    curves: &'a Curves,
    direction: Vector3<f64>,
    /// The curves that lie in both.
    in_both: Vec<&'a Curve>,
}

impl Meeting<'_> {
    /// The pairs of junctions on it, the lower first, between which an edge is missing, and the
    /// edges that those replace.
    fn pairs(&self, mut open: Vec<usize>) -> (Vec<[usize; 2]>, BTreeSet<CurveIndex>) {
        let along = |junction: usize| self.direction.dot(&self.corners.points[&junction]);
        let reach = REACH * self.curves.arc_sigma();
        open.sort_by(|a, b| along(*a).total_cmp(&along(*b)));
        let mut pairs = BTreeSet::new();
        let mut replaced = BTreeSet::new();
        for curve in &self.in_both {
            let Some([from, to]) = self.corners.free_end(curve) else {
                continue;
            };
            let way = along(to) - along(from);
            let passed = |junction: &&usize| {
                let to_there = (along(**junction) - along(from)) * way.signum();
                **junction != from
                    && **junction != to
                    && (reach..way.abs() + reach).contains(&to_there)
            };
            let there = open.iter().filter(passed);
            let nearest = there.min_by(|a, b| {
                let [a, b] = [a, b].map(|junction| (along(**junction) - along(from)).abs());
                a.total_cmp(&b)
            });
            if let Some(nearest) = nearest.copied() {
                pairs.insert(sorted([from, nearest]));
                replaced.insert(curve.index);
                open.retain(|junction| ![from, to, nearest].contains(junction));
            }
        }
        for ends in open.windows(2) {
            if along(ends[1]) > along(ends[0]) {
                pairs.insert(sorted([ends[0], ends[1]]));
            }
        }
        pairs.retain(|ends| !self.corners.joined.contains(ends));
        (pairs.into_iter().collect(), replaced)
    }
}
