//! Edges that no image shows from end to end, but a solid has: where two of its faces meet.
//!
//! A closed shell knows more than the wireframe that it was found in: where two faces meet in a line
//! that was inferred (`creases.rs`), there is an edge. With the pieces of it that images show it is one
//! edge, from corner to corner. A sheet proves nothing of the kind, and a line along which a face goes
//! on as another one without a crease is no edge.

use super::curves::{Curve, Curves, MeasuredGraph, sorted};
use super::face::{CurveIndex, Shell};
use super::geometry::ShellGeometry;
use super::groups::groups;
use crate::Wireframe3d;
use nalgebra::Vector3;
use neat_core::LineSegment3;
use std::collections::{BTreeMap, BTreeSet};

/// Cosine of the angle up to which a face goes on as another one, as for inferred lines: 10°.
const SMOOTH: f64 = 0.985;
/// What lies beside an edge within so many standard deviations of an arc lies on it.
const REACH: f64 = 4.0;
/// Along it lies what has so much beside it, of the shorter one.
const OVERLAP: f64 = 0.5;

/// A wireframe with what its solids add.
#[derive(Clone, Debug, PartialEq)]
pub struct Completed {
    /// Edges `[a, b]`, a < b, sorted.
    pub wireframe: Wireframe3d,
    /// For each edge those of the wireframe before that it is, or that are pieces of it, ascending;
    /// none if no image shows it.
    pub sources: Vec<Vec<usize>>,
}

impl Completed {
    /// Whether no image shows an edge, of each.
    pub fn inferred(&self) -> impl Iterator<Item = bool> {
        self.sources.iter().map(Vec::is_empty)
    }
}

/// The wireframe with all straight edges of its closed shells, the corners between which they are
/// inferred where the faces meet; `None` if it has them already. Edges that lead beside one of these to
/// nowhere are gone.
pub fn completed(graph: &MeasuredGraph, shells: &[Shell]) -> Option<Completed> {
    let curves = Curves::new(graph);
    let closed: Vec<&Shell> = shells.iter().filter(|shell| shell.closed).collect();
    let counts = curves_at(&curves, &closed);
    let whole: Vec<WholeEdge> = (closed.iter())
        .flat_map(|shell| whole_edges(graph, &curves, shell, &counts))
        .collect();
    if whole.is_empty() {
        return None;
    }
    let mut junctions = graph.wireframe.junctions.clone();
    let mut sources: BTreeMap<[usize; 2], BTreeSet<usize>> = BTreeMap::new();
    for edge in &whole {
        for (end, corner) in edge.ends.iter().zip(edge.corners) {
            junctions[*end] = corner;
        }
        let of_edge = sources.entry(sorted(edge.ends)).or_default();
        of_edge.extend(&edge.pieces);
    }
    for (piece, edge) in pieces_beside(&curves, shells, &whole) {
        sources
            .entry(sorted(whole[edge].ends))
            .or_default()
            .insert(piece);
    }
    let gone: BTreeSet<usize> = sources.values().flatten().copied().collect();
    for (index, ends) in graph.wireframe.edges.iter().enumerate() {
        if !gone.contains(&index) {
            sources.entry(sorted(*ends)).or_default().insert(index);
        }
    }
    let of_curves = curves.observed().filter(|curve| !curve.is_straight());
    let mut used: BTreeSet<usize> = of_curves.filter_map(|curve| curve.ends).flatten().collect();
    used.extend(sources.keys().flatten());
    // Those that had no edge before belong to something else.
    let had_one: BTreeSet<usize> = graph.wireframe.edges.iter().flatten().copied().collect();
    let stays = |junction: &usize| used.contains(junction) || !had_one.contains(junction);
    let kept: Vec<usize> = (0..junctions.len()).filter(stays).collect();
    let renamed = |ends: [usize; 2]| ends.map(|end| kept.partition_point(|other| *other < end));
    let (edges, sources): (Vec<[usize; 2]>, Vec<Vec<usize>>) = (sources.into_iter())
        .map(|(ends, sources)| (renamed(ends), sources.into_iter().collect()))
        .unzip();
    let junctions = kept.iter().map(|junction| junctions[*junction]).collect();
    Some(Completed {
        wireframe: Wireframe3d { junctions, edges },
        sources,
    })
}

/// The edges at which two faces of a closed shell meet at an angle, whatever images say of their light.
pub fn creases_of_solids(wireframe: &Wireframe3d, shells: &[Shell]) -> BTreeSet<usize> {
    let closed = shells.iter().filter(|shell| shell.closed);
    let lines = closed.flat_map(|shell| lines(wireframe, shell));
    lines
        .filter(|line| line.is_crease)
        .filter_map(|line| line.edge)
        .collect()
}

/// An edge of which at least a piece is inferred.
struct WholeEdge {
    ends: [usize; 2],
    /// Where its ends are in the exact geometry of the shell.
    corners: [Vector3<f64>; 2],
    /// The observed edges that are pieces of it.
    pieces: Vec<usize>,
}

/// A straight curve of a shell.
struct Line {
    ends: [usize; 2],
    /// The edge, if it is one, and no inferred line.
    edge: Option<usize>,
    faces: [usize; 2],
    /// Whether these are known to meet at an angle.
    is_crease: bool,
}

/// How many curves end at each junction: those that images show, and those that closed shells have
/// beside them.
fn curves_at(curves: &Curves, closed: &[&Shell]) -> BTreeMap<usize, usize> {
    let of_shells: BTreeSet<CurveIndex> = closed.iter().flat_map(|shell| shell.curves()).collect();
    let inferred = of_shells.iter().filter_map(|curve| match curve {
        CurveIndex::Smooth(ends) => Some(*ends),
        _ => None,
    });
    let observed = curves.observed().filter_map(|curve| curve.ends);
    let mut counts = BTreeMap::new();
    for end in observed.chain(inferred).flatten() {
        *counts.entry(end).or_default() += 1;
    }
    counts
}

