//! Faces become shells: what hangs together, with its outer side found, and closed or not.

use super::bounds::Bounds;
use super::chain::{distance_to_chain, point_along};
use super::curves::{Curve, Curves, MeasuredGraph, TURN};
use super::face::{CurveIndex, Face, Shell, Step};
use super::geometry::{NO_AXIS, ShellGeometry};
use super::groups::groups;
use super::region::Region;
use super::surface::Surface;
use crate::ViewObservation;
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Points of each curve that are asked whether they lie within a solid or on it.
const POINTS: usize = 7;
/// Points are on a face or an edge that are so near to it, by the extent of the shell.
const MARGIN: f64 = 0.02;
/// Of a face, what other curves on it may take without the rest being another face: area to a
/// twentieth.
const LITTLE: f64 = 0.05;

/// The shells of the chosen faces: closed ones first, then those with the most faces.
pub(super) fn shells(
    graph: &MeasuredGraph,
    curves: &Curves,
    faces: Vec<Face>,
    views: &[ViewObservation],
) -> Vec<Shell> {
    let mut of_curve: BTreeMap<CurveIndex, Vec<usize>> = BTreeMap::new();
    for (place, face) in faces.iter().enumerate() {
        for step in face.steps() {
            of_curve.entry(step.curve).or_default().push(place);
        }
    }
    let mut joined: Vec<Vec<usize>> = of_curve.values().cloned().collect();
    joined.extend((0..faces.len()).map(|place| vec![place]));
    let mut shells = Vec::new();
    for group in groups(&joined) {
        let mut faces: Vec<Face> = group.iter().map(|place| faces[*place].clone()).collect();
        let orientable = orient(&mut faces);
        let has_two = |face: &Face| face.steps().all(|step| of_curve[&step.curve].len() == 2);
        let two_each = faces.iter().all(has_two);
        let mut shell = Shell {
            closed: orientable && two_each,
            faces,
        };
        let geometry = ShellGeometry::new(&shell, graph.wireframe, graph.arcs, graph.splines);
        face_outward(&mut shell, &geometry, views);
        if shell.closed && leave_out_where_curves_are(&mut shell, curves, &geometry) {
            // What is left may fall apart.
            shells.extend(self::shells(graph, curves, shell.faces, views));
        } else {
            shells.push(shell);
        }
    }
    shells.sort_by_key(|shell| (!shell.closed, usize::MAX - shell.faces.len()));
    shells
}

/// Turns faces so that two that share a curve run along it in opposite directions, as far as one
/// leads to the next; whether that holds for all.
fn orient(faces: &mut [Face]) -> bool {
    let mut oriented = vec![false; faces.len()];
    let steps_of = |face: &Face| -> Vec<Step> { face.steps().copied().collect() };
    let mut at_curve: BTreeMap<CurveIndex, Vec<usize>> = BTreeMap::new();
    for (place, face) in faces.iter().enumerate() {
        for step in face.steps() {
            at_curve.entry(step.curve).or_default().push(place);
        }
    }
    let mut consistent = true;
    for first in 0..faces.len() {
        if oriented[first] {
            continue;
        }
        oriented[first] = true;
        let mut queue = VecDeque::from([first]);
        while let Some(place) = queue.pop_front() {
            for step in steps_of(&faces[place]) {
                for other in at_curve[&step.curve]
                    .iter()
                    .filter(|other| **other != place)
                {
                    let same = faces[*other].steps().any(|s| *s == step);
                    if !oriented[*other] {
                        if same {
                            faces[*other] = faces[*other].turned();
                        }
                        oriented[*other] = true;
                        queue.push_back(*other);
                    } else {
                        consistent &= !same;
                    }
                }
            }
        }
    }
    consistent
}

/// Turns all faces if a closed shell has its normals inward, or more of a sheet is seen from
/// behind.
fn face_outward(shell: &mut Shell, geometry: &ShellGeometry, views: &[ViewObservation]) {
    let outward = if shell.closed {
        geometry.volume(shell)
    } else {
        let toward_cameras = |face: &Face| {
            let Some((point, normal)) = middle(face, geometry) else {
                return 0.0;
            };
            let centers = views.iter().map(|view| view.camera.center_in_world);
            centers
                .map(|center| normal.dot(&(center - point)).signum())
                .sum::<f64>()
                * geometry.area(face)
        };
        shell.faces.iter().map(toward_cameras).sum()
    };
    if outward < 0.0 {
        shell.faces = shell.faces.iter().map(Face::turned).collect();
    }
}

