//! Lines along cylinders and cones between ends of their rims, where no curve is.
//!
//! Two arcs are rims of one surface, and an end of each lies at the same angle around its axis.
//! Between these two ends a line is inferred if from both of them a curve goes on in the direction
//! of the arc, as then the surface touches the next one there without a crease, which no image
//! shows; or if a piece of it is an edge that leads from one of them to nowhere. It costs nothing
//! by itself, but wants a face on both sides like any other (`selection.rs`).

use super::candidates::common_surface;
use super::curves::{Curve, Curves, sorted};
use super::face::CurveIndex;
use super::surface::Surface;
use nalgebra::Vector3;
use neat_core::LineSegment3;
use std::collections::{BTreeMap, BTreeSet};

/// Sine of the angle by which a curve that goes on may turn: 10°.
const MAX_TURN: f64 = 0.174;
/// The line runs along the surface within so many standard deviations of an arc.
const REACH: f64 = 4.0;

/// The inferred lines between ends of arcs that no curve joins yet, in the order of their ends.
pub(super) fn missing_rulings(curves: &Curves) -> Vec<Curve> {
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
                let is_sought =
                    goes_on || leaving.begins(ends) || leaving.begins([ends[1], ends[0]]);
                if is_sought && !joined.contains(&sorted(ends.map(|(junction, _)| junction))) {
                    let line = inferred_line(curves, ends);
                    lines.insert(line.index, line);
                }
            }
        }
    }
    shortest(lines.into_values().collect(), REACH * curves.arc_sigma())
}

/// Those on which no other one ends that begins with them: three rims of one cylinder are joined one
/// after the other.
fn shortest(lines: Vec<Curve>, reach: f64) -> Vec<Curve> {
    let ends = |line: &Curve| line.ends.unwrap_or_default();
    let mut of_end: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (place, line) in lines.iter().enumerate() {
        for end in ends(line) {
            of_end.entry(end).or_default().push(place);
        }
    }
    let is_passed = |line: &Curve| {
        let whole = LineSegment3::new(line.points[0], line.points[1]);
        let beside = ends(line).into_iter().flat_map(|end| &of_end[&end]);
        beside.map(|place| &lines[*place]).any(|other| {
            let new =
                (other.points.iter().zip(ends(other))).find(|(_, end)| !ends(line).contains(end));
            new.is_some_and(|(point, _)| {
                (0.0..1.0).contains(&whole.line_parameter(point))
                    && whole.distance_to_point(point) <= reach
            })
        })
    };
    let passed: Vec<bool> = lines.iter().map(is_passed).collect();
    let kept = lines.into_iter().zip(passed).filter(|(_, passed)| !passed);
    kept.map(|(line, _)| line).collect()
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
struct Leaving(BTreeMap<usize, Vec<Departure>>);

/// How a curve leaves a junction.
struct Departure {
    curve: CurveIndex,
    direction: Vector3<f64>,
    /// The other junction at which it ends.
    to: usize,
}

impl Leaving {
    fn new(curves: &Curves) -> Self {
        let mut leaving: BTreeMap<usize, Vec<Departure>> = BTreeMap::new();
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
                    let points = &curve.points;
                    let ends = [points[1] - points[0], points[last - 1] - points[last]];
                    ends.map(|along| along.normalize())
                }
            };
            for (junction, direction) in [start, end].into_iter().zip(directions) {
                leaving.entry(junction).or_default().push(Departure {
                    curve: curve.index,
                    direction,
                    to: start + end - junction,
                });
            }
        }
        Self(leaving)
    }

    /// Whether at this end of a curve another one goes on in its direction.
    fn goes_on(&self, curve: &Curve, junction: usize) -> bool {
        let here = self.0.get(&junction).map_or(&[][..], Vec::as_slice);
        let own = here.iter().find(|other| other.curve == curve.index);
        own.is_some_and(|own| {
            here.iter().any(|other| {
                other.curve != curve.index
                    && own.direction.dot(&other.direction) < 0.0
                    && own.direction.cross(&other.direction).norm() <= MAX_TURN
            })
        })
    }

    /// Whether an edge leads from the first end toward the second one, and to nowhere.
    fn begins(&self, [(from, start), (_, end)]: [End; 2]) -> bool {
        let toward = (end - start).normalize();
        let here = self.0.get(&from).map_or(&[][..], Vec::as_slice);
        here.iter().any(|edge| {
            matches!(edge.curve, CurveIndex::Edge(_))
                && self.0.get(&edge.to).is_some_and(|there| there.len() == 1)
                && edge.direction.dot(&toward) > 0.0
                && edge.direction.cross(&toward).norm() <= MAX_TURN
        })
    }
}
