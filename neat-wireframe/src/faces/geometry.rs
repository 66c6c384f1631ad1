//! The exact geometry of a shell: its vertices and arcs where its surfaces meet, and what it
//! encloses.
//!
//! Measured junctions lie off the planes of their faces by the noise of the measurement. A
//! boundary representation wants them on all of them; they move by the shortest way that leads
//! there.

use super::curves::{ends_of_arc, ends_of_spline, nearest_junctions};
use super::face::{CurveIndex, Face, Shell, Step};
use super::plane_fit::across;
use super::surface::Surface;
use nalgebra::{DMatrix, DVector, Vector3};
use neat_core::{CircularArc, Spline, Wireframe3d};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// No direction that objects prefer. Whole circles begin where it points to from their axis, so that
/// those of one axis begin beside each other, however little their planes are turned.
pub(super) const NO_AXIS: [f64; 3] = [0.5381, 0.2837, 0.7937];
/// Surfaces whose normals differ by a smaller sine do not say where along them they meet.
const MIN_SINGULAR: f64 = 0.05;
/// Round surfaces are not flat: the way to them is gone in so many steps.
const STEPS: usize = 4;

/// A curve as a shell has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShellCurve {
    /// The junctions at its start and end; `None` if it is closed.
    pub ends: Option<[usize; 2]>,
    /// The arc, if it is one. Whole circles of one axis start in the same direction.
    pub arc: Option<CircularArc>,
    /// The spline, if it is one, in the planes of its faces.
    pub spline: Option<Spline>,
}

/// Vertices and curves of one shell, by their indices in the wireframe.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShellGeometry {
    /// The junctions at which its curves end.
    pub vertices: BTreeMap<usize, Vector3<f64>>,
    /// Its edges, arcs and splines.
    pub curves: BTreeMap<CurveIndex, ShellCurve>,
    /// A point of it: far from the origin of the frame, areas and volumes would lose their digits.
    origin: Vector3<f64>,
}

impl ShellGeometry {
    /// Of a shell of a wireframe in the same frame.
    ///
    /// # Panics
    /// If the shell names curves that the wireframe does not have.
    pub fn new(
        shell: &Shell,
        wireframe: &Wireframe3d,
        arcs: &[CircularArc],
        splines: &[Spline],
    ) -> Self {
        let mut surfaces_of: BTreeMap<CurveIndex, Vec<Surface>> = BTreeMap::new();
        let mut curves = BTreeMap::new();
        for face in &shell.faces {
            for steps in &face.loops {
                for step in steps {
                    surfaces_of
                        .entry(step.curve)
                        .or_default()
                        .push(face.surface);
                    let curve = as_measured(step, steps.len() > 1, wireframe, (arcs, splines));
                    curves.insert(step.curve, curve);
                }
            }
        }
        let mut surfaces_at: BTreeMap<usize, Vec<Surface>> = BTreeMap::new();
        for (index, curve) in &curves {
            for end in curve.ends.iter().flatten() {
                surfaces_at
                    .entry(*end)
                    .or_default()
                    .extend(&surfaces_of[index]);
            }
        }
        let vertices: BTreeMap<usize, Vector3<f64>> = (surfaces_at.into_iter())
            .map(|(j, surfaces)| (j, on_surfaces(wireframe.junctions[j], &surfaces)))
            .collect();
        for (index, curve) in &mut curves {
            if let Some(spline) = &mut curve.spline {
                *spline = spline.map(|point| on_surfaces(*point, &surfaces_of[index]));
                let last = spline.controls.len() - 1;
                for (control, end) in [0, last].into_iter().zip(curve.ends.iter().flatten()) {
                    spline.controls[control] = vertices[end];
                }
            }
            if let Some(arc) = &mut curve.arc {
                *arc = match curve.ends {
                    None => circle_on_surfaces(arc, &surfaces_of[index], true),
                    Some(ends) => {
                        let circle = circle_on_surfaces(arc, &surfaces_of[index], false);
                        between(&circle, ends, &vertices)
                    }
                }
            }
        }
        let inner = curves.values().filter_map(|curve| {
            let of_spline = curve.spline.as_ref().map(|spline| spline.controls[0]);
            curve.arc.map(|arc| arc.center).or(of_spline)
        });
        let origin = vertices.values().copied().chain(inner).next();
        let origin = origin.unwrap_or_default();
        Self {
            vertices,
            curves,
            origin,
        }
    }

