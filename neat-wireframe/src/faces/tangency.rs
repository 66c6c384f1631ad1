//! Lines where a cylinder or a cone goes on without a crease: no image shows them, but faces end
//! there.
//!
//! Two arcs are its rims, and from an end of each a curve goes on in the same direction: between
//! these two ends it touches the next surface. Such a line is inferred. It costs
//! nothing by itself, but wants a face on both sides like any other (`selection.rs`).

use super::candidates::common_surface;
use super::curves::{Curve, Curves};
use super::face::CurveIndex;
use super::surface::Surface;
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};

/// Sine of the angle by which a curve that goes on may turn: 10°.
const MAX_TURN: f64 = 0.174;
/// The line runs along the surface within so many standard deviations of an arc.
const REACH: f64 = 4.0;

/// The inferred lines between ends of arcs that no curve joins yet, in the order of their ends.
pub(super) fn smooth_lines(curves: &Curves) -> Vec<Curve> {
    let joined: BTreeSet<[usize; 2]> = (curves.all.iter())
        .filter_map(|curve| curve.ends.map(sorted))
        .collect();
    let leaving = Leaving::new(curves);
    let arcs: Vec<&Curve> = (curves.all.iter())
        .filter(|curve| curve.arc.is_some() && curve.ends.is_some())
        .collect();
    let mut lines: BTreeMap<CurveIndex, Curve> = BTreeMap::new();
    for (k, one) in arcs.iter().enumerate() {
        for other in &arcs[..k] {
            let Some(surface) = common_surface(curves, [one, other]) else {
                continue;
            };
            for ends in pairs_of_ends(curves, [one, other], &surface) {
                let goes_on = leaving.goes_on(one, ends[0].0) && leaving.goes_on(other, ends[1].0);
                if goes_on && !joined.contains(&sorted(ends.map(|(junction, _)| junction))) {
                    let line = inferred_line(curves, ends);
                    lines.insert(line.index, line);
                }
            }
        }
    }
    lines.into_values().collect()
}

/// A junction and where it is.
type End = (usize, Vector3<f64>);

/// An end of each of two rims, for those at the same angle around the axis.
fn pairs_of_ends(curves: &Curves, rims: [&Curve; 2], surface: &Surface) -> Vec<[End; 2]> {
    let reach = REACH * curves.arc_sigma();
    let ends = |rim: &Curve| -> Vec<End> {
        let last = rim.points.len() - 1;
        let points = [rim.points[0], rim.points[last]];
        rim.ends.into_iter().flatten().zip(points).collect()
    };
    let mut pairs = Vec::new();
    let Some((origin, axis)) = surface.axis() else {
        return pairs;
    };
    for (a, from) in ends(rims[0]) {
        for (b, to) in ends(rims[1]) {
            let [start, end] = [from, to].map(|p| p - origin);
            let [low, high] = [start, end].map(|offset| offset - axis * axis.dot(&offset));
            let (turn, side) = (low.cross(&high).dot(&axis), low.dot(&high));
            let beside = turn.atan2(side).abs() * low.norm().max(high.norm());
            if a != b && beside <= reach && axis.dot(&(end - start)).abs() > reach {
                pairs.push([(a, from), (b, to)]);
            }
        }
    }
    pairs
}

/// Between two junctions; known as well as arcs are.
pub(super) fn inferred_line(curves: &Curves, mut ends: [End; 2]) -> Curve {
    ends.sort_by_key(|(junction, _)| *junction);
    let junctions = ends.map(|(junction, _)| junction);
    Curve {
        index: CurveIndex::Smooth(junctions),
        ends: Some(junctions),
        points: ends.map(|(_, point)| point).to_vec(),
        measured: ends
            .map(|(_, point)| (point, curves.arc_covariance()))
            .to_vec(),
        arc: None,
    }
}

/// The directions in which curves leave each junction.
struct Leaving(BTreeMap<usize, Vec<(CurveIndex, Vector3<f64>)>>);

impl Leaving {
    fn new(curves: &Curves) -> Self {
        let mut leaving: BTreeMap<usize, Vec<(CurveIndex, Vector3<f64>)>> = BTreeMap::new();
        for curve in &curves.all {
            let Some([start, end]) = curve.ends else {
                continue;
            };
            let last = curve.points.len() - 1;
            let directions = match &curve.arc {
                Some(arc) => [
                    arc.tangent_at(arc.angles[0]),
                    -arc.tangent_at(arc.angles[1]),
                ],
                None => {
                    let along = (curve.points[last] - curve.points[0]).normalize();
                    [along, -along]
                }
            };
            for (junction, direction) in [start, end].into_iter().zip(directions) {
                leaving
                    .entry(junction)
                    .or_default()
                    .push((curve.index, direction));
            }
        }
        Self(leaving)
    }

    /// Whether at this end of a curve another one goes on in its direction.
    fn goes_on(&self, curve: &Curve, junction: usize) -> bool {
        let here = self.0.get(&junction).map_or(&[][..], Vec::as_slice);
        let own = here.iter().find(|(index, _)| *index == curve.index);
        own.is_some_and(|(_, own)| {
            here.iter().any(|(index, other)| {
                *index != curve.index && own.dot(other) < 0.0 && own.cross(other).norm() <= MAX_TURN
            })
        })
    }
}

fn sorted([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}
