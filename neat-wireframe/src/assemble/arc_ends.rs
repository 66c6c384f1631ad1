//! Where arcs end: at junctions of the graph, or nowhere, as whole circles.
//!
//! Edgels say within a sector where an arc ends, and nothing where it is hidden. But curves end
//! where others do. So an end of an arc moves along its circle to a junction near it; an edge that
//! goes on from there as a chord of the circle, within what edgels tell, is a part of the arc; and
//! of the pieces between junctions those are left out that hardly any edgel shows. A circle without
//! a junction on it is closed if the rest of it is shown.

use super::arc_joints::{OF_WHOLE, wrapped};
use super::circle_fitting::{FoundArc, SECTOR_IN_PIXELS};
use super::corners::{MAX_GAP, WINDOW_IN_PIXELS};
use super::curved_edges::CurvedEdge;
use super::edge_cutting::retain_edges;
use super::edge_samples::Images;
use nalgebra::Vector3;
use neat_core::Wireframe3d;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

/// An end at which nothing else ends is as likely as an edge that no face is beside, 1 in 20: in
/// nats.
pub(super) const OPEN_END: f64 = 3.0;
/// An end within so many pixels of a junction is there, as for 2D segments.
pub(super) const AT_JUNCTION: f64 = 5.0;
/// Arcs of a smaller radius, in pixels, stay as they are: any short edge beside them would be a
/// chord.
pub(super) const MIN_RADIUS: f64 = SECTOR_IN_PIXELS;
/// What goes past a junction to where nothing ends is shown by at least this share of what the best
/// piece is, judged: a line that touches the arc there leaves it slowly.
const PAST_JUNCTION: f64 = 0.3;

/// Ends the arcs at the junctions of edges, straight and curved ones. Edges that are parts of arcs
/// are taken away; `sources` belong to the straight ones.
pub(super) fn end_at_junctions(
    images: &Images,
    wireframe: &mut Wireframe3d,
    sources: &mut Vec<Option<usize>>,
    curved: &mut Vec<CurvedEdge>,
    arcs: &mut Vec<FoundArc>,
) {
    let Wireframe3d { junctions, edges } = wireframe;
    let points_of = |ends: [usize; 2], middle: Option<Vector3<f64>>| {
        let [a, b] = ends.map(|end| junctions[end]);
        [a, middle.unwrap_or(0.5 * (a + b)), b]
    };
    let straight = edges.iter().map(|ends| points_of(*ends, None));
    let bowed = (curved.iter()).map(|edge| points_of(edge.ends, Some(edge.middle)));
    let mut parts: Vec<Option<[Vector3<f64>; 3]>> = straight.chain(bowed).map(Some).collect();
    let is_small = |found: &FoundArc| found.arc.radius < MIN_RADIUS * found.pixel;
    for found in arcs.iter_mut().filter(|found| !is_small(found)) {
        absorb(images, &mut parts, found);
    }
    let mut left = parts.iter().map(Option::is_some);
    let kept: Vec<bool> = left.by_ref().take(edges.len()).collect();
    retain_edges(&kept, edges, sources);
    curved.retain(|_| left.next() == Some(true));
    let junctions = junctions_of_edges(wireframe, curved);
    let ended = arcs.par_iter().map(|found| {
        if is_small(found) {
            return vec![found.clone()];
        }
        let ended = Ends::new(images, found, &junctions).moved();
        Ends::new(images, &ended, &junctions).without_gaps()
    });
    *arcs = ended.flatten_iter().collect();
}

/// The junctions at which edges end, straight and curved ones.
pub(super) fn junctions_of_edges(
    wireframe: &Wireframe3d,
    curved: &[CurvedEdge],
) -> Vec<Vector3<f64>> {
    let of_curves = curved.iter().flat_map(|edge| edge.ends);
    let of_edges = wireframe.edges.iter().flatten().copied();
    let used: BTreeSet<usize> = of_edges.chain(of_curves).collect();
    used.iter().map(|j| wireframe.junctions[*j]).collect()
}

