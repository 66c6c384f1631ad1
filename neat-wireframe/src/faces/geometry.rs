//! The exact geometry of a shell: its vertices and arcs where its surfaces meet, and what it
//! encloses.
//!
//! Measured junctions lie off the planes of their faces by the noise of the measurement. A
//! boundary representation wants them on all of them; they move by the shortest way that leads
//! there.

use super::cap::Cap;
use super::curves::{MeasuredGraph, ends_of_arc, ends_of_spline, nearest_junctions};
use super::extrusion::{extrude, moments_of_wall};
use super::face::{CurveIndex, Face, Shell, Step};
use super::patch::PatchFace;
use super::plane_fit::across;
use super::quadrature::{GAUSS, place_and_derivative};
use super::surface::Surface;
use super::unrolled::{Chain, Unrolled, turn};
use nalgebra::{DMatrix, DVector, Vector3};
use neat_core::{CircularArc, Spline};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// No direction that objects prefer. Whole circles begin where it points to from their axis, so that
/// those of one axis begin beside each other, however little their planes are turned.
pub(super) const NO_AXIS: [f64; 3] = [0.5381, 0.2837, 0.7937];
/// Surfaces whose normals differ by a smaller sine do not say where along them they meet.
const MIN_SINGULAR: f64 = 0.05;
/// Boundaries of round faces are followed in pieces that turn by so much, in radians.
pub(crate) const FINE: f64 = 0.02;
/// Arcs that go around no axis become splines whose pieces turn by so much: these differ from the
/// arc by less than a ten thousandth of its radius (a test of `Spline::nearest_to`).
const TURN_OF_PIECES: f64 = 0.4;
/// An arc that turns by less, in radians, is a straight line: over its chord it rises by a thousandth of
/// that, and nobody knows in which plane.
const FLAT: f64 = 0.008;
/// They go around one that is turned against theirs by less than this sine: 10°.
const TILTED: f64 = 0.174;
/// Round surfaces are not flat: the way to them is gone in so many steps.
const STEPS: usize = 4;

