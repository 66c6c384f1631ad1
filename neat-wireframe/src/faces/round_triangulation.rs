//! Triangles of round faces: the Delaunay triangulation of the unrolled face, cut open along a line
//! if it goes around the axis.
//!
//! It is pressed flat along the axis first, so that triangles join points at neighbouring angles:
//! they lie in the surface along its rulings, and need no points within the face.

use super::curves::TURN;
use super::polygon::{contains, segments_cross, signed_area};
use super::surface::Surface;
use super::unrolled::{Chain, Unrolled, turn, turns};
use nalgebra::{Vector2, Vector3};
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::f64::consts::TAU;

/// Corners are at one angle within so many radians: what rounding leaves.
const SAME_ANGLE: f64 = 1e-9;

/// A corner of a loop: the index of its point, and where that lies in the unrolled face.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    pub index: usize,
    pub place: Vector2<f64>,
}

impl HasPosition for Corner {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        Point2::new(self.place.x, self.place.y)
    }
}

/// A closed chain of corners, each once.
pub(super) type Ring = Vec<Corner>;

/// Appends the triangles of a round face with these loops of points, each of them once. None, if
/// they do not bound a part of the surface.
pub(super) fn cut_round(
    surface: &Surface,
    loops: &[Vec<usize>],
    points: &[Vector3<f64>],
    triangles: &mut Vec<[usize; 3]>,
) {
    let (Surface::Cylinder { convex, .. } | Surface::Cone { convex, .. }) = *surface else {
        return;
    };
    let Some(mut rings) = Unrolled::new(surface).and_then(|round| rings(&round, loops, points))
    else {
        return;
    };
    let heights = || rings.iter().flatten().map(|corner| corner.place.y);
    let (low, high) = (
        heights().fold(f64::MAX, f64::min),
        heights().fold(f64::MIN, f64::max),
    );
    for corner in rings.iter_mut().flatten() {
        corner.place.y = TURN * (corner.place.y - low) / (high - low);
    }
    for corners in between(&rings, &[]).unwrap_or_default() {
        let [a, b, c] = corners;
        triangles.push(if convex { [a, b, c] } else { [a, c, b] });
    }
}

/// The unrolled loops, the outer one first.
fn rings(round: &Unrolled, loops: &[Vec<usize>], points: &[Vector3<f64>]) -> Option<Vec<Ring>> {
    let unrolled = |indices: &Vec<usize>| -> (Chain, Ring) {
        let around = indices.iter().chain(indices.first());
        let chain = round.chain(around.map(|index| &points[*index]));
        let corners = indices.iter().zip(&chain);
        let corner = |(index, place): (&usize, &Vector2<f64>)| Corner {
            index: *index,
            place: *place,
        };
        let ring = corners.map(corner).collect();
        (chain, ring)
    };
    let all: Vec<(Chain, Ring)> = loops.iter().map(unrolled).collect();
    let around = |sign: i32| all.iter().filter(move |(chain, _)| turns(chain) == sign);
    let mut rings: Vec<Ring> = around(0).map(|(_, ring)| ring.clone()).collect();
    let [low, high] = [1, -1].map(|sign| around(sign).collect::<Vec<_>>());
    match (&low[..], &high[..]) {
        ([(_, low)], [(_, high)]) => rings.insert(0, cut_open([low, high], &all)?),
        ([], []) => {
            let area = |ring: &Ring| signed_area(&places(ring)).abs();
            rings.sort_by(|a, b| area(b).total_cmp(&area(a)));
        }
        _ => return None,
    }
    // Holes may lie a turn aside.
    let (outer, holes) = rings.split_first_mut()?;
    let outer = places(outer);
    for hole in holes {
        let first = hole.first()?.place;
        let aside = |turns: &f64| contains(&outer, &(first + Vector2::x() * *turns));
        let by = [0.0, TAU, -TAU, 2.0 * TAU, -2.0 * TAU]
            .into_iter()
            .find(aside)?;
        hole.iter_mut().for_each(|corner| corner.place.x += by);
    }
    Some(rings)
}

fn places(ring: &Ring) -> Vec<Vector2<f64>> {
    ring.iter().map(|corner| corner.place).collect()
}