/// Takes the edges, each by its start, middle and end, that lie on the circle of an arc and along
/// it, and lengthens the arc by those that go on from its ends.
fn absorb(images: &Images, parts: &mut [Option<[Vector3<f64>; 3]>], found: &mut FoundArc) {
    let arc = &mut found.arc;
    let near = AT_JUNCTION * found.pixel / arc.radius;
    let gap = MAX_GAP * images.reach * found.pixel;
    let mut grown = true;
    while grown && !arc.is_closed() {
        grown = false;
        for part in parts.iter_mut() {
            let Some(points) = part
                .filter(|points| (points.iter()).all(|point| arc.distance_to_circle(point) <= gap))
            else {
                continue;
            };
            let [a, middle, b] = points.map(|point| arc.angle_of(&point));
            let (from, to) = match [a, b].map(|angle| arc.contains(angle, near)) {
                [false, false] => continue,
                [true, false] => (a, b),
                [false, true] => (b, a),
                [true, true] => {
                    if !arc.contains(middle, 0.0) {
                        arc.angles[1] = arc.angles[0] + TAU;
                    }
                    *part = None;
                    continue;
                }
            };
            let end = usize::from(wrapped(to - from) > 0.0);
            arc.angles[end] += wrapped(to - arc.angles[end]);
            (*part, grown) = (None, true);
        }
        if arc.sweep() + near >= TAU {
            arc.angles[1] = arc.angles[0] + TAU;
        }
    }
}

/// An arc with the angles of the junctions on its circle, from its start on, ascending.
struct Ends<'a> {
    images: &'a Images<'a>,
    found: &'a FoundArc,
    stations: Vec<f64>,
}

impl<'a> Ends<'a> {
    fn new(images: &'a Images<'a>, found: &'a FoundArc, junctions: &[Vector3<f64>]) -> Self {
        let arc = &found.arc;
        let gap = MAX_GAP * images.reach * found.pixel;
        let on_circle = (junctions.iter()).filter(|j| arc.distance_to_circle(j) <= gap);
        let mut stations: Vec<f64> = on_circle
            .map(|j| arc.angles[0] + (arc.angle_of(j) - arc.angles[0]).rem_euclid(TAU))
            .collect();
        stations.sort_by(f64::total_cmp);
        Self {
            images,
            found,
            stations,
        }
    }

    /// The arc with its ends moved.
    fn moved(&self) -> FoundArc {
        let mut ended = self.found.clone();
        let arc = &self.found.arc;
        let [start, end] = arc.angles;
        if arc.is_closed() {
            return ended;
        }
        if self.stations.is_empty() {
            let rest = [end, start + TAU];
            let rate = self.gain(arc.angles) / arc.sweep();
            if arc.sweep() > PI && self.gain(rest) >= OF_WHOLE * rate * (rest[1] - rest[0]) {
                ended.arc.angles = [start, start + TAU];
            }
            return ended;
        }
        let mut moved = [start, end];
        for (k, sign) in [(0, -1.0), (1, 1.0)] {
            moved[k] += sign * self.to_junction(arc.angles[k], sign);
        }
        if (1e-9..=TAU).contains(&(moved[1] - moved[0])) {
            ended.arc.angles = moved;
        }
        ended
    }

    /// How far outward along the circle an end goes to the junction that costs least: none where
    /// it is at one, or where images say too much against all.
    fn to_junction(&self, from: f64, sign: f64) -> f64 {
        let arc = &self.found.arc;
        let in_pixels = |by: f64| by.abs() * arc.radius / self.found.pixel;
        let ways = self
            .stations
            .iter()
            .map(|station| sign * wrapped(station - from));
        let near = ways.filter(|by| in_pixels(*by) <= WINDOW_IN_PIXELS);
        let costs = near.map(|by| {
            let to = from + sign * by;
            let cost = if in_pixels(by) <= AT_JUNCTION {
                0.0
            } else {
                let gain = self.gain([from.min(to), from.max(to)]);
                if by > 0.0 { -gain } else { gain }
            };
            (cost, by)
        });
        let order = |a: &(f64, f64), b: &(f64, f64)| {
            a.0.total_cmp(&b.0).then(a.1.abs().total_cmp(&b.1.abs()))
        };
        let best = costs.min_by(order).filter(|(cost, _)| *cost < OPEN_END);
        best.map_or(0.0, |(_, by)| by)
    }

