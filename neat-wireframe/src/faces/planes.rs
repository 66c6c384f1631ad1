//! Which planes hold faces: those in which curves of the wireframe lie together, within what is
//! known of their positions.

use super::bounds::Bounds;
use super::curves::{Curve, Curves};
use super::face::CurveIndex;
use super::plane_fit::{FittedPlane, PlaneFit};
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};

/// Edges under a smaller sine to each other span no plane.
const MIN_SINE: f64 = 0.03;
/// What is asked whether it lies in a plane lies in the box around its curves, but for so many
/// standard deviations of an arc.
const REACH: f64 = 4.0;
/// After so many rounds the curves of a plane are taken as they are.
const ROUNDS: usize = 4;

/// The curves of one plane.
pub(super) struct CoplanarCurves {
    /// Their places among all, ascending.
    pub curves: Vec<usize>,
    pub normal: Vector3<f64>,
    pub offset: f64,
}

/// All planes that two edges at a junction, or an arc, span.
pub(super) fn coplanar_curves(curves: &Curves) -> Vec<CoplanarCurves> {
    let mut planes: Vec<CoplanarCurves> = Vec::new();
    // For each curve the planes that hold it.
    let mut planes_of: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); curves.all.len()];
    let neighbours = Neighbours::new(curves);
    for seed in seeds(curves) {
        let mut of_seed = seed.iter().map(|curve| &planes_of[*curve]);
        let first = of_seed.next().cloned().unwrap_or_default();
        let known = of_seed.fold(first, |common, planes| &common & planes);
        if !known.is_empty() {
            continue;
        }
        let Some(plane) = grown(curves, &seed, &neighbours) else {
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

/// Pairs of edges at a junction and single arcs and splines, those first that determine their plane
/// best: by the area that they span. Where a dome touches something there is no plane.
fn seeds(curves: &Curves) -> Vec<Vec<usize>> {
    let mut at_junction: Vec<(usize, usize)> = Vec::new();
    let mut seeds: Vec<(f64, Vec<usize>)> = Vec::new();
    for (place, curve) in curves.all.iter().enumerate() {
        if matches!(curve.index, CurveIndex::Rim(_)) {
            continue;
        }
        if curve.is_straight() {
            at_junction.extend(curve.ends.iter().flatten().map(|end| (*end, place)));
            continue;
        }
        let area = match &curve.arc {
            Some(arc) => arc.radius.powi(2) * arc.sweep(),
            None => {
                let from_start = |k: usize| curve.points[k] - curve.points[0];
                let pieces = 1..curve.points.len();
                let twice = pieces.map(|k| from_start(k - 1).cross(&from_start(k)));
                twice.sum::<Vector3<f64>>().norm()
            }
        };
        seeds.push((area, vec![place]));
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

/// The curves that hang together with the first ones in their plane, and those that lie in it
/// among them. Curves farther away are not taken: what a few short edges tell of a plane there is
/// little, and would be told by what lies there by chance.
fn grown(curves: &Curves, seed: &[usize], neighbours: &Neighbours) -> Option<CoplanarCurves> {
    let mut members = neighbours.around(seed, curves);
    for _ in 0..ROUNDS {
        let fit = fit_of(curves, &members)?;
        let plane = fit.solved()?;
        let kept = neighbours.connected(seed, |place| holds(&plane, &curves.all[place]));
        if kept == members || kept.is_empty() {
            break;
        }
        members = kept;
    }
    let fit = fit_of(curves, &members)?;
    let plane = fit.solved()?;
    let around = Bounds::of(members.iter().flat_map(|m| &curves.all[*m].points))
        .widened(REACH * curves.arc_sigma());
    let within = (0..curves.all.len()).filter(|place| {
        neighbours.bounds[*place].lies_in(&around)
            && !matches!(curves.all[*place].index, CurveIndex::Rim(_))
            && holds(&plane, &curves.all[*place])
            && members.binary_search(place).is_err()
    });
    let within: Vec<usize> = within.collect();
    let (normal, offset) = plane.plane();
    members.extend(within);
    members.sort_unstable();
    Some(CoplanarCurves {
        curves: members,
        normal,
        offset,
    })
}

fn fit_of(curves: &Curves, members: &[usize]) -> Option<PlaneFit> {
    let points = (members.iter()).flat_map(|member| curves.all[*member].measured.iter());
    PlaneFit::through(points, curves.extent)
}

fn holds(plane: &FittedPlane, curve: &Curve) -> bool {
    (curve.measured.iter()).all(|(point, covariance)| plane.holds(point, covariance))
}

/// Which curves meet at junctions.
struct Neighbours {
    /// For each curve those that share an end with it, ascending …
    of: Vec<Vec<usize>>,
    /// … and the box around it.
    bounds: Vec<Bounds>,
}

impl Neighbours {
    fn new(curves: &Curves) -> Self {
        let mut at_junction: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (place, curve) in curves.all.iter().enumerate() {
            for end in curve.ends.iter().flatten() {
                at_junction.entry(*end).or_default().push(place);
            }
        }
        let of = |(place, curve): (usize, &Curve)| {
            let ends = curve.ends.iter().flatten();
            let all: BTreeSet<usize> = ends.flat_map(|end| &at_junction[end]).copied().collect();
            all.into_iter().filter(|other| *other != place).collect()
        };
        Self {
            of: curves.all.iter().enumerate().map(of).collect(),
            bounds: (curves.all.iter())
                .map(|curve| Bounds::of(&curve.points))
                .collect(),
        }
    }

    /// The curves in the plane of the first ones that hang together with them: taken in from where
    /// the plane is known well to where it is not, ascending.
    fn around(&self, seed: &[usize], curves: &Curves) -> Vec<usize> {
        let mut members: BTreeSet<usize> = seed.iter().copied().collect();
        let mut open: BTreeSet<usize> = seed.iter().flat_map(|s| &self.of[*s]).copied().collect();
        let mut asked = members.clone();
        let Some(mut fit) = fit_of(curves, seed) else {
            return seed.to_vec();
        };
        loop {
            open.retain(|place| !asked.contains(place));
            let Some(plane) = fit.solved() else { break };
            let variance = |place: &usize| {
                let points = curves.all[*place].measured.iter();
                points.fold(0.0_f64, |most, (point, _)| most.max(plane.variance(point)))
            };
            let surest = open.iter().map(|place| (variance(place), *place));
            let Some((_, place)) = surest.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                break;
            };
            asked.insert(place);
            if holds(&plane, &curves.all[place]) {
                for (point, covariance) in &curves.all[place].measured {
                    fit.add(point, covariance);
                }
                members.insert(place);
                open.extend(&self.of[place]);
            }
        }
        members.into_iter().collect()
    }

    /// The curves of a kind that hang together with the first ones by such, ascending.
    fn connected(&self, seed: &[usize], is_one: impl Fn(usize) -> bool) -> Vec<usize> {
        let mut found = BTreeSet::new();
        let mut open: Vec<usize> = seed.to_vec();
        while let Some(place) = open.pop() {
            if !found.contains(&place) && is_one(place) {
                found.insert(place);
                open.extend(&self.of[place]);
            }
        }
        found.into_iter().collect()
    }
}
