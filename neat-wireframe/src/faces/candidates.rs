//! All faces that the curves might bound: the cells of planes, and cylinders and cones between two
//! rims, cells of these, and walls.

use super::cells::cells;
use super::creases::missing_creases;
use super::curves::{Curve, Curves, measured_points, sorted};
use super::face::{CurveIndex, Face, Step};
use super::plane_fit::{PlaneFit, PlaneFrame};
use super::planes::{CoplanarCurves, coplanar_curves};
use super::round_cells::round_cells;
use super::surface::Surface;
use super::walls::walls;
use nalgebra::Vector3;
use neat_core::CircularArc;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::FRAC_PI_4;

/// Rims of one cylinder or cone agree within so many standard deviations of an arc, of both
/// together: as one point of a thousand does not.
pub(super) const AGREEMENT: f64 = 3.29 * std::f64::consts::SQRT_2;

/// What is less of a circle may be a short arc.
const SHORT: f64 = FRAC_PI_4;

/// All curves, inferred ones among them, and faces with different boundaries, but for `caps`. None
/// knows its outer side yet. A face most of whose curves are inferred lines, and most of their length,
/// is a guess; caps and their rims have been shown.
pub(super) fn candidates(curves: Curves, caps: Vec<Face>) -> (Curves, Vec<Face>) {
    let planes = coplanar_curves(&curves);
    let missing = missing_creases(&curves, &planes);
    let observed: Vec<BTreeSet<CurveIndex>> = (planes.iter())
        .map(|plane| {
            plane
                .curves
                .iter()
                .map(|place| curves.all[*place].index)
                .collect()
        })
        .collect();
    let curves = curves.with_inferred(missing.lines);
    let mut known: BTreeSet<Vec<CurveIndex>> = BTreeSet::new();
    let mut faces = Vec::new();
    let faces_of = |plane: &CoplanarCurves, members: &BTreeSet<CurveIndex>| -> Vec<Face> {
        let frame = PlaneFrame::new(plane.normal, plane.offset);
        let members: Vec<&Curve> = members
            .iter()
            .filter_map(|curve| curves.find(*curve))
            .collect();
        let cells = cells(&curves, members, &frame).into_iter();
        cells
            .filter_map(|loops| planar_face(&curves, loops, &frame))
            .collect()
    };
    let mut planar = Vec::new();
    for ((plane, members), change) in planes.iter().zip(&observed).zip(&missing.changes) {
        planar.extend(faces_of(plane, members));
        if !change.gained.is_empty() {
            let with_gained = &(members | &change.gained) - &change.replaced;
            planar.extend(faces_of(plane, &with_gained));
        }
    }
    let is_seen = |face: &Face| {
        let curves = face.steps().filter_map(|step| curves.find(step.curve));
        let (inferred, seen): (Vec<&Curve>, Vec<&Curve>) =
            curves.partition(|curve| matches!(curve.index, CurveIndex::Smooth(_)));
        let length = |curves: &[&Curve]| curves.iter().map(|curve| curve.length()).sum::<f64>();
        inferred.len() <= seen.len() || length(&inferred) <= length(&seen)
    };
    let round = rims(&curves).into_iter().chain(round_cells(&curves));
    let all = planar.into_iter().chain(round).chain(walls(&curves));
    for face in all.filter(is_seen) {
        if known.insert(face.boundary()) {
            faces.push(face);
        }
    }
    // A lid may have the boundary of one.
    faces.extend(caps);
    (curves, faces)
}

/// The face in the plane of its own curves, if there is one that holds all of them.
fn planar_face(curves: &Curves, loops: Vec<Vec<Step>>, frame: &PlaneFrame) -> Option<Face> {
    let of_loops = loops
        .iter()
        .flatten()
        .filter_map(|step| curves.find(step.curve));
    let measured = of_loops.flat_map(|curve| &curve.measured);
    let fit = PlaneFit::through(measured.clone(), curves.extent)?;
    let plane = fit.solved()?;
    let (mut normal, mut offset) = plane.plane();
    if normal.dot(&frame.normal) < 0.0 {
        (normal, offset) = (-normal, -offset);
    }
    let holds = measured
        .clone()
        .all(|(point, covariance)| plane.holds(point, covariance));
    holds.then_some(Face {
        surface: Surface::Plane { normal, offset },
        loops,
    })
}

/// Cylinders and cones between two whole circles, or two arcs whose ends edges or inferred lines
/// join.
fn rims(curves: &Curves) -> Vec<Face> {
    let arcs: Vec<&Curve> = (curves.all.iter())
        .filter(|curve| curve.arc.is_some())
        .collect();
    let by_ends = straight_by_ends(curves);
    let pairs = (0..arcs.len()).flat_map(|i| (0..i).map(move |j| (j, i)));
    let face = |(i, j): (usize, usize)| {
        let rims = [arcs[i], arcs[j]];
        let surface = common_surface(curves, rims)?;
        let loops = loops_between(rims, &by_ends)?;
        Some(Face { surface, loops })
    };
    pairs.filter_map(face).collect()
}

/// Edges and inferred lines by their junctions, the lower first.
pub(super) fn straight_by_ends(curves: &Curves) -> BTreeMap<[usize; 2], &Curve> {
    (curves.all.iter())
        .filter(|curve| curve.is_straight())
        .filter_map(|edge| Some((sorted(edge.ends?), edge)))
        .collect()
}

