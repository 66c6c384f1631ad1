//! Floors of pockets: the edges of a plane once more at another depth.
//!
//! Few views look down into a pocket, and each sees other edges of its floor: too few for any one
//! of them. But one number, the depth, says where all of them are, and what stands on the corners
//! of the rim ends there. Edgels that nothing explains propose depths, the images decide about all
//! edges of a depth together.

use super::circle_fitting::FoundArc;
use super::claimed_edgels::claim_edgels;
use super::corners::Corners;
use super::curves::BESIDE_IN_PIXELS;
use super::depth_votes::free_edgels;
use super::edge_samples::Images;
use super::pocket_depths::Rim;
use nalgebra::Vector3;
use neat_core::LineSegment3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// What an edge of a floor or on a corner of the rim has to say before it counts, in nats: that it
/// is one of those that are there.
const OF_EDGE: f64 = 1.5;
/// What all of them together have to say for a depth beyond that, in nats: of a house two
/// thousand planes and depths are asked …
const OF_DEPTH: f64 = 8.0;
/// … and the edges of the floor alone: what stands on corners may be longer than the pocket is deep.
/// Without it nine parts with truth lose half a point of F.
const OF_FLOOR: f64 = 6.0;
/// One edge alone is no floor: that of its depth would be the only one.
const MIN_EDGES: usize = 2;
/// Depths tried around each proposal, as multiples of half a pixel: nearer ones show the same edgels.
const STEPS: i32 = 3;
/// Junctions so many pixels from a plane lie in it.
const IN_PLANE: f64 = 1.5;
/// Edges that meet under a smaller angle tell no plane, about 17° (sine).
const MIN_SINE_OF_PLANE: f64 = 0.3;
/// Cosine of the angle up to which directions are one: about 1.8° for what stands on a plane …
const UPRIGHT: f64 = 0.9995;
/// … and 1.1° for normals.
const SAME_NORMAL: f64 = 0.9998;

/// Adds the floors of pockets that edgels which nothing has speak for, and what stands on the
/// corners of their rims; returns how many edges.
pub(super) fn add_floors(
    images: &Images,
    corners: &mut Corners,
    taken: &mut [Vec<bool>],
    arcs: &[FoundArc],
) -> usize {
    let pixel = corners.pixel();
    let mut of_any = taken.to_vec();
    for arc in arcs {
        images.claim_arc(arc, &mut of_any);
    }
    let planes = planes(corners, pixel);
    let free = free_edgels(images, &of_any);
    let weighed = |plane| {
        let sweep = Sweep {
            images,
            plane,
            pixel,
        };
        let depths = sweep.rim(corners).depths(images, &free);
        let best =
            (depths.into_iter()).filter_map(|depth| sweep.best_near(depth, corners, &of_any));
        best.map(|(gain, depth)| (gain, depth, sweep)).collect()
    };
    let weighed: Vec<Vec<(f64, f64, Sweep)>> = planes.par_iter().map(weighed).collect();
    let mut weighed = weighed.concat();
    weighed.sort_by(|(a, ..), (b, ..)| b.total_cmp(a));
    let before = corners.ends.len();
    for (_, depth, sweep) in weighed {
        // What has been added may have its edgels and its corners.
        if let Some(floor) = sweep.floor(depth, corners, &of_any) {
            for line in add_floor(corners, &floor, depth * sweep.plane.normal, pixel) {
                claim_edgels(images, &line, taken);
                claim_edgels(images, &line, &mut of_any);
            }
        }
    }
    corners.ends.len() - before
}

/// Adds the edges of a floor that lies by `shift` from its rim; returns them.
fn add_floor(
    corners: &mut Corners,
    floor: &Floor,
    shift: Vector3<f64>,
    pixel: f64,
) -> Vec<LineSegment3> {
    let known = corners.junctions.len();
    let mut new: BTreeMap<usize, usize> = BTreeMap::new();
    let mut add = |end: usize| {
        let junctions = &mut corners.junctions;
        if end < known {
            return end;
        }
        *new.entry(end).or_insert_with(|| {
            junctions.push(junctions[end - known] + shift);
            junctions.len() - 1
        })
    };
    let pairs = (floor.pieces.iter()).map(|piece| (piece.ends.map(&mut add), pixel));
    let pairs: Vec<([usize; 2], f64)> = pairs.collect();
    let first = corners.ends.len();
    corners.add(&pairs);
    (first..corners.ends.len())
        .map(|line| corners.edge(line))
        .collect()
}

