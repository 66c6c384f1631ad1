//! Faces that are no part of a plane, a cylinder or a cone: what is open between the others.
//!
//! Every curve of a solid has two faces. Where the curves that have one hang together in a loop, there
//! is the boundary of a face, or of a hole in one: which of both, the smooth surface through the
//! larger loop tells. A loop of straight edges alone is none: such faces are planes of which a part is
//! missing.

use super::bounds::Bounds;
use super::cells::closed_points;
use super::chain::point_along;
use super::curves::{Curve, Curves};
use super::face::{CurveIndex, Face, Step};
use super::groups::groups;
use super::patch::PatchFace;
use super::plane_fit::PlaneFit;
use super::polygon::{contains, signed_area};
use super::region::Region;
use super::surface::Surface;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Sides of a patch meet where its boundary turns by more than this: cosine of 10°.
const CORNER: f64 = 0.985;
/// The direction of a curve at its end is that from so much of its length to there.
const NEAR_END: f64 = 0.05;
/// A hole of a patch lies within so many standard deviations of an arc of the surface through its
/// boundary, which knows less of its middle.
const WITHIN: f64 = 3.0;
/// Points of a loop that are asked whether they lie on a patch.
const POINTS: usize = 32;

/// A loop on a patch: how far it is off at most, and the places of its points.
struct OnPatch {
    off: f64,
    places: Vec<Vector2<f64>>,
}

/// A loop that may be the boundary of a patch.
struct Candidate {
    /// Its place among the loops.
    place: usize,
    face: Face,
    area: f64,
    /// The loops that lie on it.
    on_it: BTreeMap<usize, OnPatch>,
}

/// The patches between faces, the largest first, that are possible and pass through none before them.
pub(super) fn free_faces(
    curves: &Curves,
    faces: &[&Face],
    is_possible: impl Fn(&Face, &Region) -> bool,
) -> Vec<Face> {
    let mut count: BTreeMap<CurveIndex, usize> = BTreeMap::new();
    for step in faces.iter().flat_map(|face| face.steps()) {
        *count.entry(step.curve).or_default() += 1;
    }
    let is_open = |curve: &&Curve| count.get(&curve.index) == Some(&1);
    let (closed, open): (Vec<&Curve>, Vec<&Curve>) =
        (curves.observed().filter(is_open)).partition(|curve| curve.ends.is_none());
    let mut loops: Vec<Vec<Step>> = cycles(&open);
    loops.extend(closed.iter().map(|curve| {
        let (curve, reversed) = (curve.index, false);
        vec![Step { curve, reversed }]
    }));
    let mut left: Vec<Candidate> = candidates(curves, &loops);
    // The largest last, to be taken first: what is a hole in it is no face.
    left.sort_by(|a, b| a.area.total_cmp(&b.area).then(b.place.cmp(&a.place)));
    let mut taken: BTreeSet<usize> = BTreeSet::new();
    let mut accepted: Vec<(Face, Region)> = Vec::new();
    while let Some(candidate) = left.pop() {
        if taken.contains(&candidate.place) {
            continue;
        }
        let Candidate {
            place, mut face, ..
        } = candidate;
        let is_nearest = |(hole, on_it): &(&usize, &OnPatch)| {
            let mut others = left.iter().filter_map(|other| other.on_it.get(hole));
            !taken.contains(*hole) && !others.any(|other| other.off < on_it.off)
        };
        let holes: Vec<(&usize, &OnPatch)> = candidate.on_it.iter().filter(is_nearest).collect();
        // Of loops in each other the outermost are its holes.
        let is_inner = |(hole, on_it): &(&usize, &OnPatch)| {
            let mut others = holes.iter().filter(|(other, _)| other != hole);
            others.any(|(_, around)| contains(&around.places, &on_it.places[0]))
        };
        let outermost: Vec<_> = holes.iter().filter(|hole| !is_inner(hole)).collect();
        for (hole, on_it) in &outermost {
            face.loops.push(clockwise(&loops[**hole], &on_it.places));
        }
        let Some(region) = Region::new(curves, &face) else {
            continue;
        };
        let meets = |(_, other): &(Face, Region)| {
            region.passes_through(other) || other.passes_through(&region)
        };
        if is_possible(&face, &region) && !accepted.iter().any(meets) {
            taken.insert(place);
            taken.extend(outermost.iter().map(|(hole, _)| **hole));
            accepted.push((face, region));
        }
    }
    accepted.into_iter().map(|(face, _)| face).collect()
}

