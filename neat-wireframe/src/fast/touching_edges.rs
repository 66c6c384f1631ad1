//! Edges that meet on their insides: split where a junction lies on them and
//! where they cross.
//!
//! Detections run through such places, so nothing before this step knows of them.
//! In the graph an edge that goes on and one that ends on it share a junction.

use super::cleanup::near_segment;
use crate::evidence::edge_support::SupportedEdge;
use crate::index::PointIndex;
use nalgebra::Vector3;
use neat_core::LineSegment3;
use std::collections::BTreeMap;

/// Junctions and edges closer than this to an edge touch it.
const TOUCH_DISTANCE: f64 = 0.004;
/// Parts shorter than this are not cut off.
const MIN_LENGTH: f64 = 0.02;
/// Sine of the angle between edges that cross, at least.
const MIN_SINE: f64 = 0.2;

/// Splits edges at the junctions that lie on their insides and at their mutual
/// crossings, which become junctions, appended to the given ones. Parts inherit
/// the evidence of the whole; of equal parts the best supported stays.
///
/// # Panics
/// If an edge names a junction that does not exist.
pub fn split_touching_edges(
    junctions: &[Vector3<f64>],
    edges: &[SupportedEdge],
) -> (Vec<Vector3<f64>>, Vec<SupportedEdge>) {
    let mut junctions = junctions.to_vec();
    let segments: Vec<LineSegment3> = edges
        .iter()
        .map(|edge| LineSegment3::new(junctions[edge.junctions[0]], junctions[edge.junctions[1]]))
        .collect();
    let index = PointIndex::new(junctions.clone());
    // On every edge its cuts: where, and at which junction.
    let mut cuts: Vec<Vec<(f64, usize)>> = segments
        .iter()
        .zip(edges)
        .map(|(segment, edge)| junctions_inside(segment, edge, &junctions, &index))
        .collect();
    for [a, b] in overlapping_boxes(&segments, TOUCH_DISTANCE) {
        let Some([t, u]) = crossing(&segments[a], &segments[b]) else {
            continue;
        };
        let cut_near = |edge: usize, place: f64| {
            let near =
                |cut: &&(f64, usize)| (cut.0 - place).abs() * segments[edge].length() < MIN_LENGTH;
            cuts[edge].iter().find(near).map(|cut| cut.1)
        };
        match (cut_near(a, t), cut_near(b, u)) {
            (None, None) => {
                let junction = junctions.len();
                junctions.push((segments[a].point_at(t) + segments[b].point_at(u)) / 2.0);
                cuts[a].push((t, junction));
                cuts[b].push((u, junction));
            }
            (Some(_), Some(_)) => {}
            // A third edge has made a junction here already, on one of the two.
            (Some(junction), None) => {
                let cut = cut_at(&segments[b], &edges[b], &cuts[b], junction, &junctions);
                cuts[b].extend(cut);
            }
            (None, Some(junction)) => {
                let cut = cut_at(&segments[a], &edges[a], &cuts[a], junction, &junctions);
                cuts[a].extend(cut);
            }
        }
    }
    let mut by_pair: BTreeMap<[usize; 2], SupportedEdge> = BTreeMap::new();
    for (edge, mut cuts) in edges.iter().zip(cuts) {
        cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [start, end] = edge.junctions;
        let mut from = start;
        for to in cuts.iter().map(|cut| cut.1).chain([end]) {
            let part = SupportedEdge {
                junctions: [from.min(to), from.max(to)],
                ..*edge
            };
            by_pair
                .entry(part.junctions)
                .and_modify(|present| {
                    if part.support > present.support {
                        *present = part;
                    }
                })
                .or_insert(part);
            from = to;
        }
    }
    (junctions, by_pair.into_values().collect())
}

/// The cut of an edge at a junction, if the junction touches its inside and does not
/// end or cut it already.
fn cut_at(
    segment: &LineSegment3,
    edge: &SupportedEdge,
    cuts: &[(f64, usize)],
    junction: usize,
    junctions: &[Vector3<f64>],
) -> Option<(f64, usize)> {
    let is_new = !edge.junctions.contains(&junction) && cuts.iter().all(|cut| cut.1 != junction);
    let place = place_inside(segment, &junctions[junction]);
    place.filter(|_| is_new).map(|place| (place, junction))
}

/// Where a point touches the inside of a segment.
fn place_inside(segment: &LineSegment3, point: &Vector3<f64>) -> Option<f64> {
    let margin = MIN_LENGTH / segment.length();
    let place = segment.line_parameter(point);
    let touches = (segment.point_at(place) - point).norm() < TOUCH_DISTANCE;
    (touches && place > margin && place < 1.0 - margin).then_some(place)
}