/// Edges in a plane on which some edge stands.
struct Plane {
    normal: Vector3<f64>,
    /// The edges in it.
    edges: Vec<usize>,
    /// Their corners.
    corners: BTreeSet<usize>,
}

/// The planes of edges that meet.
fn planes(corners: &Corners, pixel: f64) -> Vec<Plane> {
    let junctions = &corners.junctions;
    let edges = 0..corners.ends.len();
    let along: Vec<Vector3<f64>> = (edges.clone())
        .map(|edge| {
            let edge = corners.edge(edge);
            (edge.end - edge.start).normalize()
        })
        .collect();
    let mut planes: Vec<Plane> = Vec::new();
    for (corner, lines) in corners.lines_at() {
        let place = &junctions[corner];
        let is_in = |normal: &Vector3<f64>, junction: usize| {
            normal.dot(&(junctions[junction] - place)).abs() < IN_PLANE * pixel
        };
        let pairs = (0..lines.len()).flat_map(|i| (0..i).map(move |j| [i, j]));
        for [a, b] in pairs.map(|pair| pair.map(|k| along[lines[k]])) {
            let across = a.cross(&b);
            if across.norm() < MIN_SINE_OF_PLANE {
                continue;
            }
            let normal = across.normalize();
            let is_known = |plane: &Plane| {
                plane.normal.dot(&normal).abs() > SAME_NORMAL
                    && plane.corners.first().is_some_and(|j| is_in(&normal, *j))
            };
            let stands = |edge: &Vector3<f64>| edge.dot(&normal).abs() > UPRIGHT;
            if planes.iter().any(is_known) || !along.iter().any(stands) {
                continue;
            }
            let in_it = |edge: &usize| corners.ends[*edge].iter().all(|j| is_in(&normal, *j));
            let edges: Vec<usize> = edges.clone().filter(in_it).collect();
            planes.push(Plane {
                normal,
                corners: edges.iter().flat_map(|edge| corners.ends[*edge]).collect(),
                edges,
            });
        }
    }
    planes
}

/// An edge that a depth asks for.
#[derive(Clone, Copy)]
struct Piece {
    /// Junctions; the number of these more than a corner of the plane stands for what lies over it.
    ends: [usize; 2],
    /// What the images say for it beyond [`OF_EDGE`], in nats.
    gain: f64,
    is_floor: bool,
}

/// What the images show of the edges of a plane at some depth.
struct Floor {
    gain: f64,
    pieces: Vec<Piece>,
}

/// The edges of a plane, to be moved along its normal.
#[derive(Clone, Copy)]
struct Sweep<'a> {
    images: &'a Images<'a>,
    plane: &'a Plane,
    pixel: f64,
}