    /// What is left of the arc without the pieces between junctions that images do not show.
    fn without_gaps(&self) -> Vec<FoundArc> {
        let arc = &self.found.arc;
        let near = AT_JUNCTION * self.found.pixel / arc.radius;
        let [mut start, mut end] = arc.angles;
        if let (true, Some(first)) = (arc.is_closed(), self.stations.first()) {
            [start, end] = [*first, first + TAU];
        }
        let turned = self.stations.iter().flat_map(|at| [*at, at + TAU]);
        let mut bounds: Vec<f64> = turned
            .filter(|angle| (start + near..end - near).contains(angle))
            .collect();
        bounds.sort_by(f64::total_cmp);
        bounds.insert(0, start);
        bounds.push(end);
        let gains: Vec<([f64; 2], f64)> = (bounds.windows(2))
            .map(|ends| [ends[0], ends[1]])
            .map(|ends| (ends, self.gain(ends)))
            .collect();
        let rates = gains.iter().map(|([from, to], gain)| gain / (to - from));
        let best = rates.fold(0.0, f64::max);
        let ends_at_one = |angle: f64| {
            let mut off = (self.stations.iter()).map(|station| wrapped(station - angle).abs());
            off.any(|off| off <= near)
        };
        let is_there = |([from, to], gain): &([f64; 2], f64)| {
            let goes_past = !(ends_at_one(*from) && ends_at_one(*to)) && bounds.len() > 2;
            let share = if goes_past { PAST_JUNCTION } else { OF_WHOLE };
            *gain >= share * best * (to - from)
        };
        if gains.iter().all(is_there) {
            return vec![self.found.clone()];
        }
        let mut left: Vec<([f64; 2], f64)> = Vec::new();
        for (angles, gain) in gains.into_iter().filter(is_there) {
            match left.last_mut() {
                Some((last, sum)) if last[1] == angles[0] => {
                    last[1] = angles[1];
                    *sum += gain;
                }
                _ => left.push((angles, gain)),
            }
        }
        // Around a circle the last piece goes on in the first.
        if let [(first, _), .., (last, _)] = &left[..]
            && arc.is_closed()
            && (last[1] - TAU - first[0]).abs() < 1e-9
        {
            let (last, gain) = left.pop().unwrap_or_default();
            left[0].0[0] = last[0] - TAU;
            left[0].1 += gain;
        }
        let piece = |(angles, gain): ([f64; 2], f64)| {
            let mut piece = self.found.clone();
            piece.arc.angles = angles;
            piece.gain = gain;
            let middle = |sector: &[f64; 2]| 0.5 * (sector[0] + sector[1]);
            piece.sectors.retain(|sector| {
                let off = (middle(&sector.angles) - angles[0]).rem_euclid(TAU);
                off <= angles[1] - angles[0]
            });
            piece
        };
        left.into_iter().map(piece).collect()
    }