/// The edges of a closed shell that are inferred, or of which a piece is.
fn whole_edges(
    graph: &MeasuredGraph,
    curves: &Curves,
    shell: &Shell,
    counts: &BTreeMap<usize, usize>,
) -> Vec<WholeEdge> {
    let lines = lines(graph.wireframe, shell);
    if lines.iter().all(|line| line.edge.is_some()) {
        return Vec::new();
    }
    let reach = REACH * curves.arc_sigma();
    let goes_on = |[one, other]: [usize; 2], junction: usize| {
        let far = [one, other].map(|place| lines[place].ends.iter().find(|end| **end != junction));
        let points = &graph.wireframe.junctions;
        Option::zip(far[0], far[1]).is_some_and(|(a, b)| {
            LineSegment3::new(points[*a], points[*b]).distance_to_point(&points[junction]) <= reach
        })
    };
    let mut at_junction: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (place, line) in lines.iter().enumerate() {
        for end in line.ends {
            at_junction.entry(end).or_default().push(place);
        }
    }
    // Nothing but two pieces of one edge meets where it is known in part.
    let mut joined: Vec<Vec<usize>> = (0..lines.len()).map(|place| vec![place]).collect();
    for (junction, places) in &at_junction {
        if let [one, other] = places[..]
            && counts[junction] == 2
            && lines[one].faces == lines[other].faces
            && (lines[one].edge.is_none() || lines[other].edge.is_none())
            && goes_on([one, other], *junction)
        {
            joined.push(vec![one, other]);
        }
    }
    let geometry = ShellGeometry::new(shell, graph);
    let whole = |group: Vec<usize>| {
        let pieces: Vec<usize> = group
            .iter()
            .filter_map(|place| lines[*place].edge)
            .collect();
        let mut ends: BTreeMap<usize, usize> = BTreeMap::new();
        for end in group.iter().flat_map(|place| lines[*place].ends) {
            *ends.entry(end).or_default() += 1;
        }
        let open: Vec<usize> = (ends.into_iter())
            .filter_map(|(end, count)| (count == 1).then_some(end))
            .collect();
        let ends: [usize; 2] = open.try_into().ok()?;
        let is_inferred = pieces.len() < group.len();
        is_inferred.then(|| WholeEdge {
            ends,
            corners: ends.map(|end| geometry.vertices[&end]),
            pieces,
        })
    };
    groups(&joined).into_iter().filter_map(whole).collect()
}

/// The straight curves of a closed shell at which its faces form an edge.
fn lines(wireframe: &Wireframe3d, shell: &Shell) -> Vec<Line> {
    let mut faces_of: BTreeMap<CurveIndex, Vec<usize>> = BTreeMap::new();
    for (place, face) in shell.faces.iter().enumerate() {
        for step in face.steps() {
            faces_of.entry(step.curve).or_default().push(place);
        }
    }
    let line = |(curve, faces): (CurveIndex, Vec<usize>)| {
        let (ends, edge) = match curve {
            CurveIndex::Edge(edge) => (wireframe.edges[edge], Some(edge)),
            CurveIndex::Smooth(ends) => (ends, None),
            _ => return None,
        };
        let faces: [usize; 2] = faces.try_into().ok()?;
        let [from, to] = ends.map(|end| wireframe.junctions[end]);
        let middle = 0.5 * (from + to);
        let normals = faces.map(|face| shell.faces[face].surface.normal_at(&middle));
        // A patch or a wall does not say how it lies there.
        let is_known = normals.iter().all(|normal| *normal != Vector3::zeros());
        let is_crease = is_known && normals[0].dot(&normals[1]) <= SMOOTH;
        (edge.is_some() || is_crease).then_some(Line {
            ends,
            edge,
            faces,
            is_crease,
        })
    };
    faces_of.into_iter().filter_map(line).collect()
}

/// The observed edges that bound no face and lead along a whole one to nowhere, each with the place of
/// the first such.
fn pieces_beside(curves: &Curves, shells: &[Shell], whole: &[WholeEdge]) -> Vec<(usize, usize)> {
    let of_shells: BTreeSet<CurveIndex> = shells.iter().flat_map(Shell::curves).collect();
    let reach = REACH * curves.arc_sigma();
    let counts = curves_at(curves, &[]);
    let is_loose = |curve: &Curve| {
        let ends = curve.ends.unwrap_or_default();
        !of_shells.contains(&curve.index) && ends.iter().any(|end| counts[end] == 1)
    };
    let is_beside = |curve: &Curve, edge: &WholeEdge| {
        let line = LineSegment3::new(edge.corners[0], edge.corners[1]);
        let [from, to] = [curve.points[0], curve.points[1]];
        let places = [from, to].map(|point| line.line_parameter(&point));
        let [low, high] = [places[0].min(places[1]), places[0].max(places[1])];
        let cosine = (to - from)
            .normalize()
            .dot(&(line.end - line.start).normalize());
        cosine.abs() >= SMOOTH
            && [from, to]
                .iter()
                .all(|point| line.distance_to_line(point) <= reach)
            && high.min(1.0) - low.max(0.0) >= OVERLAP * (high - low).min(1.0)
    };
    let beside = |curve: &Curve| {
        let CurveIndex::Edge(index) = curve.index else {
            return None;
        };
        let first = || whole.iter().position(|edge| is_beside(curve, edge));
        is_loose(curve)
            .then(first)
            .flatten()
            .map(|edge| (index, edge))
    };
    curves.observed().filter_map(beside).collect()
}