    /// Points along a step, both ends among them; arcs and splines turn by `most` radians at most
    /// from one to the next. The first and the last of a closed one are the same.
    pub fn points(&self, step: &Step, most: f64) -> Vec<Vector3<f64>> {
        let curve = &self.curves[&step.curve];
        let mut points = match (&curve.arc, &curve.spline) {
            (Some(arc), _) => arc.points(most),
            (None, Some(spline)) => spline.points(most),
            (None, None) => (curve.ends.iter().flatten())
                .map(|end| self.vertices[end])
                .collect(),
        };
        if let (Some(ends), [first, .., last]) = (curve.ends, &mut points[..]) {
            [*first, *last] = ends.map(|end| self.vertices[&end]);
        }
        if step.reversed {
            points.reverse();
        }
        points
    }

    /// Area of a face.
    pub fn area(&self, face: &Face) -> f64 {
        match face.surface {
            Surface::Plane { normal, .. } => normal.dot(&self.area_vector(face)),
            Surface::Cylinder { .. } | Surface::Cone { .. } => self.moments_of_round(face).0,
        }
    }

    /// The volume that faces with their normals outward enclose, by Gauss' theorem for the field
    /// x / 3: for a shell that is not closed it means nothing.
    pub fn volume(&self, shell: &Shell) -> f64 {
        let flux = |face: &Face| match face.surface {
            Surface::Plane { normal, offset } => {
                (offset - normal.dot(&self.origin)) * normal.dot(&self.area_vector(face))
            }
            Surface::Cylinder { .. } | Surface::Cone { .. } => self.moments_of_round(face).1,
        };
        shell.faces.iter().map(flux).sum::<f64>() / 3.0
    }

    /// Half the integral of x × dx around a face, with x from the origin.
    fn area_vector(&self, face: &Face) -> Vector3<f64> {
        let of_step = |step: &Step| {
            let curve = &self.curves[&step.curve];
            let sign = if step.reversed { -0.5 } else { 0.5 };
            let ends = curve
                .ends
                .map(|ends| ends.map(|end| self.vertices[&end] - self.origin));
            if let Some(spline) = &curve.spline {
                return sign * area_vector_of_spline(spline, &self.origin);
            }
            let twice = match (&curve.arc, ends) {
                (Some(arc), ends) => {
                    let [start, end] = ends.unwrap_or_default();
                    (arc.center - self.origin).cross(&(end - start))
                        + arc.normal() * arc.radius.powi(2) * arc.sweep()
                }
                (None, Some([start, end])) => start.cross(&end),
                (None, None) => Vector3::zeros(),
            };
            sign * twice
        };
        face.steps().map(of_step).sum()
    }

    /// Area of a cylinder or a cone, and the flux of x through it.
    fn moments_of_round(&self, face: &Face) -> (f64, f64) {
        let rims = face.steps().filter_map(|step| self.curves[&step.curve].arc);
        let rims: Vec<CircularArc> = rims.collect();
        let [one, other] = rims[..] else {
            return (0.0, 0.0);
        };
        // The integral of the direction from the axis, over the angle.
        let [start, end] = one.angles;
        let outward = one.toward(end - 0.25 * TAU) - one.toward(start - 0.25 * TAU);
        let between = other.center - one.center;
        match face.surface {
            Surface::Plane { .. } => (0.0, 0.0),
            Surface::Cylinder {
                point,
                axis,
                radius,
                convex,
            } => {
                let height = axis.dot(&between).abs();
                let area = radius * one.sweep() * height;
                let flux = radius * area + radius * height * (point - self.origin).dot(&outward);
                (area, if convex { flux } else { -flux })
            }
            Surface::Cone {
                apex,
                axis,
                half_angle,
                convex,
            } => {
                let (sine, cosine) = half_angle.sin_cos();
                let slant = axis.dot(&between).abs() / cosine;
                let radius = 0.5 * (one.radius + other.radius);
                let area = radius * one.sweep() * slant;
                // Every plane that touches a cone passes through its apex.
                let normals = outward * (radius * slant * cosine) - axis * (area * sine);
                let flux = (apex - self.origin).dot(&normals);
                (area, if convex { flux } else { -flux })
            }
        }
    }
}

/// The curve of a step as the wireframe has it: `open` if others are beside it in its loop.
fn as_measured(
    step: &Step,
    open: bool,
    wireframe: &Wireframe3d,
    (arcs, splines): (&[CircularArc], &[Spline]),
) -> ShellCurve {
    let junctions = |ends| open.then(|| nearest_junctions(ends, &wireframe.junctions))?;
    match step.curve {
        CurveIndex::Edge(edge) => ShellCurve {
            ends: Some(wireframe.edges[edge]),
            ..ShellCurve::default()
        },
        CurveIndex::Arc(arc) => ShellCurve {
            ends: junctions(ends_of_arc(&arcs[arc])),
            arc: Some(arcs[arc]),
            spline: None,
        },
        CurveIndex::Spline(spline) => ShellCurve {
            ends: junctions(ends_of_spline(&splines[spline])),
            arc: None,
            spline: Some(splines[spline].clone()),
        },
        CurveIndex::Smooth(ends) => ShellCurve {
            ends: Some(ends),
            ..ShellCurve::default()
        },
    }
}