impl Sweep<'_> {
    /// Pockets are no deeper than what the junctions span.
    fn rim(&self, corners: &Corners) -> Rim {
        let Plane { normal, edges, .. } = self.plane;
        let junctions = &corners.junctions;
        let depth = |junction: &Vector3<f64>| {
            let first = self.plane.corners.first();
            let corner = first.map_or(junction, |first| &junctions[*first]);
            normal.dot(&(junction - corner)) / self.pixel
        };
        let depths = junctions.iter().map(depth);
        Rim {
            edges: edges.iter().map(|edge| corners.edge(*edge)).collect(),
            normal: *normal,
            span: depths.fold([0.0; 2], |[low, high], d| [low.min(d), high.max(d)]),
            pixel: self.pixel,
        }
    }

    /// Of the depths around a proposal that are floors, what the images say for the best one, and it.
    fn best_near(&self, depth: f64, corners: &Corners, taken: &[Vec<bool>]) -> Option<(f64, f64)> {
        (-STEPS..=STEPS)
            .map(|step| depth + 0.5 * f64::from(step) * self.pixel)
            .filter_map(|depth| Some((self.floor(depth, corners, taken)?.gain, depth)))
            .max_by(|(a, _), (b, _)| a.total_cmp(b))
    }

    /// What the images show at a depth, if it is a floor: joined to what is known by edges on the
    /// corners of the rim, or by ends at known junctions, and without ends of its own. Edgels that
    /// lines and arcs have are `taken`.
    fn floor(&self, depth: f64, corners: &Corners, taken: &[Vec<bool>]) -> Option<Floor> {
        let shift = depth * self.plane.normal;
        let known = corners.junctions.len();
        // A junction as near to a corner of the floor as no two edges are is that corner.
        let over: BTreeMap<usize, usize> = (self.plane.corners.iter())
            .map(|corner| {
                let place = corners.junctions[*corner] + shift;
                let is_there =
                    |j: &Vector3<f64>| (j - place).norm() < BESIDE_IN_PIXELS * self.pixel;
                let there = corners.junctions.iter().position(is_there);
                (*corner, there.unwrap_or(known + corner))
            })
            .collect();
        let piece = |ends: [usize; 2], line: LineSegment3, is_floor: bool| {
            let [a, b] = ends;
            let pair = [a.min(b), a.max(b)];
            if a == b || corners.pairs().any(|edge| edge == pair) {
                return None;
            }
            let images = self.images;
            let evidence = images.evidence_of(&line, |_| Some(line), Some(taken), OF_EDGE, 0);
            let gain = evidence.gain - OF_EDGE;
            (gain > 0.0).then_some(Piece {
                ends,
                gain,
                is_floor,
            })
        };
        let at_depth = |edge: &usize| {
            let ends = corners.ends[*edge].map(|end| over[&end]);
            piece(ends, corners.edge(*edge).map(|end| end + shift), true)
        };
        let mut pieces: Vec<Piece> = self.plane.edges.iter().filter_map(at_depth).collect();
        if of_floor(&pieces) <= OF_FLOOR {
            return None;
        }
        let on_corner = |(corner, over): (&usize, &usize)| {
            let place = corners.junctions[*corner];
            piece(
                [*corner, *over],
                LineSegment3::new(place, place + shift),
                false,
            )
        };
        pieces.extend(over.iter().filter_map(on_corner));
        let pieces = joined(closed(pieces, known), known);
        let place = |end: usize| {
            let over = |corner: usize| corners.junctions[corner] + shift;
            (corners.junctions.get(end).copied()).unwrap_or_else(|| over(end - known))
        };
        let pieces = straight(pieces, known, place);
        let gain = pieces.iter().map(|piece| piece.gain).sum();
        let says_enough = of_floor(&pieces) > OF_FLOOR && gain > OF_DEPTH;
        (pieces.len() >= MIN_EDGES && says_enough).then_some(Floor { gain, pieces })
    }
}

fn of_floor(pieces: &[Piece]) -> f64 {
    let floor = pieces.iter().filter(|piece| piece.is_floor);
    floor.map(|piece| piece.gain).sum()
}

/// Pieces without those that end where nothing else does, but for `known` junctions.
fn closed(mut pieces: Vec<Piece>, known: usize) -> Vec<Piece> {
    loop {
        let mut degrees: BTreeMap<usize, usize> = BTreeMap::new();
        for end in pieces.iter().flat_map(|piece| piece.ends) {
            *degrees.entry(end).or_default() += 1;
        }
        let before = pieces.len();
        pieces.retain(|piece| {
            let mut ends = piece.ends.iter();
            ends.all(|end| *end < known || degrees[end] > 1)
        });
        if pieces.len() == before {
            return pieces;
        }
    }
}

/// Pieces that go straight on at a new corner where nothing else ends are one: what cuts the rim there
/// need not cut the floor.
fn straight(
    mut pieces: Vec<Piece>,
    known: usize,
    place: impl Fn(usize) -> Vector3<f64>,
) -> Vec<Piece> {
    let ends: BTreeSet<usize> = pieces.iter().flat_map(|piece| piece.ends).collect();
    for corner in ends.into_iter().filter(|end| *end >= known) {
        let at: Vec<usize> = (0..pieces.len())
            .filter(|piece| pieces[*piece].ends.contains(&corner))
            .collect();
        let [a, b] = at[..] else {
            continue;
        };
        let far = [a, b].map(|piece| pieces[piece].ends.into_iter().find(|end| *end != corner));
        let [Some(start), Some(end)] = far else {
            continue;
        };
        let [u, v] = [start, end].map(|end| (place(end) - place(corner)).normalize());
        if u.dot(&v) < -UPRIGHT {
            pieces[a].ends = [start, end];
            pieces[a].gain += pieces[b].gain;
            pieces.remove(b);
        }
    }
    pieces
}