/// The cylinder or cone on which both arcs are rims, with its normal away from the axis. Of a short
/// arc only its points are known, and its centre hardly: the longer one says where the axis is.
pub(super) fn common_surface(curves: &Curves, rims: [&Curve; 2]) -> Option<Surface> {
    let [a, b] = [rims[0].arc?, rims[1].arc?];
    let tolerance = AGREEMENT * curves.arc_sigma();
    let is_longer = a.length() >= b.length();
    let [a, b] = match [a, b].map(|arc| is_short(curves, &arc)) {
        [false, false] => [a, b],
        [false, true] => [a, around_axis(&b, &a, curves.arc_sigma())?],
        [true, true] if is_longer => [a, around_axis(&b, &a, curves.arc_sigma())?],
        [true, _] => [around_axis(&a, &b, curves.arc_sigma())?, b],
    };
    let between = b.center - a.center;
    let turned = b.normal() * a.normal().dot(&b.normal()).signum();
    let axis = (a.normal() + turned).normalize();
    let height = axis.dot(&between);
    let tilt = a.normal().cross(&b.normal()).norm();
    let coaxial = (between - axis * height).norm() <= tolerance
        && tilt * a.radius.min(b.radius) <= tolerance
        && height.abs() > tolerance;
    if !coaxial {
        return None;
    }
    let direction = between.normalize();
    let widens = b.radius - a.radius;
    Some(if widens.abs() <= tolerance {
        Surface::Cylinder {
            point: a.center,
            axis: direction,
            radius: 0.5 * (a.radius + b.radius),
            convex: true,
        }
    } else {
        let height = between.norm();
        Surface::Cone {
            apex: a.center - direction * (a.radius * height / widens),
            axis: direction * widens.signum(),
            half_angle: (widens.abs() / height).atan(),
            convex: true,
        }
    })
}

/// Whether points that are as uncertain as those of arcs leave the centre of an arc open, as it
/// rises hardly over its chord.
fn is_short(curves: &Curves, arc: &CircularArc) -> bool {
    let rise = arc.radius * (1.0 - (0.5 * arc.sweep()).cos());
    arc.sweep() < SHORT && rise < AGREEMENT * curves.arc_sigma()
}

/// The circle around the axis of another arc on which the points of a short one lie, if they do.
fn around_axis(short: &CircularArc, other: &CircularArc, sigma: f64) -> Option<CircularArc> {
    let axis = other.normal();
    let from_center = measured_points(short).map(|point| point - other.center);
    let places: Vec<[f64; 2]> = from_center
        .map(|from| {
            let height = axis.dot(&from);
            [height, (from - height * axis).norm()]
        })
        .collect();
    let mean = |k: usize| places.iter().map(|place| place[k]).sum::<f64>() / places.len() as f64;
    let [height, radius] = [mean(0), mean(1)];
    let is_near =
        |place: &[f64; 2]| (place[0] - height).abs().max((place[1] - radius).abs()) <= sigma;
    places.iter().all(is_near).then(|| CircularArc {
        center: other.center + height * axis,
        radius,
        ..*other
    })
}

/// Around the axis along the first rim and the other way along the second: in two loops of
/// circles, or in one that edges close.
fn loops_between(
    rims: [&Curve; 2],
    edges: &BTreeMap<[usize; 2], &Curve>,
) -> Option<Vec<Vec<Step>>> {
    let axis = rims[1].arc?.center - rims[0].arc?.center;
    let around = |curve: &Curve, axis: Vector3<f64>| {
        let reversed = curve.arc?.normal().dot(&axis) < 0.0;
        let ends = curve
            .ends
            .map(|[a, b]| if reversed { [b, a] } else { [a, b] });
        let curve = curve.index;
        Some((Step { curve, reversed }, ends))
    };
    let (first, ends) = around(rims[0], axis)?;
    let (second, other_ends) = around(rims[1], -axis)?;
    joined([(first, ends), (second, other_ends)], edges)
}

/// The loops of two rims, each with the junctions from which it runs and to which: of their own, or
/// one in which straight curves join them.
pub(super) fn joined(
    [(first, ends), (second, other_ends)]: [(Step, Option<[usize; 2]>); 2],
    edges: &BTreeMap<[usize; 2], &Curve>,
) -> Option<Vec<Vec<Step>>> {
    match (ends, other_ends) {
        (None, None) => Some(vec![vec![first], vec![second]]),
        (Some([a, b]), Some([c, d])) => {
            let edge = |from: usize, to: usize| {
                let edge = edges.get(&sorted([from, to]))?;
                Some(Step {
                    curve: edge.index,
                    reversed: edge.ends? != [from, to],
                })
            };
            Some(vec![vec![first, edge(b, c)?, second, edge(d, a)?]])
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_arc_is_around_the_axis_of_a_longer_one() {
        let longer = CircularArc {
            center: Vector3::zeros(),
            axes: [Vector3::x(), Vector3::y()],
            radius: 0.5,
            angles: [0.0, 3.0],
        };
        // Above it, a little too high in its middle, and with its end raised.
        let short = |off: f64, raised: f64| {
            let points = [(0.4, 0.0), (0.5, off), (0.6, 0.0)]
                .map(|(angle, off)| (1.0 + off / 0.5) * longer.point_at(angle) + Vector3::z());
            CircularArc::through([points[0], points[1], points[2] + raised * Vector3::z()]).unwrap()
        };
        let bowed = short(2e-3, 0.0);
        assert!(bowed.radius < 0.3, "{}", bowed.radius);
        let around = around_axis(&bowed, &longer, 3e-3).unwrap();
        assert!((around.radius - 0.5).abs() < 2e-3, "{}", around.radius);
        assert!((around.center - Vector3::z()).norm() < 1e-9);
        assert!(around_axis(&short(0.0, 0.02), &longer, 3e-3).is_none());
    }
}