/// The integral of x × dx along a spline, with x from an origin: each piece is a cubic in its
/// place, so that it is a polynomial of degree 5, which three points of Gauss and Legendre have
/// exactly.
pub(crate) fn area_vector_of_spline(spline: &Spline, origin: &Vector3<f64>) -> Vector3<f64> {
    let spread = 0.6_f64.sqrt();
    let nodes = [(-spread, 5.0), (0.0, 8.0), (spread, 5.0)];
    let of_piece = |[a, b, c, d]: &[Vector3<f64>; 4]| -> Vector3<f64> {
        let of_node = |(node, weight): (f64, f64)| {
            let t = 0.5 * (1.0 + node);
            let s = 1.0 - t;
            let point = a * (s * s * s) + (b * s + c * t) * (3.0 * s * t) + d * (t * t * t);
            let along = ((b - a) * (s * s) + (c - b) * (2.0 * s * t) + (d - c) * (t * t)) * 3.0;
            (point - origin).cross(&along) * (weight / 18.0)
        };
        nodes.into_iter().map(of_node).sum()
    };
    spline.beziers().iter().map(of_piece).sum()
}

/// The nearest point on all surfaces, or the best one if there is none.
fn on_surfaces(start: Vector3<f64>, surfaces: &[Surface]) -> Vector3<f64> {
    let mut position = start;
    for _ in 0..STEPS {
        let rows = surfaces.iter().map(|surface| surface.height_of(&position));
        let rows: Vec<(f64, Vector3<f64>)> = rows.collect();
        let normals = DMatrix::from_fn(rows.len(), 3, |i, k| rows[i].1[k]);
        let heights = DVector::from_fn(rows.len(), |i, _| -rows[i].0);
        let Ok(step) = normals.svd(true, true).solve(&heights, MIN_SINGULAR) else {
            break;
        };
        position += Vector3::new(step[0], step[1], step[2]);
    }
    position
}

/// The circle of an arc in the plane of a face and around the axis of another, or where two round
/// faces of one axis meet. A whole one begins where all circles around this axis do.
fn circle_on_surfaces(arc: &CircularArc, surfaces: &[Surface], whole: bool) -> CircularArc {
    let (mut center, mut radius) = (arc.center, arc.radius);
    let plane = surfaces.iter().find_map(|surface| match surface {
        Surface::Plane { normal, offset } => Some((*normal, *offset)),
        Surface::Cylinder { .. } | Surface::Cone { .. } => None,
    });
    let axis = surfaces
        .iter()
        .find_map(Surface::axis)
        .map(|(point, axis)| {
            center = point + axis * axis.dot(&(center - point));
            axis
        });
    let mut profiles = (surfaces.iter()).filter_map(|surface| surface.radius_at(&center, &axis?));
    let (first, second) = (profiles.next(), profiles.next());
    let normal = match (plane, first, second, axis) {
        (Some((normal, offset)), ..) => {
            // A plane along the axis cuts no circle out of a round surface.
            let along = axis.filter(|axis| normal.dot(axis).abs() > MIN_SINGULAR);
            let by = |along: Vector3<f64>| (offset - normal.dot(&center)) / normal.dot(&along);
            if let Some([here, growth]) = first {
                radius = here + along.map_or(0.0, |along| growth * by(along));
            }
            let along = along.unwrap_or(normal);
            center += along * by(along);
            normal
        }
        (None, Some([here, growth]), Some([other, of_other]), Some(along)) => {
            // Where one surface goes on as the same one, the arc knows where it is.
            let apart = growth - of_other;
            let by = if apart.abs() > MIN_SINGULAR {
                (other - here) / apart
            } else {
                0.0
            };
            center += along * by;
            radius = here + growth * by;
            along
        }
        _ => {
            if let Some([here, _]) = first {
                radius = here;
            }
            arc.normal()
        }
    };
    let up = normal * normal.dot(&arc.normal()).signum();
    let toward = if whole {
        Vector3::from(NO_AXIS)
    } else {
        arc.axes[0]
    };
    let flat = toward - up * up.dot(&toward);
    let x = flat.try_normalize(MIN_SINGULAR).unwrap_or(across(&up)[0]);
    CircularArc {
        center,
        axes: [x, up.cross(&x)],
        radius,
        angles: if whole { [0.0, TAU] } else { arc.angles },
    }
}

/// The arc from one vertex to the other, in its direction.
fn between(
    arc: &CircularArc,
    ends: [usize; 2],
    vertices: &BTreeMap<usize, Vector3<f64>>,
) -> CircularArc {
    let [start, end] = ends.map(|end| arc.angle_of(&vertices[&end]));
    CircularArc {
        angles: [start, start + (end - start).rem_euclid(TAU)],
        ..*arc
    }
}
