//! Edges are cut where arcs cross them: there is a junction, though no edge ends.

use super::arc_ends::AT_JUNCTION;
use super::arc_joints::crossing;
use super::circle_fitting::FoundArc;
use super::corners::WINDOW_IN_PIXELS;
use super::edge_cutting::MAX_GAP;
use super::edge_samples::Images;
use nalgebra::Vector3;
use neat_core::{LineSegment3, Wireframe3d};

/// Cuts the edges of a graph, each a piece of one of its `sources`.
pub(super) fn cut_at_arcs(
    images: &Images,
    wireframe: &mut Wireframe3d,
    sources: &mut Vec<Option<usize>>,
    arcs: &[FoundArc],
) {
    let Wireframe3d { junctions, edges } = wireframe;
    for k in 0..edges.len() {
        let [start, end] = edges[k];
        let edge = LineSegment3::new(junctions[start], junctions[end]);
        let mut cuts: Vec<f64> = Vec::new();
        for found in arcs {
            let margin = AT_JUNCTION * found.pixel / edge.length();
            for point in crossings(images, &edge, found) {
                let place = edge.line_parameter(&point);
                let is_apart =
                    (cuts.iter().chain(&[0.0, 1.0])).all(|other| (place - other).abs() > margin);
                if (0.0..1.0).contains(&place) && is_apart {
                    cuts.push(place);
                }
            }
        }
        cuts.sort_by(f64::total_cmp);
        let mut last = start;
        for place in cuts {
            let junction = junctions.len();
            junctions.push(edge.point_at(place));
            edges.push([last, junction]);
            sources.push(sources[k]);
            last = junction;
        }
        edges[k] = [last, end];
    }
}

/// Where an arc crosses the line of an edge, seen from both of its ends.
fn crossings(images: &Images, edge: &LineSegment3, found: &FoundArc) -> Vec<Vector3<f64>> {
    let gap = MAX_GAP * images.reach * found.pixel;
    let arc = &found.arc;
    let heights = edge.ends().map(|end| (end - arc.center).dot(&arc.normal()));
    let is_beside = heights.iter().all(|height| *height > gap)
        || heights.iter().all(|height| *height < -gap)
        || edge.distance_to_line(&arc.center) > arc.radius + gap;
    if is_beside {
        return Vec::new();
    }
    // An arc that hardly goes on from there meets the edge where both end.
    let least = WINDOW_IN_PIXELS * found.pixel / arc.radius;
    let goes_on = |point: &Vector3<f64>| {
        let angle = arc.angle_of(point);
        let holds = |by: f64| arc.contains(angle + by, 0.0);
        arc.is_closed() || (holds(-least) && holds(least))
    };
    let of_ends = [0, 1].map(|end| crossing(edge, end, found, gap));
    of_ends.into_iter().flatten().filter(goes_on).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::found;
    use crate::assemble::test_views::TestViews;
    use neat_core::CircularArc;
    use std::f64::consts::{FRAC_PI_2, TAU};

    /// The number of pieces of an edge along x, from -0.5 to 0.5, beside an arc around the origin.
    fn pieces(angles: [f64; 2], height: f64) -> usize {
        let cube = TestViews::of_cube(4);
        let arc = found(CircularArc {
            center: Vector3::new(0.0, 0.0, height),
            axes: [Vector3::x(), Vector3::y()],
            radius: 0.3,
            angles,
        });
        let mut wireframe = Wireframe3d {
            junctions: vec![[-0.5, 0.0, 0.0].into(), [0.5, 0.0, 0.0].into()],
            edges: vec![[0, 1]],
        };
        let mut sources = vec![Some(7)];
        cut_at_arcs(&cube.images(), &mut wireframe, &mut sources, &[arc]);
        assert_eq!(sources, vec![Some(7); wireframe.edges.len()]);
        for edge in &wireframe.edges {
            let [a, b] = edge.map(|junction| wireframe.junctions[junction].x);
            assert!(a < b);
        }
        wireframe.edges.len()
    }

    #[test]
    fn an_edge_is_cut_where_arcs_cross_it() {
        assert_eq!(pieces([0.0, TAU], 0.0), 3);
        assert_eq!(pieces([-1.0, 1.0], 0.0), 2);
        assert_eq!(pieces([0.0, FRAC_PI_2], 0.0), 1);
        assert_eq!(pieces([1.0, 2.0], 0.0), 1);
        assert_eq!(pieces([0.0, TAU], 0.1), 1);
    }
}
