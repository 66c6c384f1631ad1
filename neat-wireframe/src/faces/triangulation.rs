//! Triangles of faces, for what knows no surfaces.

use super::face::{CurveIndex, Face, Shell, Step};
use super::plane_fit::{PlaneFrame, across};
use super::surface::Surface;
use earcut::Earcut;
use nalgebra::{Vector2, Vector3};
use std::f64::consts::{PI, TAU};

/// A corner of a loop: the index of its point, and where that lies in the plane.
type Corner = (usize, Vector2<f64>);

/// The triangles of each face, counterclockwise as seen from the side to which normals point.
/// Faces that share a curve share the points along it: the triangles of a closed shell are
/// watertight.
///
/// - `edges`: the junctions that each edge joins.
/// - `chains`: for each arc, and for each spline, the points along it from the junction at its
///   start to that at its end; of a closed one the first comes once more.
/// - `points`: what all are indices of.
pub(crate) fn triangles(
    shells: &[Shell],
    edges: &[[usize; 2]],
    chains: [&[Vec<usize>]; 2],
    points: &[Vector3<f64>],
) -> Vec<Vec<[usize; 3]>> {
    let of_face = |face: &Face| {
        let mut triangles = Vec::new();
        match face.surface {
            Surface::Plane { normal, offset } => {
                let frame = PlaneFrame::new(normal, offset);
                let flat = |steps: &Vec<Step>| {
                    let mut indices: Vec<usize> = Vec::new();
                    for step in steps {
                        indices.extend(indices_along(step, edges, chains));
                        indices.pop();
                    }
                    let corner = |index: usize| (index, frame.coordinates(&points[index]));
                    indices.into_iter().map(corner).collect()
                };
                let loops: Vec<Vec<Corner>> = face.loops.iter().map(flat).collect();
                cut(&loops, &mut triangles);
            }
            Surface::Cylinder { .. } | Surface::Cone { .. } => {
                let rims: Vec<Vec<usize>> = (face.steps())
                    .filter(|step| matches!(step.curve, CurveIndex::Arc(_)))
                    .map(|step| indices_along(step, edges, chains))
                    .collect();
                if let [one, other] = &rims[..] {
                    strip(&face.surface, one, other, points, &mut triangles);
                }
            }
        }
        triangles
    };
    let faces = shells.iter().flat_map(|shell| &shell.faces);
    faces.map(of_face).collect()
}

/// The points along a step of a loop, both ends among them.
fn indices_along(
    step: &Step,
    edges: &[[usize; 2]],
    [arcs, splines]: [&[Vec<usize>]; 2],
) -> Vec<usize> {
    let mut along = match step.curve {
        CurveIndex::Edge(edge) => edges[edge].to_vec(),
        CurveIndex::Arc(arc) => arcs[arc].clone(),
        CurveIndex::Spline(spline) => splines[spline].clone(),
        CurveIndex::Smooth(ends) => ends.to_vec(),
    };
    if step.reversed {
        along.reverse();
    }
    along
}

/// Appends the triangles between two rims of a round face, from angle to angle: each shares its
/// side along the axis with the next.
fn strip(
    surface: &Surface,
    one: &[usize],
    other: &[usize],
    points: &[Vector3<f64>],
    triangles: &mut Vec<[usize; 3]>,
) {
    let (Surface::Cylinder { convex, .. } | Surface::Cone { convex, .. }) = surface else {
        return;
    };
    let Some((point, axis)) = surface.axis() else {
        return;
    };
    let [u, v] = across(&axis);
    // Along one rim the angle grows; from within it is seen the other way round.
    let sign = if *convex { 1.0 } else { -1.0 };
    let angle = |index: usize| {
        let offset = points[index] - point;
        sign * v.dot(&offset).atan2(u.dot(&offset))
    };
    let turn = |from: f64, to: f64| (to - from + PI).rem_euclid(TAU) - PI;
    let unwound = |rim: &[usize], start: f64| {
        let mut last = start;
        let mut corner = |index: &usize| {
            last += turn(last, angle(*index));
            (*index, last)
        };
        rim.iter().map(&mut corner).collect::<Vec<(usize, f64)>>()
    };
    // The loop of a hole has its rims in the other order.
    let grows = |rim: &[usize]| turn(angle(rim[0]), angle(rim[1])) > 0.0;
    let (one, other) = if grows(one) {
        (one, other)
    } else {
        (other, one)
    };
    let start = angle(one[0]);
    let one = unwound(one, start);
    // The other rim runs back, and a whole circle begins anywhere.
    let mut back: Vec<usize> = other.iter().rev().copied().collect();
    if back[0] == back[back.len() - 1] {
        back.pop();
        let apart = |place: &usize| turn(start, angle(back[*place])).abs();
        let nearest = (0..back.len()).min_by(|a, b| apart(a).total_cmp(&apart(b)));
        back.rotate_left(nearest.unwrap_or(0));
        back.push(back[0]);
    }
    let other = unwound(&back, start);
    let (mut i, mut j) = (0, 0);
    while i + 1 < one.len() || j + 1 < other.len() {
        let ahead = |rim: &[(usize, f64)], k: usize| rim.get(k + 1).map_or(f64::MAX, |c| c.1);
        if ahead(&one, i) <= ahead(&other, j) {
            triangles.push([one[i].0, one[i + 1].0, other[j].0]);
            i += 1;
        } else {
            triangles.push([one[i].0, other[j + 1].0, other[j].0]);
            j += 1;
        }
    }
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