/// The patches within loops, with the loops on each.
fn candidates(curves: &Curves, loops: &[Vec<Step>]) -> Vec<Candidate> {
    let chains: Vec<Vec<Vector3<f64>>> = loops
        .iter()
        .map(|steps| closed_points(curves, steps))
        .collect();
    let most = WITHIN * curves.arc_sigma();
    let of_loop = |(place, steps): (usize, &Vec<Step>)| {
        let face = patch_within(curves, steps)?;
        let patch = PatchFace::new(&face, |step| curves.points_along(step))?;
        let around = Bounds::of(&chains[place]).widened(most);
        let others = chains
            .iter()
            .enumerate()
            .filter(|(other, chain)| *other != place && Bounds::of(*chain).meets(&around));
        let on_it =
            others.filter_map(|(other, chain)| Some((other, on_patch(&patch, chain, most)?)));
        Some(Candidate {
            place,
            on_it: on_it.collect(),
            area: patch.moments(&Vector3::zeros())[0],
            face,
        })
    };
    let indexed: Vec<(usize, &Vec<Step>)> = loops.iter().enumerate().collect();
    indexed.into_par_iter().filter_map(of_loop).collect()
}

/// Those curves in closed chains, at whose junctions no others are.
fn cycles(open: &[&Curve]) -> Vec<Vec<Step>> {
    let mut at: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (place, curve) in open.iter().enumerate() {
        for end in curve.ends.iter().flatten() {
            at.entry(*end).or_default().push(place);
        }
    }
    let joined: Vec<Vec<usize>> = at.values().cloned().collect();
    let is_cycle = |group: &Vec<usize>| {
        let mut ends = group.iter().filter_map(|place| open[*place].ends).flatten();
        group.len() > 1 && ends.all(|end| at[&end].len() == 2)
    };
    let around = |group: Vec<usize>| -> Vec<Step> {
        let mut place = group[0];
        let mut from = open[place].ends.map_or(0, |ends| ends[0]);
        let mut steps = Vec::with_capacity(group.len());
        for _ in &group {
            let [start, end] = open[place].ends.unwrap_or_default();
            let reversed = start != from;
            steps.push(Step {
                curve: open[place].index,
                reversed,
            });
            from = if reversed { start } else { end };
            place = at[&from]
                .iter()
                .copied()
                .find(|other| *other != place)
                .unwrap_or(place);
        }
        steps
    };
    groups(&joined)
        .into_iter()
        .filter(is_cycle)
        .map(around)
        .collect()
}

/// The patch whose boundary a loop is: with two to four corners, neither straight all around nor
/// flat.
fn patch_within(curves: &Curves, steps: &[Step]) -> Option<Face> {
    let of_loop = || steps.iter().filter_map(|step| curves.find(step.curve));
    if of_loop().all(Curve::is_straight) {
        return None;
    }
    let measured = of_loop().flat_map(|curve| &curve.measured);
    let fit = PlaneFit::through(measured.clone(), curves.extent)?;
    let (normal, offset) = fit.solved()?.plane();
    let off_plane = |point: &Vector3<f64>| (normal.dot(point) - offset).abs();
    if measured
        .map(|(point, _)| off_plane(point))
        .fold(0.0, f64::max)
        <= curves.arc_sigma()
    {
        return None;
    }
    let chains: Vec<Vec<Vector3<f64>>> = (steps.iter())
        .map(|step| curves.points_along(step))
        .collect();
    // Ends are at junctions, a little beside the curve.
    let turns = |place: &usize| {
        let before = &chains[(place + steps.len() - 1) % steps.len()];
        let after = &chains[*place];
        let along = before[before.len() - 1] - point_along(before, 1.0 - NEAR_END);
        let onward = point_along(after, NEAR_END) - after[0];
        along.normalize().dot(&onward.normalize()) < CORNER
    };
    let corners: Vec<usize> = (0..steps.len()).filter(turns).collect();
    let first = *corners.first()?;
    if !(2..=4).contains(&corners.len()) {
        return None;
    }
    let mut steps = steps.to_vec();
    steps.rotate_left(first);
    let mut lengths = (corners.iter().zip(corners.iter().skip(1))).map(|(one, next)| next - one);
    let mut sides = [0; 4];
    // Two sides alone face each other.
    let places: &[usize] = if corners.len() == 2 {
        &[0, 2]
    } else {
        &[0, 1, 2, 3]
    };
    let last = corners.len() - 1;
    for (k, place) in places.iter().take(corners.len()).enumerate() {
        sides[*place] = match k == last {
            true => steps.len() - (corners[last] - first),
            false => lengths.next()?,
        };
    }
    Some(Face {
        surface: Surface::Patch { sides },
        loops: vec![steps],
    })
}

/// A loop on a patch, if it lies on it and within its boundary.
fn on_patch(patch: &PatchFace, chain: &[Vector3<f64>], most: f64) -> Option<OnPatch> {
    let mut largest: f64 = 0.0;
    let mut places = Vec::with_capacity(POINTS);
    for k in 0..POINTS {
        let point = point_along(chain, (k as f64 + 0.5) / POINTS as f64);
        let place = patch.patch.place(&point);
        largest = largest.max((patch.patch.point(&place) - point).norm());
        let is_inside = place.iter().all(|share| *share > 0.0 && *share < 1.0);
        if !is_inside || largest > most {
            return None;
        }
        places.push(place);
    }
    Some(OnPatch {
        off: largest,
        places,
    })
}

