//! The area of a face as a function of the places that it hangs on: the ends of its edges, and
//! centres, radii and ends of its arcs, control points of its splines.
//!
//! A plane's is the integral of x × dx / 2 around it, along its normal; that the normal is off
//! changes it in second order only. A cylinder's between two rims is the mean of their lengths times
//! the distance between them, a cone's that times the way along it; other parts of these are the
//! integral of the height over the angle around the axis, as walls' are along their profile.

use super::Place;
use crate::export::WireframeDocument;
use crate::faces::{
    Cap, Chain, CurveIndex, FINE, Face, PatchFace, Step, Surface, Unrolled, area_vector_of_spline,
    ends_of_arc, goes_around, moments_of_wall, nearest_junctions, twice_segment,
};
use nalgebra::Vector3;
use neat_core::{CircularArc, Spline};
use std::f64::consts::{PI, TAU};

/// The places of one step after the other: both ends of an edge; of an arc its centre, its radius,
/// and, if it is no circle, its ends; of a spline its control points; of the rim of a dome its sphere. A
/// part of a sphere hangs on that first.
pub(super) fn places(document: &WireframeDocument, face: &Face) -> Vec<Place> {
    let of_step = |steps: &[Step], step: &Step| match step.curve {
        CurveIndex::Edge(edge) => document.edges[edge].map(Place::Junction).to_vec(),
        CurveIndex::Smooth(ends) => ends.map(Place::Junction).to_vec(),
        CurveIndex::Rim(_) => vec![Place::Sphere],
        CurveIndex::Arc(arc) => {
            let ends = nearest_junctions(ends_of_arc(&document.arcs[arc]), &document.junctions);
            let ends = ends.filter(|_| steps.len() > 1).into_iter().flatten();
            let circle = [Place::Center(arc), Place::Radius(arc)];
            circle
                .into_iter()
                .chain(ends.map(Place::Junction))
                .collect()
        }
        CurveIndex::Spline(spline) => {
            let controls = 0..document.splines[spline].controls.len();
            controls.map(|k| Place::Control(spline, k)).collect()
        }
    };
    let is_sphere = matches!(face.surface, Surface::Sphere { .. });
    let along = face.loops.iter();
    let along = along.flat_map(|steps| steps.iter().flat_map(move |step| of_step(steps, step)));
    (is_sphere.then_some(Place::Sphere).into_iter())
        .chain(along)
        .collect()
}

/// A step with its places where they lie.
enum Piece {
    Edge([Vector3<f64>; 2]),
    Spline(Spline),
    Arc {
        arc: CircularArc,
        /// The junctions at its ends; `None` of a whole circle.
        ends: Option<[Vector3<f64>; 2]>,
    },
}

/// The area if the places lie at these points, in the order of [`places`].
pub(super) fn value(document: &WireframeDocument, face: &Face, points: &[Vector3<f64>]) -> f64 {
    let mut left = points;
    let mut take = || {
        let (first, others) = left.split_first().expect("area::value: too few points");
        left = others;
        *first
    };
    if let Surface::Sphere { .. } = face.surface {
        take();
    }
    let mut pieces: Vec<(bool, Piece)> = Vec::new();
    for steps in &face.loops {
        for step in steps {
            let piece = match step.curve {
                CurveIndex::Edge(_) | CurveIndex::Smooth(_) => Piece::Edge([take(), take()]),
                CurveIndex::Rim(dome) => {
                    take();
                    Piece::Arc {
                        arc: document.domes[dome].rim(),
                        ends: None,
                    }
                }
                CurveIndex::Arc(arc) => {
                    let (center, radius) = (take(), take().x);
                    let ends = (steps.len() > 1).then(|| [take(), take()]);
                    arc_piece(document, arc, center, radius, ends)
                }
                CurveIndex::Spline(spline) => {
                    let mut spline = document.splines[spline].clone();
                    spline
                        .controls
                        .iter_mut()
                        .for_each(|control| *control = take());
                    Piece::Spline(spline)
                }
            };
            pieces.push((step.reversed, piece));
        }
    }
    match face.surface {
        Surface::Plane { normal, .. } => {
            let origin = points[0];
            let sum: Vector3<f64> = (pieces.iter())
                .map(|(reversed, piece)| {
                    let vector = piece.area_vector(&origin);
                    if *reversed { -vector } else { vector }
                })
                .sum();
            normal.dot(&sum).abs()
        }
        Surface::Cylinder { axis, .. } if is_between_rims(face, &axis, &pieces) => {
            round(&axis, false, &pieces)
        }
        Surface::Cone { axis, .. } if is_between_rims(face, &axis, &pieces) => {
            round(&axis, true, &pieces)
        }
        Surface::Cylinder { .. } | Surface::Cone { .. } => unrolled(face, &pieces),
        Surface::Sphere { .. } => cap(face, &pieces),
        Surface::Extruded { direction } => extruded(&direction, &pieces),
        Surface::Patch { .. } => patch(face, &pieces),
    }
}