/// One ring of the two that run around the axis, cut between the corners that are nearest to being
/// at one angle where no loop is in between.
fn cut_open([low, high]: [&Ring; 2], all: &[(Chain, Ring)]) -> Option<Ring> {
    let beside = |from: &Corner, to: &Corner| {
        let place = Vector2::new(from.place.x + turn(from.place.x, to.place.x), to.place.y);
        [from.place, place]
    };
    // Of each corner below the one above that is nearest in angle, and of several in height: the
    // lower one of the two at the side of a notch.
    let angle = |corner: &Corner| turn(0.0, corner.place.x);
    let mut above: Vec<(f64, usize)> = (high.iter().enumerate())
        .map(|(j, corner)| (angle(corner), j))
        .collect();
    above.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let nearest = |(i, corner): (usize, &Corner)| {
        let apart = |k: usize| {
            let (other, j) = above[k % above.len()];
            let height = (high[j].place.y - corner.place.y).abs();
            (turn(angle(corner), other).abs(), height, j)
        };
        let next = above.partition_point(|(other, _)| *other < angle(corner));
        let last = next + above.len() - 1;
        let least = apart(next).0.min(apart(last).0);
        let is_one = |(turned, ..): &(f64, f64, usize)| *turned <= least + SAME_ANGLE;
        let after = (next..next + above.len()).map(apart).take_while(is_one);
        let before = (next..=last).rev().map(apart).take_while(is_one);
        let nearest = after.chain(before).min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map(|(_, height, j)| ((least / SAME_ANGLE).round(), height, i, j))
    };
    let mut pairs: Vec<(f64, f64, usize, usize)> =
        low.iter().enumerate().filter_map(nearest).collect();
    pairs.sort_by(|a, b| {
        let by_height = a.1.total_cmp(&b.1).then((a.2, a.3).cmp(&(b.2, b.3)));
        a.0.total_cmp(&b.0).then(by_height)
    });
    let is_free = |cut: &[Vector2<f64>; 2]| {
        let pieces = all.iter().flat_map(|(chain, _)| chain.windows(2));
        !pieces.into_iter().any(|ends| {
            let by = TAU * ((cut[0].x - ends[0].x) / TAU).round();
            [by - TAU, by, by + TAU].into_iter().any(|by| {
                let piece = [ends[0], ends[1]].map(|end| end + Vector2::x() * by);
                segments_cross(cut, &piece) || touches(cut, &piece[0])
            })
        })
    };
    let (.., i, j) =
        (pairs.into_iter()).find(|(.., i, j)| is_free(&beside(&low[*i], &high[*j])))?;
    let [start, end] = beside(&low[i], &high[j]).map(|place| place.x);
    let from = |ring: &Ring, first: usize, mut x: f64| -> Ring {
        let corners = (0..=ring.len()).map(|k| ring[(first + k) % ring.len()]);
        corners
            .map(|mut corner| {
                x += turn(x, corner.place.x);
                corner.place.x = x;
                corner
            })
            .collect()
    };
    let mut ring = from(low, i, start);
    ring.extend(from(high, j, end + TAU));
    Some(ring)
}

/// Whether a corner lies on a cut, between its ends.
fn touches([from, to]: &[Vector2<f64>; 2], corner: &Vector2<f64>) -> bool {
    let (along, offset) = (to - from, corner - from);
    let share = along.dot(&offset) / along.norm_squared();
    let beside = along.perp(&offset).abs() / along.norm();
    (SAME_ANGLE..1.0 - SAME_ANGLE).contains(&share) && beside <= SAME_ANGLE
}

/// The triangles between rings, counterclockwise, with more corners within; `None` if a corner has no
/// coordinates.
pub(super) fn between(rings: &[Ring], inner: &[Corner]) -> Option<Vec<[usize; 3]>> {
    let mut mesh: ConstrainedDelaunayTriangulation<Corner> =
        ConstrainedDelaunayTriangulation::new();
    for ring in rings {
        let inserted: Result<Vec<FixedVertexHandle>, _> =
            ring.iter().map(|corner| mesh.insert(*corner)).collect();
        let inserted = inserted.ok()?;
        for (k, corner) in inserted.iter().enumerate() {
            let next = inserted[(k + 1) % inserted.len()];
            if *corner != next && mesh.can_add_constraint(*corner, next) {
                mesh.add_constraint(*corner, next);
            }
        }
    }
    for corner in inner {
        mesh.insert(*corner).ok()?;
    }
    // Whether a triangle is inside, by the sides of rings on the way to it: corners of a rim are all
    // but on a line.
    let mut beside = vec![Vec::new(); mesh.num_all_faces()];
    for side in mesh.directed_edges() {
        let [here, there] = [side, side.rev()].map(|side| side.face().fix().index());
        beside[here].push((there, side.is_constraint_edge()));
    }
    let outside = mesh.outer_face().fix().index();
    let mut inside: Vec<Option<bool>> = vec![None; beside.len()];
    inside[outside] = Some(false);
    let mut reached = vec![outside];
    while let Some(face) = reached.pop() {
        for (other, is_side) in &beside[face] {
            if inside[*other].is_none() {
                inside[*other] = inside[face].map(|inside| inside != *is_side);
                reached.push(*other);
            }
        }
    }
    let faces = mesh
        .inner_faces()
        .filter(|face| inside[face.fix().index()] == Some(true));
    let corners = faces.map(|face| face.vertices().map(|corner| corner.data().index));
    Some(corners.collect())
}
