//! The exact geometry of walls between two splines: one is the other, moved along the wall.

use super::face::{CurveIndex, Face, Step};
use super::geometry::{FINE, ShellCurve};
use super::quadrature::{GAUSS, place_and_derivative};
use super::surface::Surface;
use super::walls::{FLAT, opposite};
use nalgebra::Vector3;
use neat_core::Spline;
use std::collections::BTreeMap;

/// Moves one spline of a wall to where the other one is, along the wall, in the plane of its other
/// face: the second one, if both or none lie in such a plane. Both begin beside each other then, and
/// run alike or against each other as before.
pub(super) fn extrude(
    face: &Face,
    curves: &mut BTreeMap<CurveIndex, ShellCurve>,
    surfaces_of: &BTreeMap<CurveIndex, Vec<Surface>>,
) {
    let (Surface::Extruded { direction }, Some([one, other])) = (face.surface, face.rims()) else {
        return;
    };
    let plane = |step: &Step| {
        let planes = surfaces_of[&step.curve].iter();
        let mut planes = planes.filter_map(|surface| match surface {
            Surface::Plane { normal, offset } => Some((*normal, *offset)),
            _ => None,
        });
        planes.find(|(normal, _)| normal.dot(&direction).abs() > FLAT)
    };
    let (still, moving, plane) = match (plane(&one), plane(&other)) {
        (Some(plane), None) => (other, one, Some(plane)),
        (_, plane) => (one, other, plane),
    };
    let spline = |step: &Step| curves.get(&step.curve)?.spline.clone();
    let (Some(from), Some(to)) = (spline(&still), spline(&moving)) else {
        return;
    };
    let moved = match plane {
        Some((normal, offset)) => Some(from.map(|control| {
            control + direction * ((offset - normal.dot(control)) / normal.dot(&direction))
        })),
        None => {
            let rim = to.points(FINE);
            let at = |share: f64| {
                let start = from.point_at(share * from.pieces() as f64);
                opposite(&start, &rim, &direction)
            };
            Spline::nearest_to(at, from.controls.len(), from.closed)
        }
    };
    let Some(mut moved) = moved else {
        return;
    };
    if one.reversed == other.reversed {
        moved.controls.reverse();
        if moved.closed {
            // A piece begins near the second of its four control points.
            moved.controls.rotate_right(3);
        }
    }
    if let (false, [first, .., last]) = (to.closed, &mut moved.controls[..]) {
        (*first, *last) = (to.controls[0], to.controls[to.controls.len() - 1]);
    }
    if let Some(curve) = curves.get_mut(&moving.curve) {
        curve.spline = Some(moved);
    }
}

/// The area of a wall between two splines, each with whether the wall's loop runs backwards along it,
/// and the flux of x from a point through it: integrals over heights along the profile, as of a
/// cylinder over those along its rims.
pub(crate) fn moments_of_wall(
    rims: [(bool, &Spline); 2],
    direction: &Vector3<f64>,
    from: &Vector3<f64>,
) -> [f64; 2] {
    let of_rim = |(reversed, spline): (bool, &Spline)| {
        let mut moments = [0.0, 0.0];
        for piece in spline.beziers() {
            for (share, weight) in GAUSS {
                let (point, along) = place_and_derivative(&piece, share);
                let (offset, height) = (point - from, direction.dot(&(point - from)));
                let across = direction.cross(&offset).dot(&along);
                let beside = along - direction * direction.dot(&along);
                moments[0] += weight * height * beside.norm();
                moments[1] += weight * height * if reversed { across } else { -across };
            }
        }
        moments
    };
    let [one, other] = rims.map(of_rim);
    [(other[0] - one[0]).abs(), one[1] + other[1]]
}