/// The junctions that touch the inside of an edge, with their place on it, at
/// least the smallest length apart.
fn junctions_inside(
    segment: &LineSegment3,
    edge: &SupportedEdge,
    junctions: &[Vector3<f64>],
    index: &PointIndex<3>,
) -> Vec<(f64, usize)> {
    let margin = MIN_LENGTH / segment.length();
    let mut inside: Vec<(f64, usize)> = near_segment(segment, index, TOUCH_DISTANCE)
        .into_iter()
        .filter(|junction| !edge.junctions.contains(junction))
        .filter_map(|junction| Some((place_inside(segment, &junctions[junction])?, junction)))
        .collect();
    inside.sort_by(|a, b| a.0.total_cmp(&b.0));
    inside.dedup_by(|later, earlier| later.0 - earlier.0 < margin);
    inside
}

/// Where two edges touch, as places on each, if both are inside and the edges
/// are not nearly parallel.
fn crossing(a: &LineSegment3, b: &LineSegment3) -> Option<[f64; 2]> {
    let (along_a, along_b) = (a.end - a.start, b.end - b.start);
    let normal = along_a.cross(&along_b);
    let squared_norm = normal.norm_squared();
    if squared_norm <= (MIN_SINE * along_a.norm() * along_b.norm()).powi(2) {
        return None;
    }
    let between = b.start - a.start;
    let t = between.cross(&along_b).dot(&normal) / squared_norm;
    let u = between.cross(&along_a).dot(&normal) / squared_norm;
    let inside = |place: f64, along: &Vector3<f64>| {
        let margin = MIN_LENGTH / along.norm();
        place > margin && place < 1.0 - margin
    };
    let touch = (a.point_at(t) - b.point_at(u)).norm() < TOUCH_DISTANCE;
    (touch && inside(t, &along_a) && inside(u, &along_b)).then_some([t, u])
}