/// The middle of the outer loop of a plane, and its normal.
fn middle(face: &Face, geometry: &ShellGeometry) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let Surface::Plane { normal, .. } = face.surface else {
        return None;
    };
    let points: Vec<Vector3<f64>> = (face.loops.first()?.iter())
        .flat_map(|step| geometry.points(step, TURN))
        .collect();
    Some((
        points.iter().sum::<Vector3<f64>>() / points.len() as f64,
        normal,
    ))
}

/// Makes a sheet of a closed shell if other curves of the wireframe lie within it or on it: nothing
/// is seen within a solid, and what lies on a face is the rim of something that the shell lacks.
/// Faces of which that may take more than a little are left out; returns whether there are such.
fn leave_out_where_curves_are(
    shell: &mut Shell,
    curves: &Curves,
    geometry: &ShellGeometry,
) -> bool {
    let own: BTreeSet<CurveIndex> = shell.curves().collect();
    let bounding: Vec<&Curve> = (curves.all.iter())
        .filter(|curve| own.contains(&curve.index))
        .collect();
    let bounds = Bounds::of(bounding.iter().flat_map(|curve| &curve.points));
    let margin = MARGIN * bounds.extent();
    let around = bounds.widened(margin);
    let others: Vec<Other> = (curves.observed())
        .filter(|curve| !own.contains(&curve.index))
        .map(|curve| (curve.ends, &curve.points))
        .chain(curves.loose.iter().map(|points| (None, points)))
        .filter(|(_, points)| Bounds::of(*points).meets(&around))
        .collect();
    // Beside an edge of the shell another one may be that edge once more.
    let apart = |point: &Vector3<f64>| {
        (bounding.iter()).all(|curve| distance_to_chain(&curve.points, point) > margin)
    };
    let samples = |points: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
        let places = (0..POINTS).map(|k| (k as f64 + 0.5) / POINTS as f64);
        let along = places.map(|place| point_along(points, place));
        along.filter(apart).collect()
    };
    let samples: Vec<Vec<Vector3<f64>>> = others.iter().map(|(_, p)| samples(p)).collect();
    let most = |of_curve: &Vec<Vector3<f64>>, holds: &dyn Fn(&Vector3<f64>) -> bool| {
        2 * of_curve.iter().filter(|point| holds(point)).count() > POINTS
    };
    let regions: Vec<Option<Region>> = (shell.faces.iter())
        .map(|face| Region::new(curves, face))
        .collect();
    // Rays along it hardly meet edges.
    let ray = Vector3::from(NO_AXIS);
    let within = |point: &Vector3<f64>| {
        let hits = regions
            .iter()
            .flatten()
            .flat_map(|region| region.hits(point, &ray));
        hits.filter(|t| *t > 0.0).count() % 2 == 1
    };
    shell.closed = !samples.iter().any(|of_curve| most(of_curve, &within));
    let mut regions = regions.iter();
    let count = shell.faces.len();
    shell.faces.retain(|face| {
        let Some(Some(region)) = regions.next() else {
            return true;
        };
        let on_face = |point: &Vector3<f64>| region.is_near(point, margin);
        let on_face: Vec<Other> = (others.iter().zip(&samples))
            .filter(|(_, samples)| most(samples, &on_face))
            .map(|(other, _)| *other)
            .collect();
        shell.closed &= on_face.is_empty();
        enclosed(&on_face) <= LITTLE * geometry.area(face).abs()
    });
    shell.faces.len() < count
}

/// A curve with the junctions at its ends, and points along it.
type Other<'a> = (Option<[usize; 2]>, &'a Vec<Vector3<f64>>);

/// The area that curves on a face may enclose: a square around each of those that hang together, as
/// one line alone does not say how wide that is of which it is a rim.
fn enclosed(on_face: &[Other]) -> f64 {
    let mut joined: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (place, (ends, _)) in on_face.iter().enumerate() {
        for end in ends.iter().flatten() {
            joined.entry(*end).or_default().push(place);
        }
    }
    let mut joined: Vec<Vec<usize>> = joined.into_values().collect();
    joined.extend((0..on_face.len()).map(|place| vec![place]));
    let square_around = |group: &Vec<usize>| {
        let points = group.iter().flat_map(|place| on_face[*place].1);
        Bounds::of(points).extent().powi(2)
    };
    groups(&joined).iter().map(square_around).sum()
}
