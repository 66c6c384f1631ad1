//! Which planes hold faces: those in which curves of the wireframe lie together, within what is
//! known of their positions.

use super::curves::{Curve, Curves};
use super::plane_fit::{FittedPlane, PlaneFit};
use nalgebra::Vector3;
use std::collections::BTreeSet;

/// Edges under a smaller sine to each other span no plane.
const MIN_SINE: f64 = 0.03;
/// After so many rounds the curves of a plane are taken as they are.
const ROUNDS: usize = 4;

/// The curves of one plane, by their places among all, ascending.
pub(super) struct CoplanarCurves {
    pub curves: Vec<usize>,
    pub normal: Vector3<f64>,
    pub offset: f64,
}

/// All planes that two edges at a junction, or an arc, span.
pub(super) fn coplanar_curves(curves: &Curves) -> Vec<CoplanarCurves> {
    let mut planes: Vec<CoplanarCurves> = Vec::new();
    // For each curve the planes that hold it.
    let mut planes_of: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); curves.all.len()];
    for seed in seeds(curves) {
        let mut of_seed = seed.iter().map(|curve| &planes_of[*curve]);
        let first = of_seed.next().cloned().unwrap_or_default();
        let known = of_seed.fold(first, |common, planes| &common & planes);
        if !known.is_empty() {
            continue;
        }
        let Some(plane) = grown(curves, &seed) else {
            continue;
        };
        if planes.iter().all(|other| other.curves != plane.curves) {
            for curve in &plane.curves {
                planes_of[*curve].insert(planes.len());
            }
            planes.push(plane);
        }
    }
    planes
}

/// Pairs of edges at a junction and single arcs, those first that determine their plane best: by
/// the area that they span.
fn seeds(curves: &Curves) -> Vec<Vec<usize>> {
    let mut at_junction: Vec<(usize, usize)> = Vec::new();
    let mut seeds: Vec<(f64, Vec<usize>)> = Vec::new();
    for (place, curve) in curves.all.iter().enumerate() {
        match &curve.arc {
            Some(arc) => seeds.push((arc.radius.powi(2) * arc.sweep(), vec![place])),
            None => at_junction.extend(curve.ends.iter().flatten().map(|end| (*end, place))),
        }
    }
    at_junction.sort_unstable();
    let along = |place: usize| curves.all[place].points[1] - curves.all[place].points[0];
    for edges in at_junction.chunk_by(|a, b| a.0 == b.0) {
        for (k, (_, one)) in edges.iter().enumerate() {
            for (_, other) in &edges[k + 1..] {
                let (a, b) = (along(*one), along(*other));
                let area = a.cross(&b).norm();
                if area > MIN_SINE * a.norm() * b.norm() {
                    seeds.push((area, vec![*one, *other]));
                }
            }
        }
    }
    seeds.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
    seeds.into_iter().map(|(_, seed)| seed).collect()
}

/// All curves in the plane of the first ones: taken in from where the plane is known well to
/// where it is not, and asked again when all are in.
fn grown(curves: &Curves, seed: &[usize]) -> Option<CoplanarCurves> {
    let fit_of = |members: &[usize]| {
        let points = members.iter().flat_map(|m| curves.all[*m].measured.iter());
        PlaneFit::through(points, curves.extent)
    };
    let holds = |plane: &FittedPlane, curve: &Curve| {
        (curve.measured.iter()).all(|(point, covariance)| plane.holds(point, covariance))
    };
    let mut fit = fit_of(seed)?;
    let order = most_certain_first(curves, &fit.solved()?);
    let mut members = seed.to_vec();
    for place in order.into_iter().filter(|place| !seed.contains(place)) {
        if holds(&fit.solved()?, &curves.all[place]) {
            for (point, covariance) in &curves.all[place].measured {
                fit.add(point, covariance);
            }
            members.push(place);
        }
    }
    for _ in 0..ROUNDS {
        members.sort_unstable();
        let fit = fit_of(&members)?;
        let plane = fit.solved()?;
        let kept = (0..curves.all.len()).filter(|place| holds(&plane, &curves.all[*place]));
        let kept: Vec<usize> = kept.collect();
        if kept == members {
            break;
        }
        members = kept;
    }
    let (normal, offset) = fit_of(&members)?.solved()?.plane();
    Some(CoplanarCurves {
        curves: members,
        normal,
        offset,
    })
}

/// The places of all curves, those first where a plane is known best.
fn most_certain_first(curves: &Curves, plane: &FittedPlane) -> Vec<usize> {
    let variance = |curve: &Curve| {
        let of_points = curve
            .measured
            .iter()
            .map(|(point, _)| plane.variance(point));
        of_points.fold(0.0, f64::max)
    };
    let variances: Vec<f64> = curves.all.iter().map(variance).collect();
    let mut order: Vec<usize> = (0..variances.len()).collect();
    order.sort_by(|a, b| variances[*a].total_cmp(&variances[*b]).then(a.cmp(b)));
    order
}
