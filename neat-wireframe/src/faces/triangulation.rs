//! Triangles of faces, for what knows no surfaces.

use super::cap::Cap;
use super::face::{CurveIndex, Face, Shell, Step};
use super::patch::PatchFace;
use super::patch_triangulation::{cut_patch, inner_places};
use super::plane_fit::PlaneFrame;
use super::round_triangulation::cut_round;
use super::surface::Surface;
use super::walls::strip;
use earcut::Earcut;
use nalgebra::{Vector2, Vector3};

/// A corner of a loop: the index of its point, and where that lies in the plane.
type Corner = (usize, Vector2<f64>);

/// The triangles of each face, counterclockwise as seen from the side to which normals point.
/// Faces that share a curve share the points along it: the triangles of a closed shell are
/// watertight.
///
/// - `edges`: the junctions that each edge joins.
/// - `chains`: for each arc, for each spline, and for the rim of each dome, the points along it from the
///   junction at its start to that at its end; of a closed one the first comes once more.
/// - `points`: what all are indices of, with [`points_within`] at their end.
pub(crate) fn triangles(
    shells: &[Shell],
    edges: &[[usize; 2]],
    chains: [&[Vec<usize>]; 3],
    points: &[Vector3<f64>],
) -> Vec<Vec<[usize; 3]>> {
    let around = |steps: &Vec<Step>| {
        let mut indices: Vec<usize> = Vec::new();
        for step in steps {
            indices.extend(indices_along(step, edges, chains));
            indices.pop();
        }
        indices
    };
    let mut first = points.len() - points_within(shells, edges, chains, points).len();
    let of_face = |face: &Face| {
        let mut triangles = Vec::new();
        match face.surface {
            Surface::Plane { normal, offset } => {
                let frame = PlaneFrame::new(normal, offset);
                let flat = |steps: &Vec<Step>| {
                    let corner = |index: usize| (index, frame.coordinates(&points[index]));
                    around(steps).into_iter().map(corner).collect()
                };
                let loops: Vec<Vec<Corner>> = face.loops.iter().map(flat).collect();
                cut(&loops, &mut triangles);
            }
            Surface::Extruded { direction } => {
                if let Some(rims) = face.rims() {
                    let [one, other] = rims.map(|step| indices_along(&step, edges, chains));
                    strip([&one, &other], points, &direction, &mut triangles);
                }
            }
            Surface::Sphere { .. } => {
                let along = |step: &Step| indices_along(step, edges, chains);
                let mut rim = face.steps().next().map(along).unwrap_or_default();
                let closed: Vec<_> = rim.iter().map(|index| points[*index]).collect();
                if let Some(cap) = Cap::new(&face.surface, &closed) {
                    rim.pop();
                    triangles = cap.triangles(&rim, points, first);
                    first += cap.inner_points().len();
                }
            }
            Surface::Patch { .. } => {
                let along = |step: &Step| indices_along(step, edges, chains);
                first += cut_patch(face, along, points, first, &mut triangles);
            }
            Surface::Cylinder { .. } | Surface::Cone { .. } => {
                let loops: Vec<Vec<usize>> = face.loops.iter().map(around).collect();
                cut_round(&face.surface, &loops, points, &mut triangles);
            }
        }
        triangles
    };
    let faces = shells.iter().flat_map(|shell| &shell.faces);
    faces.map(of_face).collect()
}

/// The points within patches and caps, one face after the other, by those along curves: what the
/// triangles of faces need beside these.
pub(crate) fn points_within(
    shells: &[Shell],
    edges: &[[usize; 2]],
    chains: [&[Vec<usize>]; 3],
    points: &[Vector3<f64>],
) -> Vec<Vector3<f64>> {
    let faces = shells.iter().flat_map(|shell| &shell.faces);
    let along = |step: &Step| -> Vec<Vector3<f64>> {
        let indices = indices_along(step, edges, chains).into_iter();
        indices.map(|index| points[index]).collect()
    };
    let within = |face: &Face| -> Vec<Vector3<f64>> {
        if let Surface::Sphere { .. } = face.surface {
            let rim = face.steps().next().map(along).unwrap_or_default();
            let cap = Cap::new(&face.surface, &rim);
            return cap.map_or_else(Vec::new, |cap| cap.inner_points());
        }
        let patch = PatchFace::new(face, along);
        let places = patch.map_or_else(Vec::new, |patch| inner_places(&patch));
        places.into_iter().map(|(_, point)| point).collect()
    };
    faces.flat_map(within).collect()
}

/// The points along a step of a loop, both ends among them.
fn indices_along(
    step: &Step,
    edges: &[[usize; 2]],
    [arcs, splines, rims]: [&[Vec<usize>]; 3],
) -> Vec<usize> {
    let mut along = match step.curve {
        CurveIndex::Edge(edge) => edges[edge].to_vec(),
        CurveIndex::Arc(arc) => arcs[arc].clone(),
        CurveIndex::Spline(spline) => splines[spline].clone(),
        CurveIndex::Smooth(ends) => ends.to_vec(),
        CurveIndex::Rim(dome) => rims[dome].clone(),
    };
    if step.reversed {
        along.reverse();
    }
    along
}

/// Appends the triangles of a polygon with holes.
fn cut(loops: &[Vec<Corner>], triangles: &mut Vec<[usize; 3]>) {
    let corners: Vec<Corner> = loops.concat();
    let starts = loops.iter().scan(0, |count, corners| {
        *count += corners.len();
        Some(*count)
    });
    let holes: Vec<usize> = starts.take(loops.len().saturating_sub(1)).collect();
    let mut cut = Vec::new();
    let flat = corners.iter().map(|(_, at)| [at.x, at.y]);
    Earcut::new().earcut(flat, &holes, &mut cut);
    for triangle in cut.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|k| corners[triangle[k]]);
        let left = (b.1 - a.1).perp(&(c.1 - a.1)) > 0.0;
        triangles.push(if left {
            [a.0, b.0, c.0]
        } else {
            [a.0, c.0, b.0]
        });
    }
}