fn arc_piece(
    document: &WireframeDocument,
    index: usize,
    center: Vector3<f64>,
    radius: f64,
    ends: Option<[Vector3<f64>; 2]>,
) -> Piece {
    let mut arc = document.arcs[index];
    (arc.center, arc.radius) = (center, radius);
    let [start, end] = arc.angles;
    if let Some([from, to]) = &ends {
        // The angle next to the one of the arc.
        let near = |point: &Vector3<f64>, angle: f64| {
            angle + (arc.angle_of(point) - angle + PI).rem_euclid(TAU) - PI
        };
        arc.angles = [near(from, start), near(to, end)];
    }
    Piece::Arc { arc, ends }
}

impl Piece {
    /// Half the integral of x × dx along it, with x from the origin.
    fn area_vector(&self, origin: &Vector3<f64>) -> Vector3<f64> {
        let straight = |[a, b]: &[Vector3<f64>; 2]| 0.5 * (a - origin).cross(&(b - origin));
        match self {
            Self::Edge(ends) => straight(ends),
            Self::Spline(spline) => 0.5 * area_vector_of_spline(spline, origin),
            Self::Arc { arc, ends } => {
                let segment = 0.5 * arc.normal() * twice_segment(arc);
                let Some([from, to]) = *ends else {
                    return segment;
                };
                // Junctions lie beside the circle: straight to it, along it, and back.
                let [start, end] = ends_of_arc(arc);
                let chord = straight(&[start, end]);
                straight(&[from, start]) + chord + segment + straight(&[end, to])
            }
        }
    }

    /// Points along it, from junction to junction.
    fn points(&self) -> Vec<Vector3<f64>> {
        let (mut points, ends) = match self {
            Self::Edge(ends) => (ends.to_vec(), None),
            Self::Spline(spline) => (spline.points(FINE), None),
            Self::Arc { arc, ends } => (arc.points(FINE), *ends),
        };
        if let (Some(ends), [first, .., last]) = (ends, &mut points[..]) {
            [*first, *last] = ends;
        }
        points
    }
}

/// Whether a round face is between two arcs around its axis, as loops of their own or joined by
/// straight lines.
fn is_between_rims(face: &Face, axis: &Vector3<f64>, pieces: &[(bool, Piece)]) -> bool {
    let is_askew = |(_, piece): &(bool, Piece)| match piece {
        Piece::Arc { arc, .. } => !goes_around(arc, axis),
        Piece::Edge(_) => false,
        Piece::Spline(_) => true,
    };
    let is_rim = |step: &Step| matches!(step.curve, CurveIndex::Arc(_) | CurveIndex::Rim(_));
    let rims = face.rims_among(is_rim);
    rims.is_some() && !pieces.iter().any(is_askew)
}