    /// What the images say for a part of the circle.
    fn gain(&self, angles: [f64; 2]) -> f64 {
        (self.images).gain_along(&self.found.arc, angles, self.found.pixel, None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::{arc, found, views_of_arcs};
    use crate::assemble::test_views::TestViews;
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use std::cell::Cell;

    /// The angles of what is left of an arc, and how many edges, where an edge leaves the circle
    /// at some angles, and others are chords of it.
    fn ended(
        views: &TestViews,
        angles: [f64; 2],
        leaving: &[f64],
        chords: &[[f64; 2]],
    ) -> (Vec<[f64; 2]>, usize) {
        let mut arcs = vec![found(arc(1.0))];
        arcs[0].arc.angles = angles;
        let circle = arcs[0].arc;
        let mut wireframe = Wireframe3d::default();
        let ends = leaving.iter().map(|angle| {
            let on_circle = circle.point_at(*angle);
            [on_circle, on_circle + 0.2 * circle.toward(*angle)]
        });
        let of_chords = chords
            .iter()
            .map(|ends| ends.map(|end| circle.point_at(end)));
        for ends in ends.chain(of_chords) {
            let first = wireframe.junctions.len();
            wireframe.junctions.extend(ends);
            wireframe.edges.push([first, first + 1]);
        }
        let mut sources = vec![None; wireframe.edges.len()];
        let (images, mut curved) = (views.images(), Vec::new());
        end_at_junctions(
            &images,
            &mut wireframe,
            &mut sources,
            &mut curved,
            &mut arcs,
        );
        assert_eq!(sources.len(), wireframe.edges.len());
        let left = arcs.iter().map(|found| found.arc.angles).collect();
        (left, wireframe.edges.len())
    }

    fn assert_near(found: &[[f64; 2]], expected: &[[f64; 2]]) {
        let near = |(a, b): (&[f64; 2], &[f64; 2])| (0..2).all(|k| (a[k] - b[k]).abs() < 1e-6);
        let same = found.len() == expected.len() && found.iter().zip(expected).all(near);
        assert!(same, "{found:?}, not {expected:?}");
    }

    #[test]
    fn ends_come_to_junctions_and_take_in_chords() {
        let views = views_of_arcs(20, |_| arc(1.5));
        let (angles, edges) = ended(&views, [0.04, 1.46], &[0.0, 1.5], &[]);
        assert_near(&angles, &[[0.0, 1.5]]);
        assert_eq!(edges, 2);
        // A junction far away is none of its ends.
        let (angles, _) = ended(&views, [0.0, 1.5], &[0.0, 2.0], &[]);
        assert_near(&angles, &[[0.0, 1.5]]);
        // A chord goes on from its end, another lies along it.
        let (angles, edges) = ended(&views, [0.0, 1.35], &[0.0, 1.5], &[[1.5, 1.36], [0.4, 0.5]]);
        assert_near(&angles, &[[0.0, 1.5]]);
        assert_eq!(edges, 2);
    }

    #[test]
    fn pieces_that_nothing_shows_are_left_out() {
        let (mut points, mut edges) = (Vec::new(), Vec::new());
        for [from, to] in [[0.0, 1.0], [2.0, 3.0]] {
            let mut part = arc(1.0);
            part.angles = [from, to];
            let first = points.len();
            points.extend(part.points(0.05));
            edges.extend((first + 1..points.len()).map(|k| [k - 1, k]));
        }
        let seen = views_of_edges(&cameras_on_sphere(20), &points, &edges);
        let views = (seen.iter()).map(|view| PreparedView::new(view, 1.0, 0.0));
        let views = TestViews::of(views.collect());
        let (angles, _) = ended(&views, [0.0, 3.0], &[1.0, 2.0], &[]);
        assert_near(&angles, &[[0.0, 1.0], [2.0, 3.0]]);
        // Of a whole circle what is left may run over its start.
        let (angles, _) = ended(&views, [0.5, 0.5 + TAU], &[0.0, 1.0, 2.0, 3.0], &[]);
        let mut angles: Vec<[f64; 2]> = (angles.into_iter())
            .map(|ends| ends.map(|end| end.rem_euclid(TAU)))
            .collect();
        angles.sort_by(|a, b| a[1].total_cmp(&b[1]));
        assert!(
            angles.len() == 2 && (angles[0][1] - 1.0).abs() < 1e-6,
            "{angles:?}"
        );
        assert!((angles[1][0] - 2.0).abs() < 1e-6 && (angles[1][1] - 3.0).abs() < 1e-6);
    }

    #[test]
    fn what_few_views_show_beyond_a_junction_ends_at_another_one_or_is_none() {
        let view = Cell::new(0);
        let views = views_of_arcs(20, |_| {
            view.set(view.get() + 1);
            arc(if view.get() % 5 == 0 { 1.5 } else { 1.0 })
        });
        assert_near(&ended(&views, [0.0, 1.5], &[1.0], &[]).0, &[[0.0, 1.0]]);
        let (angles, _) = ended(&views, [0.0, 1.5], &[0.0, 1.0, 1.5], &[]);
        assert_near(&angles, &[[0.0, 1.5]]);
    }

    #[test]
    fn circles_close_where_the_rest_is_shown() {
        let whole = views_of_arcs(20, |_| arc(TAU));
        assert_near(&ended(&whole, [0.0, 5.0], &[], &[]).0, &[[0.0, TAU]]);
        let open = views_of_arcs(20, |_| arc(5.0));
        assert_near(&ended(&open, [0.0, 5.0], &[], &[]).0, &[[0.0, 5.0]]);
    }
}