/// Pieces without those that nothing joins to `known` junctions.
fn joined(mut pieces: Vec<Piece>, known: usize) -> Vec<Piece> {
    let mut reached: BTreeSet<usize> = (0..known).collect();
    loop {
        let before = reached.len();
        for piece in &pieces {
            if piece.ends.iter().any(|end| reached.contains(end)) {
                reached.extend(piece.ends);
            }
        }
        if reached.len() == before {
            break;
        }
    }
    pieces.retain(|piece| reached.contains(&piece.ends[0]));
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::corners::find_corners;
    use crate::assemble::test_views::{TestViews, chosen};
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};
    use nalgebra::Rotation3;

    /// How many edges are added to the top of a cube and a post beside it, where the floor is seen
    /// turned by so much, each other edge in two of 21 views, and edges on the corners of the rim if
    /// `uprights`.
    fn added(turn: f64, uprights: bool) -> usize {
        let (mut junctions, mut edges) = cube();
        let top = junctions.clone();
        let about_z = Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
        for corner in junctions.iter_mut().filter(|corner| corner.z < 0.0) {
            *corner = about_z * *corner;
        }
        edges.push([junctions.len(), junctions.len() + 1]);
        junctions.extend([-0.5, 0.5].map(|z| Vector3::new(0.8, 0.1, z)));
        let is_known =
            |[a, b]: &[usize; 2]| *a >= top.len() || (top[*a].z > 0.0 && top[*b].z > 0.0);
        let is_upright = |[a, b]: &[usize; 2]| top[*a].z * top[*b].z < 0.0;
        let mut views = views_of_edges(&cameras_on_sphere(21), &junctions, &edges);
        for (view, observation) in views.iter_mut().enumerate() {
            observation.segments.retain(|segment| {
                let edge = &edges[segment.edge];
                is_known(edge)
                    || (segment.edge % 10 == view % 10 && (uprights || !is_upright(edge)))
            });
        }
        let prepared = views.iter().map(|view| PreparedView::new(view, 1.0, 1.0));
        let seen = TestViews::of(prepared.collect());
        let images = seen.images();
        let mut taken = images.nothing_taken();
        let known = edges.iter().filter(|edge| is_known(edge));
        let lines: Vec<_> = known
            .map(|[a, b]| chosen(&images, &LineSegment3::new(junctions[*a], junctions[*b])))
            .collect();
        for line in &lines {
            claim_edgels(&images, &line.line, &mut taken);
        }
        let mut corners = find_corners(&images, &lines, (&[], &[]));
        assert_eq!([corners.ends.len(), corners.junctions.len()], [5, 6]);
        let count = add_floors(&images, &mut corners, &mut taken, &[]);
        assert_eq!(corners.ends.len(), 5 + count);
        let is_true = |place: &Vector3<f64>| junctions.iter().any(|j| (j - place).norm() < 0.01);
        assert!(corners.junctions.iter().all(is_true));
        assert_eq!(add_floors(&images, &mut corners, &mut taken, &[]), 0);
        count
    }

    #[test]
    fn few_views_of_each_edge_tell_a_floor_together() {
        assert_eq!(added(0.0, true), 8);
        assert_eq!(
            added(0.2, true),
            0,
            "another square is no floor of this rim"
        );
        assert_eq!(added(0.0, false), 0, "nothing joins the floor to its rim");
    }

    #[test]
    fn what_cuts_the_rim_need_not_cut_the_floor() {
        let places = [0.0, 1.0, 2.0, 3.0].map(|x| Vector3::new(x, 0.0, 0.0));
        let piece = |ends: [usize; 2]| Piece {
            ends,
            gain: 2.0,
            is_floor: true,
        };
        let pieces = || [[0, 1], [2, 1], [2, 3]].map(piece).to_vec();
        let ends = |known: usize, places: &[Vector3<f64>; 4]| -> Vec<[usize; 2]> {
            let pieces = straight(pieces(), known, |end| places[end]);
            assert_eq!(of_floor(&pieces), 6.0);
            pieces.iter().map(|piece| piece.ends).collect()
        };
        assert_eq!(ends(1, &places), [[0, 3]]);
        assert_eq!(ends(2, &places), [[0, 1], [1, 3]]);
        let mut bent = places;
        bent[2].y = 0.5;
        assert_eq!(ends(0, &bent).len(), 3);
    }
}