/// The area of any part of a round surface. A cylinder is as wide as the arcs around its axis say; a
/// cone stays where it is.
fn unrolled(face: &Face, pieces: &[(bool, Piece)]) -> f64 {
    let mut surface = face.surface;
    if let Surface::Cylinder { axis, radius, .. } = &mut surface {
        let of_rim = |(_, piece): &(bool, Piece)| match piece {
            Piece::Arc { arc, .. } if goes_around(arc, axis) => Some(arc.radius),
            _ => None,
        };
        let radii: Vec<f64> = pieces.iter().filter_map(of_rim).collect();
        if !radii.is_empty() {
            *radius = radii.iter().sum::<f64>() / radii.len() as f64;
        }
    }
    let Some(surface) = Unrolled::new(&surface) else {
        return 0.0;
    };
    let mut left = pieces;
    let chain = |steps: &Vec<Step>| {
        let (own, others) = left.split_at(steps.len());
        left = others;
        let along = own.iter().map(|(reversed, piece)| {
            let mut points = piece.points();
            if *reversed {
                points.reverse();
            }
            points
        });
        surface.chain(&along.collect::<Vec<_>>().concat())
    };
    let loops: Vec<Chain> = face.loops.iter().map(chain).collect();
    surface.moments(&loops, &Vector3::zeros())[0].abs()
}

/// The area between two splines of one profile.
fn extruded(direction: &Vector3<f64>, pieces: &[(bool, Piece)]) -> f64 {
    let rims = pieces.iter().filter_map(|(reversed, piece)| match piece {
        Piece::Spline(spline) => Some((*reversed, spline)),
        _ => None,
    });
    let rims: Vec<(bool, &Spline)> = rims.collect();
    let area = |rims: &[(bool, &Spline); 2]| {
        let start = rims[0].1.controls[0];
        moments_of_wall(*rims, direction, &start)[0]
    };
    rims.first_chunk().map_or(0.0, area)
}

/// The area of a part of a sphere, which stays where it is.
fn cap(face: &Face, pieces: &[(bool, Piece)]) -> f64 {
    let Some((reversed, piece)) = pieces.first() else {
        return 0.0;
    };
    let mut points = piece.points();
    if *reversed {
        points.reverse();
    }
    let cap = Cap::new(&face.surface, &points);
    cap.map_or(0.0, |cap| cap.moments(&Vector3::zeros())[0])
}

/// The area of a patch.
fn patch(face: &Face, pieces: &[(bool, Piece)]) -> f64 {
    let along: Vec<Vec<Vector3<f64>>> = (pieces.iter())
        .map(|(reversed, piece)| {
            let mut points = piece.points();
            if *reversed {
                points.reverse();
            }
            points
        })
        .collect();
    let place = |step: &Step| face.steps().position(|other| other == step);
    let points = |step: &Step| place(step).map(|k| along[k].clone()).unwrap_or_default();
    let patch = PatchFace::new(face, points);
    patch.map_or(0.0, |patch| patch.moments(&Vector3::zeros())[0])
}

fn round(axis: &Vector3<f64>, widens: bool, pieces: &[(bool, Piece)]) -> f64 {
    let (mut rims, mut centers, mut heights) = (Vec::new(), Vec::new(), Vec::new());
    let mut radii = Vec::new();
    for (_, piece) in pieces {
        match piece {
            Piece::Spline(_) => {}
            Piece::Edge([a, b]) => heights.push(axis.dot(&(b - a)).abs()),
            Piece::Arc { arc, .. } => {
                rims.push(arc.radius * arc.sweep());
                radii.push(arc.radius);
                centers.push(axis.dot(&arc.center));
            }
        }
    }
    if heights.is_empty() {
        heights.extend(centers.windows(2).map(|pair| (pair[1] - pair[0]).abs()));
    }
    let mean = |numbers: &[f64]| numbers.iter().sum::<f64>() / numbers.len() as f64;
    // What two measured radii of one cylinder differ by is no slope.
    let growth = if widens { radii[1] - radii[0] } else { 0.0 };
    mean(&rims) * mean(&heights).hypot(growth)
}
