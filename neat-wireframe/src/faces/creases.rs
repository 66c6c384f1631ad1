//! Creases that the wireframe lacks: where two planes of it meet, between corners at which both
//! have only one curve.
//!
//! A face ends where its plane meets the next one. Where images do not show that edge, or only a
//! piece of it, two corners are left at which a curve of either plane ends and none goes on. Between
//! two such corners, one after the other on the line in which the planes meet, an edge is inferred.
//! An edge that leads to such a corner and stops short of it is gone on with; one that runs past it
//! ends there. Two edges on one line that end facing each other are pieces of one, whatever lies
//! between. Like any inferred line it costs nothing by itself, but wants two faces
//! (`selection.rs`).

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

/// The lines between the ends of edges that lie on one line and face each other.
pub(super) fn facing_ends(curves: &Curves) -> Vec<Curve> {
    let corners = Corners::new(curves);
    let pieces: Vec<[usize; 2]> = (curves.observed())
        .filter_map(|curve| corners.free_end(curve))
        .collect();
    let at = |junction: usize| corners.points[&junction];
    let reach = REACH * curves.junction_sigma();
    // How far two ends are apart that face each other.
    let gap = |[a, b]: [usize; 2], [c, d]: [usize; 2]| {
        let whole = LineSegment3::new(at(a), at(c));
        let places = [b, d].map(|end| whole.line_parameter(&at(end)));
        let in_order = 0.0 < places[0] && places[0] < places[1] && places[1] < 1.0;
        let on_line = [b, d]
            .iter()
            .all(|end| whole.distance_to_point(&at(*end)) <= reach);
        (in_order && on_line).then(|| (at(b) - at(d)).norm())
    };
    let nearest = |one: usize| {
        let others = (0..pieces.len()).filter(|other| *other != one);
        let facing = others.filter_map(|other| Some((gap(pieces[one], pieces[other])?, other)));
        facing
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, other)| other)
    };
    let nearest: Vec<Option<usize>> = (0..pieces.len()).into_par_iter().map(nearest).collect();
    let mutual = (0..pieces.len()).filter_map(|one| {
        let other = nearest[one].filter(|other| *other > one && nearest[*other] == Some(one))?;
        let [a, b] = [one, other].map(|piece| pieces[piece][1]);
        Some(inferred_line(curves, [(a, at(a)), (b, at(b))]))
    });
    mutual.collect()
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
    let open: Vec<BTreeSet<usize>> = (planes.iter())
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
            let common: Vec<usize> = open[first].intersection(&open[second]).copied().collect();
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

/// The ends of curves.
struct Corners {
    points: BTreeMap<usize, Vector3<f64>>,
    /// How many curves end at each.
    counts: BTreeMap<usize, usize>,
    joined: BTreeSet<[usize; 2]>,
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
        Self {
            points,
            counts,
            joined,
        }
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
    /// there to nowhere.
    fn open(&self, curves: &Curves, plane: &CoplanarCurves) -> BTreeSet<usize> {
        let mut in_plane: BTreeMap<usize, usize> = BTreeMap::new();
        for curve in plane.curves.iter().map(|place| &curves.all[*place]) {
            let leads_away = self.free_end(curve).map(|[from, _]| from);
            for end in curve.ends.into_iter().flatten() {
                let count = in_plane.entry(end).or_default();
                *count += usize::from(leads_away != Some(end));
            }
        }
        let open = in_plane.into_iter().filter(|(_, count)| *count < 2);
        open.map(|(junction, _)| junction).collect()
    }
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