/// A curve as a shell has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShellCurve {
    /// The junctions at its start and end; `None` if it is closed.
    pub ends: Option<[usize; 2]>,
    /// The arc, if it is still one. Whole circles of one axis start in the same direction.
    pub arc: Option<CircularArc>,
    /// The spline, if it is one, on the surfaces of its faces: also of an arc that goes around no axis
    /// of them.
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
    pub fn new(shell: &Shell, graph: &MeasuredGraph) -> Self {
        let mut surfaces_of: BTreeMap<CurveIndex, Vec<Surface>> = BTreeMap::new();
        let mut curves = BTreeMap::new();
        for face in &shell.faces {
            for steps in &face.loops {
                for step in steps {
                    surfaces_of
                        .entry(step.curve)
                        .or_default()
                        .push(face.surface);
                    let curve = as_measured(step, steps.len() > 1, graph);
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
            .map(|(j, surfaces)| (j, on_surfaces(graph.wireframe.junctions[j], &surfaces)))
            .collect();
        for (index, curve) in &mut curves {
            let surfaces = &surfaces_of[index];
            let askew = curve.arc.filter(|arc| !is_rim(arc, surfaces));
            if let Some(spline) = askew.and_then(|arc| as_spline(&arc)) {
                (curve.arc, curve.spline) = (None, Some(spline));
            }
            if let Some(spline) = &mut curve.spline {
                let ends = curve.ends.map(|ends| ends.map(|end| vertices[&end]));
                *spline = spline_on_surfaces(spline, surfaces, ends);
            }
            if let Some(arc) = &mut curve.arc {
                *arc = match curve.ends {
                    // Where they touch, both are as wide.
                    None if index.is_inferred() => {
                        turned_as(arc, (arc.center, arc.radius, arc.normal()), true)
                    }
                    None => circle_on_surfaces(arc, &surfaces_of[index], true),
                    Some(ends) => {
                        let circle = circle_on_surfaces(arc, &surfaces_of[index], false);
                        between(&circle, ends, &vertices)
                    }
                }
            }
        }
        for face in &shell.faces {
            extrude(face, &mut curves, &surfaces_of);
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
            Surface::Cylinder { .. } | Surface::Cone { .. } => self.moments_of_round(face)[0],
            Surface::Sphere { .. } => self.moments_of_cap(face)[0],
            Surface::Extruded { direction } => self.moments_of_wall(face, direction)[0],
            Surface::Patch { .. } => self.moments_of_patch(face)[0],
        }
    }

    /// The volume that faces with their normals outward enclose, by Gauss' theorem for the field
    /// x / 3: for a shell that is not closed it means nothing.
    pub fn volume(&self, shell: &Shell) -> f64 {
        let flux = |face: &Face| match face.surface {
            Surface::Plane { normal, offset } => {
                (offset - normal.dot(&self.origin)) * normal.dot(&self.area_vector(face))
            }
            Surface::Cylinder { .. } | Surface::Cone { .. } => self.moments_of_round(face)[1],
            Surface::Sphere { .. } => self.moments_of_cap(face)[1],
            Surface::Extruded { direction } => self.moments_of_wall(face, direction)[1],
            Surface::Patch { .. } => self.moments_of_patch(face)[1],
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
                // Its chord, and the segment beside that: the centre of a flat arc is far away.
                (Some(arc), ends) => {
                    let [start, end] = ends.unwrap_or_default();
                    start.cross(&end) + arc.normal() * twice_segment(arc)
                }
                (None, Some([start, end])) => start.cross(&end),
                (None, None) => Vector3::zeros(),
            };
            sign * twice
        };
        face.steps().map(of_step).sum()
    }

    /// Area of a cylinder or a cone, and the flux of x through it.
    fn moments_of_round(&self, face: &Face) -> [f64; 2] {
        let Some(surface) = Unrolled::new(&face.surface) else {
            return [0.0, 0.0];
        };
        let chain = |steps: &Vec<Step>| {
            let points: Vec<_> = steps
                .iter()
                .flat_map(|step| self.points(step, FINE))
                .collect();
            surface.chain(&points)
        };
        let loops: Vec<Chain> = face.loops.iter().map(chain).collect();
        let [area, flux] = surface.moments(&loops, &self.origin);
        [area.abs(), flux]
    }

    /// The bicubic B-spline of a patch, with uniform knots that are repeated at the ends: a row of control
    /// points for each place along the first side. `None` of other faces.
    pub fn controls_of_patch(&self, face: &Face) -> Option<Vec<Vec<Vector3<f64>>>> {
        Some(self.patch(face)?.patch.rows())
    }

    /// The patch of a face, if it is one.
    fn patch(&self, face: &Face) -> Option<PatchFace> {
        PatchFace::new(face, |step| self.points(step, FINE))
    }

    /// Area of a patch, and the flux of x through it.
    fn moments_of_patch(&self, face: &Face) -> [f64; 2] {
        let patch = self.patch(face);
        patch.map_or([0.0, 0.0], |patch| patch.moments(&self.origin))
    }

    /// Area of a cap of a sphere, and the flux of x through it.
    fn moments_of_cap(&self, face: &Face) -> [f64; 2] {
        let rim = face.steps().next();
        let rim = rim.map(|step| self.points(step, FINE)).unwrap_or_default();
        let cap = Cap::new(&face.surface, &rim);
        cap.map_or([0.0, 0.0], |cap| cap.moments(&self.origin))
    }

    /// Area of a wall between two splines, and the flux of x through it.
    fn moments_of_wall(&self, face: &Face, direction: Vector3<f64>) -> [f64; 2] {
        let Some([one, other]) = face.rims() else {
            return [0.0, 0.0];
        };
        let spline = |step: &Step| self.curves[&step.curve].spline.as_ref();
        let Some((first, second)) = spline(&one).zip(spline(&other)) else {
            return [0.0, 0.0];
        };
        let rims = [(one.reversed, first), (other.reversed, second)];
        moments_of_wall(rims, &direction, &self.origin)
    }
}

/// Twice the area between an arc and its chord.
pub(crate) fn twice_segment(arc: &CircularArc) -> f64 {
    arc.radius.powi(2) * (arc.sweep() - arc.sweep().sin())
}

/// The curve of a step as the wireframe has it: `open` if others are beside it in its loop.
fn as_measured(step: &Step, open: bool, graph: &MeasuredGraph) -> ShellCurve {
    let MeasuredGraph {
        wireframe,
        arcs,
        splines,
        domes,
        ..
    } = *graph;
    let junctions = |ends| open.then(|| nearest_junctions(ends, &wireframe.junctions))?;
    match step.curve {
        CurveIndex::Edge(edge) => ShellCurve {
            ends: Some(wireframe.edges[edge]),
            ..ShellCurve::default()
        },
        CurveIndex::Arc(arc) => ShellCurve {
            ends: junctions(ends_of_arc(&arcs[arc])),
            arc: (!open || arcs[arc].sweep() > FLAT).then_some(arcs[arc]),
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
        CurveIndex::Rim(dome) => ShellCurve {
            arc: Some(domes[dome].rim()),
            ..ShellCurve::default()
        },
    }
}

/// The integral of x × dx along a spline, with x from an origin: a polynomial of degree 5 on each
/// of its pieces.
pub(crate) fn area_vector_of_spline(spline: &Spline, origin: &Vector3<f64>) -> Vector3<f64> {
    let of_piece = |piece: &[Vector3<f64>; 4]| -> Vector3<f64> {
        let of_place = |(share, weight): (f64, f64)| {
            let (point, along) = place_and_derivative(piece, share);
            (point - origin).cross(&along) * weight
        };
        GAUSS.into_iter().map(of_place).sum()
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
        // The decomposition would not end.
        if !normals.iter().chain(&heights).all(|x| x.is_finite()) {
            break;
        }
        let Ok(step) = normals.svd(true, true).solve(&heights, MIN_SINGULAR) else {
            break;
        };
        position += Vector3::new(step[0], step[1], step[2]);
    }
    position
}

/// Whether an arc goes around the axes of all round faces that it bounds, or bounds none.
fn is_rim(arc: &CircularArc, surfaces: &[Surface]) -> bool {
    let mut axes = surfaces.iter().filter_map(Surface::axis);
    axes.all(|(_, axis)| goes_around(arc, &axis))
}

/// Whether the axis of an arc is nearly in this direction, of length 1.
pub(crate) fn goes_around(arc: &CircularArc, axis: &Vector3<f64>) -> bool {
    arc.normal().cross(axis).norm() <= TILTED
}

/// The spline nearest to an arc.
fn as_spline(arc: &CircularArc) -> Option<Spline> {
    let pieces = (arc.sweep().abs() / TURN_OF_PIECES).ceil() as usize;
    let at = |share: f64| arc.point_at(arc.angles[0] + arc.sweep() * share);
    let ends = if arc.is_closed() { 0 } else { 3 };
    Spline::nearest_to(at, ends + pieces.max(1), arc.is_closed())
}

/// A spline where all surfaces are, from one vertex to the other if it is open. In planes its
/// control points move, and patches are where it is; on what is round it needs more of them.
fn spline_on_surfaces(
    spline: &Spline,
    surfaces: &[Surface],
    ends: Option<[Vector3<f64>; 2]>,
) -> Spline {
    let is_flat =
        |surface: &Surface| matches!(surface, Surface::Plane { .. } | Surface::Patch { .. });
    let mut moved = if surfaces.iter().all(is_flat) {
        spline.map(|point| on_surfaces(*point, surfaces))
    } else {
        let pieces = spline.pieces();
        let at = |share: f64| on_surfaces(spline.point_at(share * pieces as f64), surfaces);
        let controls = spline.controls.len() + pieces;
        Spline::nearest_to(at, controls, spline.closed).unwrap_or_else(|| spline.clone())
    };
    let last = moved.controls.len() - 1;
    for (control, end) in [0, last].into_iter().zip(ends.into_iter().flatten()) {
        moved.controls[control] = end;
    }
    moved
}

/// The circle of an arc in the plane of a face and around the axis of another, or where two round
/// faces of one axis meet.
fn circle_on_surfaces(arc: &CircularArc, surfaces: &[Surface], whole: bool) -> CircularArc {
    if let Some((center, radius, normal)) = circle_on_sphere(arc, surfaces) {
        return turned_as(arc, (center, radius, normal), whole);
    }
    let (mut center, mut radius) = (arc.center, arc.radius);
    let plane = surfaces.iter().find_map(|surface| match surface {
        Surface::Plane { normal, offset } => Some((*normal, *offset)),
        _ => None,
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
    turned_as(arc, (center, radius, normal), whole)
}

/// Centre, radius and normal of the circle in which a sphere meets a plane, another sphere, or a cylinder
/// of its axis; of a cone that which is on the sphere where the arc is. `None` where they do not meet.
fn circle_on_sphere(
    arc: &CircularArc,
    surfaces: &[Surface],
) -> Option<(Vector3<f64>, f64, Vector3<f64>)> {
    let mut spheres = surfaces.iter().filter_map(|surface| match surface {
        Surface::Sphere { center, radius, .. } => Some((*center, *radius)),
        _ => None,
    });
    let (center, radius) = spheres.next()?;
    // In a plane at a height along an axis through its centre.
    let across = |axis: Vector3<f64>, height: f64| {
        let squared = radius * radius - height * height;
        (squared > 0.0).then(|| (center + axis * height, squared.sqrt(), axis))
    };
    if let Some((other, of_other)) = spheres.next() {
        let (axis, apart) = (
            (other - center).try_normalize(0.0)?,
            (other - center).norm(),
        );
        let squares = radius * radius - of_other * of_other;
        return across(axis, 0.5 * (apart + squares / apart));
    }
    surfaces.iter().find_map(|surface| match surface {
        Surface::Plane { normal, offset } => across(*normal, offset - normal.dot(&center)),
        Surface::Cylinder {
            axis,
            radius: of_cylinder,
            ..
        } => {
            let height = (radius * radius - of_cylinder * of_cylinder)
                .max(0.0)
                .sqrt();
            across(*axis, height * axis.dot(&(arc.center - center)).signum())
        }
        Surface::Cone { axis, .. } => across(*axis, axis.dot(&(arc.center - center))),
        _ => None,
    })
}

/// A circle that runs as an arc does. A whole one begins where all circles around this axis do.
fn turned_as(
    arc: &CircularArc,
    (center, radius, normal): (Vector3<f64>, f64, Vector3<f64>),
    whole: bool,
) -> CircularArc {
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

/// The arc from one vertex to the other: a short one whose ends change places is no long one.
fn between(
    arc: &CircularArc,
    ends: [usize; 2],
    vertices: &BTreeMap<usize, Vector3<f64>>,
) -> CircularArc {
    let [start, end] = ends.map(|end| arc.angle_of(&vertices[&end]));
    let sweep = arc.sweep() + turn(arc.sweep(), end - start);
    CircularArc {
        angles: [start, start + sweep],
        ..*arc
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use neat_core::Wireframe3d;

    #[test]
    fn a_side_that_is_all_but_straight_changes_no_area() {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let turn = Rotation3::new(Vector3::new(0.3, -0.7, 0.5));
        let junctions: Vec<Vector3<f64>> = (corners.iter())
            .map(|[x, y]| turn * Vector3::new(*x, *y, 0.2))
            .collect();
        // In a plane that has nothing to do with that of the face.
        let [start, end] = [junctions[3], junctions[0]];
        let bow = turn * Vector3::new(0.0, 1e-6, -1e-5);
        let flat = CircularArc::through([start, 0.5 * (start + end) + bow, end]).unwrap();
        assert!(flat.radius > 1e4);
        let wireframe = Wireframe3d {
            junctions,
            edges: vec![[0, 1], [1, 2], [2, 3]],
        };
        let graph = MeasuredGraph {
            arcs: &[flat],
            ..MeasuredGraph::of(&wireframe)
        };
        let step = |curve| Step {
            curve,
            reversed: false,
        };
        let normal = turn * Vector3::z();
        let sides = [0, 1, 2].map(|edge| step(CurveIndex::Edge(edge)));
        let face = Face {
            surface: Surface::Plane {
                normal,
                offset: 0.2,
            },
            loops: vec![[&sides[..], &[step(CurveIndex::Arc(0))]].concat()],
        };
        let shell = Shell {
            closed: false,
            faces: vec![face],
        };
        let geometry = ShellGeometry::new(&shell, &graph);
        let area = geometry.area(&shell.faces[0]);
        assert!((area - 1.0).abs() < 1e-4, "{area}");
    }

    #[test]
    fn a_short_arc_stays_short_and_a_long_one_long() {
        for (sweep, by) in [(1e-4, -2e-4), (TAU - 1e-4, 2e-4), (2.0, 0.3)] {
            let arc = CircularArc {
                center: Vector3::zeros(),
                axes: [Vector3::x(), Vector3::y()],
                radius: 10.0,
                angles: [0.5, 0.5 + sweep],
            };
            let vertices =
                BTreeMap::from([(0, arc.point_at(0.5)), (1, arc.point_at(0.5 + sweep + by))]);
            let moved = between(&arc, [0, 1], &vertices);
            assert!((moved.sweep() - sweep - by).abs() < 1e-9);
        }
    }
}
