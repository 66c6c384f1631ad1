//! Faces become shells: what hangs together, with its outer side found, and closed or not.

use super::bounds::Bounds;
use super::chain::{distance_to_chain, length_of_chain, point_along};
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
/// Points are on a face or an edge that are so near to it, by the extent of the shell. A curve alone that
/// is no longer than that is as good as a point, and says nothing.
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
        let geometry = ShellGeometry::new(&shell, graph);
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
    let regions: Vec<Option<Region>> = (shell.faces.iter())
        .map(|face| Region::new(curves, face))
        .collect();
    let within = regions.iter().flatten().flat_map(Region::inner_points);
    let others = OtherCurves::beside(curves, &own, &own, &within.collect::<Vec<_>>());
    // Rays along it hardly meet edges.
    let ray = Vector3::from(NO_AXIS);
    let within = |point: &Vector3<f64>| {
        let hits = regions
            .iter()
            .flatten()
            .flat_map(|region| region.hits(point, &ray));
        hits.filter(|t| *t > 0.0).count() % 2 == 1
    };
    shell.closed = others.mostly(&within).next().is_none();
    let mut regions = regions.iter();
    let count = shell.faces.len();
    shell.faces.retain(|face| {
        let Some(Some(region)) = regions.next() else {
            return true;
        };
        let on_face = others.enclosed_on(region);
        shell.closed &= on_face.is_none();
        on_face.is_none_or(|enclosed| enclosed <= LITTLE * geometry.area(face).abs())
    });
    shell.faces.len() < count
}

/// Whether curves that bound no face take no more than a little of a face of this area; `used` are
/// those that do, its own among them.
pub(super) fn is_mostly_free(
    curves: &Curves,
    face: &Face,
    used: &BTreeSet<CurveIndex>,
    (region, area): (&Region, f64),
) -> bool {
    let own: BTreeSet<CurveIndex> = face.steps().map(|step| step.curve).collect();
    let within = region.inner_points();
    let enclosed = OtherCurves::beside(curves, &own, used, &within).enclosed_on(region);
    enclosed.is_none_or(|enclosed| enclosed <= LITTLE * area)
}

/// A curve with the junctions at its ends, and points along it.
type Other<'a> = (Option<[usize; 2]>, &'a Vec<Vector3<f64>>);

/// Curves that bound none of some faces, near these.
struct OtherCurves<'a> {
    /// Each with samples of it that are not beside curves of the faces: there it may be one of them
    /// once more.
    curves: Vec<(Other<'a>, Vec<Vector3<f64>>)>,
    margin: f64,
}

impl<'a> OtherCurves<'a> {
    /// `own`: the curves of the faces; `used`: these and more that are no others; `within`: points of faces
    /// that reach beyond their curves.
    fn beside(
        curves: &'a Curves,
        own: &BTreeSet<CurveIndex>,
        used: &BTreeSet<CurveIndex>,
        within: &[Vector3<f64>],
    ) -> Self {
        let bounding: Vec<&Curve> = (curves.all.iter())
            .filter(|curve| own.contains(&curve.index))
            .collect();
        let along = bounding.iter().flat_map(|curve| &curve.points);
        let bounds = Bounds::of(along.chain(within));
        let margin = MARGIN * bounds.extent();
        let around = bounds.widened(margin);
        let mut at_junction: BTreeMap<usize, usize> = BTreeMap::new();
        for end in curves.observed().filter_map(|curve| curve.ends).flatten() {
            *at_junction.entry(end).or_default() += 1;
        }
        let goes_on = |ends: Option<[usize; 2]>| {
            let mut ends = ends.into_iter().flatten();
            ends.any(|end| at_junction[&end] > 1)
        };
        let others = (curves.observed())
            .filter(|curve| !used.contains(&curve.index))
            .map(|curve| (curve.ends, &curve.points))
            .chain(curves.loose.iter().map(|points| (None, points)))
            .filter(|(_, points)| Bounds::of(*points).meets(&around))
            .filter(|(ends, points)| length_of_chain(points) > margin || goes_on(*ends));
        let apart = |point: &Vector3<f64>| {
            (bounding.iter()).all(|curve| distance_to_chain(&curve.points, point) > margin)
        };
        let samples = |points: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
            let places = (0..POINTS).map(|k| (k as f64 + 0.5) / POINTS as f64);
            let along = places.map(|place| point_along(points, place));
            along.filter(apart).collect()
        };
        Self {
            curves: others.map(|other| (other, samples(other.1))).collect(),
            margin,
        }
    }

    /// Those of which most samples are such.
    fn mostly(&self, holds: &dyn Fn(&Vector3<f64>) -> bool) -> impl Iterator<Item = Other<'a>> {
        let most = |(_, samples): &&(Other, Vec<Vector3<f64>>)| {
            2 * samples.iter().filter(|point| holds(point)).count() > POINTS
        };
        self.curves.iter().filter(most).map(|(other, _)| *other)
    }

    /// The area that those on a face may enclose: a square around each of those that hang together, as
    /// one line alone does not say how wide that is of which it is a rim. `None` without any.
    fn enclosed_on(&self, region: &Region) -> Option<f64> {
        let is_near = |point: &Vector3<f64>| region.is_near(point, self.margin);
        let on_face: Vec<Other> = self.mostly(&is_near).collect();
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
        let enclosed = groups(&joined).iter().map(square_around).sum();
        (!on_face.is_empty()).then_some(enclosed)
    }
}
