//! Faces as planar polygons.

use nalgebra::{Matrix3, Vector3};
use neat_wireframe::export::WireframeDocument;
use neat_wireframe::faces::{CurveIndex, Face, Shell, ShellGeometry, Surface};
use std::collections::BTreeMap;

/// A planar face, or a triangle of another one.
pub(super) struct Polygon {
    /// The outer ring first; the others are holes. Seen from outside, the polygon lies on the left
    /// of each. No ring comes back to its first point.
    pub rings: Vec<Vec<Vector3<f64>>>,
    /// Which face of the document it is of, counted through all shells.
    pub face: usize,
}

impl Polygon {
    /// Half the sum of p × q over all sides: along the normal, as long as the area. From a corner,
    /// as digits get lost far from the origin.
    pub fn area_vector(&self) -> Vector3<f64> {
        let origin = self.rings[0][0];
        let sides = self.rings.iter().flat_map(|ring| sides(ring));
        0.5 * sides
            .map(|[a, b]| (a - origin).cross(&(b - origin)))
            .sum::<Vector3<f64>>()
    }
}

/// The sides of a ring, from each point to the next.
pub(super) fn sides(ring: &[Vector3<f64>]) -> impl Iterator<Item = [Vector3<f64>; 2]> {
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|(a, b)| [*a, *b])
}

/// The polygons of a shell whose first face has the number `first_face`, in a frame to which
/// `turn` leads.
pub(super) fn polygons(
    shell: &Shell,
    document: &WireframeDocument,
    first_face: usize,
    turn: &Matrix3<f64>,
) -> Vec<Polygon> {
    let geometry = ShellGeometry::new(shell, &document.graph(&document.wireframe()));
    let is_round = |face: &Face| !matches!(face.surface, Surface::Plane { .. });
    let mut round = match shell.faces.iter().any(is_round) {
        true => triangles(shell, document, &geometry),
        false => BTreeMap::new(),
    };
    let mut polygons = Vec::new();
    for (place, face) in shell.faces.iter().enumerate() {
        let of_face = if is_round(face) {
            round.remove(&place).unwrap_or_default()
        } else {
            let ring = |steps: &Vec<_>| {
                let points = steps.iter().flat_map(|step| {
                    let mut points = geometry.points(step, WireframeDocument::TURN_OF_DRAWN_ARCS);
                    points.pop();
                    points
                });
                points.collect()
            };
            vec![face.loops.iter().map(ring).collect()]
        };
        polygons.extend(of_face.into_iter().map(|rings: Vec<Vec<Vector3<f64>>>| {
            let turned = |ring: Vec<Vector3<f64>>| ring.iter().map(|point| turn * point).collect();
            Polygon {
                rings: rings.into_iter().map(turned).collect(),
                face: first_face + place,
            }
        }));
    }
    polygons
}

/// The triangles of each face of a shell, between its exact vertices and arcs.
fn triangles(
    shell: &Shell,
    document: &WireframeDocument,
    geometry: &ShellGeometry,
) -> BTreeMap<usize, Vec<Vec<Vec<Vector3<f64>>>>> {
    let mut exact = WireframeDocument {
        junctions: document.junctions.clone(),
        edges: document.edges.clone(),
        arcs: document.arcs.clone(),
        splines: document.splines.clone(),
        shells: vec![shell.clone()],
        ..WireframeDocument::default()
    };
    for (junction, point) in &geometry.vertices {
        exact.junctions[*junction] = *point;
    }
    // Arcs that go around no axis are splines there.
    let mut renamed = BTreeMap::new();
    for (index, curve) in &geometry.curves {
        if let (CurveIndex::Arc(_), None, Some(spline)) = (index, curve.arc, &curve.spline) {
            renamed.insert(*index, CurveIndex::Spline(exact.splines.len()));
            exact.splines.push(spline.clone());
        }
        if let (CurveIndex::Rim(_), Some(arc)) = (index, curve.arc) {
            renamed.insert(*index, CurveIndex::Arc(exact.arcs.len()));
            exact.arcs.push(arc);
        }
        if let (CurveIndex::Arc(index), Some(arc)) = (index, curve.arc) {
            exact.arcs[*index] = arc;
        }
        if let (CurveIndex::Spline(index), Some(spline)) = (index, &curve.spline) {
            exact.splines[*index] = spline.clone();
        }
    }
    let faces = exact.shells.iter_mut().flat_map(|shell| &mut shell.faces);
    for step in faces.flat_map(|face| &mut face.loops).flatten() {
        step.curve = *renamed.get(&step.curve).unwrap_or(&step.curve);
    }
    let points = exact.drawn().junctions;
    let rings = |triangle: &[usize; 3]| vec![triangle.map(|corner| points[corner]).to_vec()];
    let of_faces = exact.triangles_of_faces().into_iter();
    let of_faces = of_faces.map(|triangles| triangles.iter().map(rings).collect());
    of_faces.enumerate().collect()
}
