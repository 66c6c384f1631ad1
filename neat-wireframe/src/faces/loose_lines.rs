//! Lines on solids that lead nowhere.
//!
//! An edge of a solid ends where others do. A line that ends where nothing else does is a piece of one,
//! or it is something else on a face: paint, an outline that several views agree on by chance. The
//! face cannot be told from what else lies along it; but if a solid closes only without such lines,
//! those on its faces are none of its edges.

use super::curves::{Curve, Curves, MeasuredGraph};
use super::face::{CurveIndex, Shell};
use super::region::Region;
use crate::used_junctions::UsedJunctions;
use nalgebra::{Matrix3, Vector3};
use neat_core::Wireframe3d;
use std::collections::{BTreeMap, BTreeSet};

/// A line lies on a face within so many standard deviations of an arc.
const REACH: f64 = 4.0;
/// The places of a line at which that is asked.
const PLACES: [f64; 3] = [0.1, 0.5, 0.9];

/// The edges that end where nothing else does and lie on faces of solids, if more faces bound solids
/// without all edges that end so. `find` is to give the shells of a graph, as it gave `shells` for
/// this one.
pub fn loose_lines_on_solids(
    graph: &MeasuredGraph,
    shells: &[Shell],
    find: impl Fn(&MeasuredGraph) -> Vec<Shell>,
) -> BTreeSet<usize> {
    let curves = Curves::new(graph);
    let loose = loose_edges(&curves);
    if loose.is_empty() || shells.iter().all(|shell| shell.closed) {
        return BTreeSet::new();
    }
    let (wireframe, covariances) = without(graph, &loose);
    let rest = MeasuredGraph {
        wireframe: &wireframe,
        covariances: &covariances,
        ..*graph
    };
    let without_them = find(&rest);
    if closed_faces(&without_them) <= closed_faces(shells) {
        return BTreeSet::new();
    }
    let of_rest = Curves::new(&rest);
    let closed = without_them.iter().filter(|shell| shell.closed);
    let faces: Vec<_> = (closed.flat_map(|shell| &shell.faces))
        .filter_map(|face| Some((face, Region::new(&of_rest, face)?)))
        .collect();
    let reach = REACH * curves.arc_sigma();
    let on_solid = |point: Vector3<f64>| {
        faces.iter().any(|(face, region)| {
            let across = reach * face.surface.normal_at(&point);
            region.is_between(&(point - across), &(point + across))
        })
    };
    let junctions = &graph.wireframe.junctions;
    let lies_on_solid = |edge: &usize| {
        let [from, to] = graph.wireframe.edges[*edge].map(|end| junctions[end]);
        PLACES
            .iter()
            .all(|place| on_solid(from + (to - from) * *place))
    };
    loose.into_iter().filter(lies_on_solid).collect()
}

/// How many faces bound solids.
pub fn closed_faces(shells: &[Shell]) -> usize {
    let closed = shells.iter().filter(|shell| shell.closed);
    closed.map(|shell| shell.faces.len()).sum()
}

/// The edges with an end at which no other curve ends.
fn loose_edges(curves: &Curves) -> BTreeSet<usize> {
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    for end in curves.observed().filter_map(|curve| curve.ends).flatten() {
        *counts.entry(end).or_default() += 1;
    }
    let is_loose = |curve: &Curve| {
        curve
            .ends
            .into_iter()
            .flatten()
            .any(|end| counts[&end] == 1)
    };
    (curves.observed().filter(|curve| is_loose(curve)))
        .filter_map(|curve| match curve.index {
            CurveIndex::Edge(edge) => Some(edge),
            _ => None,
        })
        .collect()
}

/// A wireframe without some edges and the junctions that only they had, and the covariances of the others.
fn without(
    graph: &MeasuredGraph,
    gone: &BTreeSet<usize>,
) -> (Wireframe3d, Vec<Option<Matrix3<f64>>>) {
    let Wireframe3d { junctions, edges } = graph.wireframe;
    let left: Vec<[usize; 2]> = (edges.iter().enumerate())
        .filter(|(edge, _)| !gone.contains(edge))
        .map(|(_, ends)| *ends)
        .collect();
    let had_one: BTreeSet<usize> = edges.iter().flatten().copied().collect();
    // Those of arcs and splines.
    let others: Vec<[usize; 2]> = (0..junctions.len())
        .filter(|junction| !had_one.contains(junction))
        .map(|junction| [junction; 2])
        .collect();
    let used = UsedJunctions::new(junctions.len(), left.iter().chain(&others));
    let (mut junctions, mut covariances) = (junctions.clone(), graph.covariances.to_vec());
    used.retain(&mut junctions);
    if !covariances.is_empty() {
        used.retain(&mut covariances);
    }
    let edges = left.into_iter().map(|edge| used.renamed(edge)).collect();
    (Wireframe3d { junctions, edges }, covariances)
}

#[cfg(test)]
mod tests {
    use super::super::find_shells;
    use super::super::tests::{Model, WHOLE};
    use super::*;

    const HEIGHT: f64 = 1.0;
    const RADIUS: f64 = 0.4;

    /// A cylinder with a line between two points, each by its angle and height on the wall.
    fn with_line(radius: f64, ends: [[f64; 2]; 2]) -> Model {
        let mut model = Model::default().circle([0.0; 3], RADIUS, WHOLE).circle(
            [0.0, 0.0, HEIGHT],
            RADIUS,
            WHOLE,
        );
        let point = |[angle, height]: [f64; 2]| {
            let (sine, cosine) = angle.sin_cos();
            Vector3::new(radius * cosine, radius * sine, height)
        };
        model.wireframe.junctions = ends.map(point).to_vec();
        model.wireframe.edges = vec![[0, 1]];
        model
    }

    fn lines_of(model: &Model) -> Vec<usize> {
        let find = |graph: &MeasuredGraph| find_shells(graph, &[], &[]);
        let graph = model.graph();
        let lines = loose_lines_on_solids(&graph, &find(&graph), find);
        lines.into_iter().collect()
    }

    #[test]
    fn a_line_on_the_wall_of_a_cylinder_is_no_edge() {
        let on_wall = with_line(RADIUS, [[0.3, 0.2], [0.3, 0.8]]);
        assert_eq!(lines_of(&on_wall), [0]);
        // A little off it, as outlines are that few views agree on.
        assert_eq!(
            lines_of(&with_line(1.01 * RADIUS, [[0.3, 0.2], [0.3, 0.8]])),
            [0]
        );
    }

    #[test]
    fn a_line_that_is_on_no_solid_stays() {
        // It hinders nothing.
        let beside = with_line(2.0 * RADIUS, [[0.3, 0.2], [0.3, 0.8]]);
        assert!(lines_of(&beside).is_empty());
        // Without it the cylinder closes no better: a rim is missing.
        let mut open = with_line(RADIUS, [[0.3, 0.2], [0.3, 0.8]]);
        open.arcs.truncate(1);
        assert!(lines_of(&open).is_empty());
        // Of two lines only the one on the cylinder goes.
        let mut both = with_line(RADIUS, [[0.3, 0.2], [0.3, 0.8]]);
        both.wireframe
            .junctions
            .extend([Vector3::new(1.0, 0.0, 0.0), Vector3::new(1.0, 0.5, 0.0)]);
        both.wireframe.edges.push([2, 3]);
        assert_eq!(lines_of(&both), [0]);
    }
}