/// A loop so that it has the rest of the patch on its left; `places` are those along it.
fn clockwise(steps: &[Step], places: &[Vector2<f64>]) -> Vec<Step> {
    if signed_area(places) < 0.0 {
        return steps.to_vec();
    }
    steps.iter().rev().map(Step::turned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::{MeasuredGraph, Shell, ShellGeometry, find_shells};
    use neat_core::{CircularArc, Wireframe3d};
    use std::f64::consts::FRAC_PI_2;

    /// From x = 2 to x = 0 in the plane at y, through the height of 1 + `rise` in between.
    fn arc(rise: f64, y: f64) -> CircularArc {
        let radius = (1.0 + rise * rise) / (2.0 * rise);
        let half = (1.0 / radius).asin();
        CircularArc {
            center: Vector3::new(1.0, y, 1.0 + rise - radius),
            axes: [Vector3::x(), Vector3::z()],
            radius,
            angles: [FRAC_PI_2 - half, FRAC_PI_2 + half],
        }
    }

    /// A block of 2 by 1 by 1 whose top has these two arcs, or straight edges in place of them, with
    /// one corner lifted.
    fn block(arcs: &[CircularArc], lift: f64) -> (Wireframe3d, Vec<Shell>) {
        let corner = |k: usize| {
            let [x, y] = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]][k % 4];
            Vector3::new(x, y, (k / 4) as f64)
        };
        let around = |first: usize| (0..4).map(move |k| [first + k, first + (k + 1) % 4]);
        let mut edges: Vec<[usize; 2]> = around(0).chain((0..4).map(|k| [k, k + 4])).collect();
        // The arcs are in place of the first and the third side.
        let is_straight = |k: &usize| arcs.is_empty() || k % 2 == 1;
        edges.extend(
            around(4)
                .enumerate()
                .filter(|(k, _)| is_straight(k))
                .map(|(_, e)| e),
        );
        let mut junctions: Vec<Vector3<f64>> = (0..8).map(corner).collect();
        junctions[6].z += lift;
        let wireframe = Wireframe3d { junctions, edges };
        let shells = find_shells(&graph(&wireframe, arcs), &[], &[]);
        (wireframe, shells)
    }

    fn graph<'a>(wireframe: &'a Wireframe3d, arcs: &'a [CircularArc]) -> MeasuredGraph<'a> {
        MeasuredGraph {
            arcs,
            ..MeasuredGraph::of(wireframe)
        }
    }

    fn patches(shells: &[Shell]) -> usize {
        let faces = shells.iter().flat_map(|shell| &shell.faces);
        let is_patch = |face: &&Face| matches!(face.surface, Surface::Patch { .. });
        faces.filter(is_patch).count()
    }

    #[test]
    fn a_loft_between_two_arcs_closes_a_block() {
        let arcs = [arc(0.3, 0.0), arc(0.1, 1.0)];
        let (wireframe, shells) = block(&arcs, 0.0);
        let [shell] = &shells[..] else {
            panic!("{} shells", shells.len());
        };
        assert!(shell.closed && shell.faces.len() == 6);
        assert_eq!(patches(&shells), 1);
        // Below straight lines from one arc to the other, at the same share of both.
        let at = |u: f64, v: f64| {
            let points = arcs.map(|arc| arc.point_at(arc.angles[1] - arc.sweep() * u));
            points[0] * (1.0 - v) + points[1] * v
        };
        let count = 400;
        let share = |k: usize| k as f64 / count as f64;
        let below = |v: f64| -> f64 {
            let ends = (0..count).map(|k| [at(share(k), v), at(share(k + 1), v)]);
            ends.map(|[a, b]| 0.5 * (a.z + b.z) * (b.x - a.x)).sum()
        };
        let truth: f64 = (0..count)
            .map(|k| below(share(k) + 0.5 / count as f64))
            .sum::<f64>();
        let geometry = ShellGeometry::new(shell, &graph(&wireframe, &arcs));
        let volume = geometry.volume(shell) * count as f64;
        assert!((volume / truth - 1.0).abs() < 1e-4, "{volume} {truth}");
        // In the mirror as well.
        let mirrored = |point: &Vector3<f64>| -point;
        let turned = arcs.map(|arc| arc.map(mirrored));
        let shell = shell.map(mirrored);
        let mirror = wireframe.map(|point| -point);
        let geometry = ShellGeometry::new(&shell, &graph(&mirror, &turned));
        let volume = geometry.volume(&shell) * count as f64;
        assert!((volume / truth - 1.0).abs() < 1e-4, "{volume} {truth}");
    }

    #[test]
    fn nothing_is_between_straight_edges_or_where_a_cylinder_is() {
        let (_, shells) = block(&[], 0.3);
        assert_eq!(patches(&shells), 0);
        let (_, shells) = block(&[arc(0.3, 0.0), arc(0.3, 1.0)], 0.0);
        assert!(patches(&shells) == 0 && shells[0].closed);
    }
}
