//! Arcs divided where edges end on them.
//!
//! Where an edge ends on a rim, the faces on its two sides are bounded by other pieces of that. The
//! assembler has each arc as a whole, as many of the lines beside it turn out to be none.

use super::curves::{Curves, MeasuredGraph, REACH};
use nalgebra::Vector3;
use neat_core::CircularArc;
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// A junction is on an arc within so many standard deviations of a junction: of 33 of edges on arcs of
/// random parts 29 are ends of true curves, and the others are farther off than most of these, judged.
const ON_ARC: f64 = 3.0;

/// The pieces of the arcs between the junctions of edges on them, each with the index of the arc it is
/// of, ascending. An arc without any between its ends is one piece, and so is a circle with one.
pub fn divided_arcs(graph: &MeasuredGraph) -> Vec<(usize, CircularArc)> {
    let curves = Curves::new(graph);
    let junctions = &graph.wireframe.junctions;
    let of_edges: BTreeSet<usize> = graph.wireframe.edges.iter().flatten().copied().collect();
    let corners: Vec<Vector3<f64>> = of_edges.iter().map(|corner| junctions[*corner]).collect();
    let pieces = graph.arcs.iter().enumerate().flat_map(|(index, arc)| {
        let pieces = divided(arc, &corners, &curves).into_iter();
        pieces.map(move |piece| (index, piece))
    });
    pieces.collect()
}

fn divided(arc: &CircularArc, corners: &[Vector3<f64>], curves: &Curves) -> Vec<CircularArc> {
    // What is nearer to an end of an arc is that end.
    let near = REACH * curves.arc_sigma() / arc.radius;
    let [start, end] = arc.angles;
    let on_arc = (corners.iter())
        .filter(|corner| arc.distance_to_circle(corner) <= ON_ARC * curves.junction_sigma())
        .map(|corner| start + (arc.angle_of(corner) - start).rem_euclid(TAU));
    let mut cuts: Vec<f64> = if arc.is_closed() {
        on_arc.collect()
    } else {
        let within = start + near..end - near;
        on_arc.filter(|angle| within.contains(angle)).collect()
    };
    cuts.sort_by(f64::total_cmp);
    cuts.dedup_by(|next, angle| *next - *angle <= near);
    let bounds: Vec<f64> = match (arc.is_closed(), cuts.first().copied()) {
        (true, Some(first)) => {
            // At its start the circle goes on.
            cuts.retain(|angle| first + TAU - angle > near);
            cuts.into_iter().chain([first + TAU]).collect()
        }
        _ => [start].into_iter().chain(cuts).chain([end]).collect(),
    };
    if arc.is_closed() && bounds.len() == 2 {
        return vec![*arc];
    }
    let piece = |ends: &[f64]| CircularArc {
        angles: [ends[0], ends[1]],
        ..*arc
    };
    bounds.windows(2).map(piece).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::Wireframe3d;

    /// Pieces of an arc of radius 1 with spokes that end on it at these angles, as degrees.
    fn pieces(angles: [f64; 2], spokes: &[f64]) -> Vec<[i64; 2]> {
        let arc = CircularArc {
            center: Vector3::zeros(),
            axes: [Vector3::x(), Vector3::y()],
            radius: 1.0,
            angles: angles.map(f64::to_radians),
        };
        let mut junctions = vec![Vector3::zeros()];
        junctions.extend(spokes.iter().map(|spoke| arc.point_at(spoke.to_radians())));
        // One that no edge ends at, and one beside the arc.
        junctions.push(arc.point_at(0.2));
        junctions.push(1.01 * arc.point_at(0.3));
        let last = junctions.len() - 1;
        let edges = (1..=spokes.len()).chain([last]).map(|end| [0, end]);
        let wireframe = Wireframe3d {
            junctions,
            edges: edges.collect(),
        };
        let arcs = [arc];
        let graph = MeasuredGraph {
            arcs: &arcs,
            ..MeasuredGraph::of(&wireframe)
        };
        let degrees = |angle: f64| angle.to_degrees().round() as i64;
        let pieces = divided_arcs(&graph).into_iter();
        pieces.map(|(_, arc)| arc.angles.map(degrees)).collect()
    }

    #[test]
    fn arcs_are_divided_where_edges_end() {
        let half = [0.0, 180.0];
        assert_eq!(pieces(half, &[0.0, 180.0]), [[0, 180]]);
        assert_eq!(pieces(half, &[50.0, 270.0]), [[0, 50], [50, 180]]);
        assert_eq!(pieces(half, &[90.0, 50.0]), [[0, 50], [50, 90], [90, 180]]);
        // At its end.
        assert_eq!(pieces(half, &[179.0]), [[0, 180]]);
    }

    #[test]
    fn circles_are_divided_where_two_edges_end() {
        let circle = [0.0, 360.0];
        assert_eq!(pieces(circle, &[]), [[0, 360]]);
        assert_eq!(pieces(circle, &[70.0]), [[0, 360]]);
        assert_eq!(pieces(circle, &[300.0, 70.0]), [[70, 300], [300, 430]]);
        // At one place.
        assert_eq!(pieces(circle, &[70.0, 70.5]), [[0, 360]]);
        assert_eq!(pieces(circle, &[0.2, 359.8]), [[0, 360]]);
    }
}