/// The pairs of segments whose boxes, grown by `margin`, overlap: a sweep along
/// the first axis.
fn overlapping_boxes(segments: &[LineSegment3], margin: f64) -> Vec<[usize; 2]> {
    let boxes: Vec<[Vector3<f64>; 2]> = segments
        .iter()
        .map(|segment| {
            let grown = Vector3::repeat(margin / 2.0);
            [
                segment.start.inf(&segment.end) - grown,
                segment.start.sup(&segment.end) + grown,
            ]
        })
        .collect();
    let mut order: Vec<usize> = (0..segments.len()).collect();
    order.sort_by(|a, b| boxes[*a][0].x.total_cmp(&boxes[*b][0].x));
    let mut pairs = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    for current in order {
        let [low, high] = &boxes[current];
        open.retain(|other| boxes[*other][1].x >= low.x);
        for &other in &open {
            let [other_low, other_high] = &boxes[other];
            let overlap = (1..3).all(|k| other_low[k] <= high[k] && low[k] <= other_high[k]);
            if overlap {
                pairs.push([current.min(other), current.max(other)]);
            }
        }
        open.push(current);
    }
    pairs.sort_unstable();
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edge(a: usize, b: usize, support: usize) -> SupportedEdge {
        SupportedEdge {
            junctions: [a, b],
            support,
            visible_views: Some(20),
        }
    }

    fn at(x: f64, y: f64, z: f64) -> Vector3<f64> {
        Vector3::new(x, y, z)
    }

    fn split(junctions: &[Vector3<f64>], edges: &[SupportedEdge]) -> Split {
        let (junctions, edges) = split_touching_edges(junctions, edges);
        let edges = edges.iter().map(|e| (e.junctions, e.support)).collect();
        (junctions, edges)
    }

    /// Junctions, and the edges with their support.
    type Split = (Vec<Vector3<f64>>, Vec<([usize; 2], usize)>);

    #[test]
    fn a_crossing_becomes_a_junction_of_four_edges() {
        let junctions = [
            at(-1.0, 0.0, 0.0),
            at(1.0, 0.0, 0.0),
            at(0.2, -1.0, 0.002),
            at(0.2, 1.0, 0.002),
        ];
        let (split, edges) = split(&junctions, &[edge(0, 1, 7), edge(2, 3, 9)]);
        assert_eq!(split.len(), 5);
        assert!((split[4] - at(0.2, 0.0, 0.001)).norm() < 1e-12);
        assert_eq!(edges, [([0, 4], 7), ([1, 4], 7), ([2, 4], 9), ([3, 4], 9)]);
    }

    #[test]
    fn edges_that_pass_each_other_or_run_alongside_stay() {
        let junctions = [
            at(-1.0, 0.0, 0.0),
            at(1.0, 0.0, 0.0),
            at(0.2, -1.0, 0.01),
            at(0.2, 1.0, 0.01),
            at(-1.0, -0.05, 0.0),
            at(1.0, 0.05, 0.0),
        ];
        let edges = [edge(0, 1, 7), edge(2, 3, 9), edge(4, 5, 8)];
        let (kept, split) = split(&junctions[..4], &edges[..2]);
        assert_eq!((kept.len(), split.len()), (4, 2));
        // Lines under three degrees.
        let (kept, split) = super::tests::split(&junctions, &[edges[0], edges[2]]);
        assert_eq!((kept.len(), split.len()), (6, 2));
    }

    #[test]
    fn an_edge_splits_where_others_end_on_it() {
        let junctions = [
            at(-1.0, 0.0, 0.0),
            at(1.0, 0.0, 0.0),
            at(0.5, 0.001, 0.0),
            at(0.5, 1.0, 0.0),
            at(-0.5, 0.0, 0.001),
            at(-0.5, 0.0, 1.0),
        ];
        let edges = [edge(0, 1, 7), edge(2, 3, 9), edge(4, 5, 8), edge(0, 4, 2)];
        let (split, edges) = split(&junctions, &edges);
        assert_eq!(split, junctions);
        assert_eq!(
            edges,
            [
                ([0, 4], 7),
                ([1, 2], 7),
                ([2, 3], 9),
                ([2, 4], 7),
                ([4, 5], 8)
            ]
        );
    }

    #[test]
    fn three_edges_through_one_place_share_its_junction() {
        let direction = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            at(cos, sin, 0.0)
        };
        let junctions: Vec<_> = [0.0, 60.0, 120.0]
            .iter()
            .flat_map(|angle| [direction(*angle), -direction(*angle)])
            .collect();
        let (split, edges) = split(&junctions, &[edge(0, 1, 5), edge(2, 3, 5), edge(4, 5, 5)]);
        assert_eq!(split.len(), 7);
        assert_eq!(edges.len(), 6);
        assert!(edges.iter().all(|(pair, _)| pair[1] == 6));
    }

    #[test]
    fn three_edges_that_cross_in_a_small_triangle_make_no_loops() {
        // Sides of 0.015, 0.015 and 0.025: less than a part may be long.
        let corners = [
            at(0.0, 0.0, 0.0),
            at(0.025, 0.0, 0.0),
            at(0.0125, 0.0083, 0.0),
        ];
        let through = |a: Vector3<f64>, b: Vector3<f64>| {
            let along = (b - a).normalize();
            [a - 0.5 * along, b + 0.5 * along]
        };
        let lines = [
            through(corners[0], corners[1]),
            through(corners[1], corners[2]),
            through(corners[2], corners[0]),
        ];
        for order in [
            [0, 1, 2],
            [0, 2, 1],
            [1, 0, 2],
            [1, 2, 0],
            [2, 0, 1],
            [2, 1, 0],
        ] {
            let junctions: Vec<_> = order.iter().flat_map(|line| lines[*line]).collect();
            let (split, edges) = split(&junctions, &[edge(0, 1, 5), edge(2, 3, 5), edge(4, 5, 5)]);
            assert!(edges.iter().all(|([a, b], _)| a < b), "{edges:?}");
            // Every junction that cuts an edge lies on it.
            for ([a, b], _) in &edges {
                let part = LineSegment3::new(split[*a], split[*b]);
                let off = |line: &[Vector3<f64>; 2]| {
                    let whole = LineSegment3::new(line[0], line[1]);
                    let distances = part.ends().map(|end| whole.distance_to_line(&end));
                    distances[0].max(distances[1])
                };
                assert!(lines.iter().any(|line| off(line) < 0.004));
            }
        }
    }

    #[test]
    fn nothing_is_cut_near_the_ends_or_off_nothing() {
        let junctions = [
            at(0.0, 0.0, 0.0),
            at(1.0, 0.0, 0.0),
            at(0.01, 0.0, 0.0),
            at(0.01, 1.0, 0.0),
        ];
        let (_, edges) = split(&junctions, &[edge(0, 1, 5), edge(2, 3, 6)]);
        assert_eq!(edges, [([0, 1], 5), ([2, 3], 6)]);
        assert_eq!(split(&[], &[]), (Vec::new(), Vec::new()));
    }
}
