//! Edges between corners that other edges have placed.
//!
//! No pair of views can place an edge if all cameras lie in one plane with it, or nearly: it is
//! asked for where 2D segments run from corner to corner. A short edge may have no 2D segment at
//! all: corners near each other are asked in any case.

use super::arc_tubes::KnownArcs;
use super::claimed_edgels::claim_edgels;
use super::corners::{Corners, MAX_GAP};
use super::edge_samples::Images;
use crate::projection::project_in_front;
use neat_core::LineSegment3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// An end of a 2D segment belongs to the nearest corner within so many pixels: detectors stop
/// short of corners by as much.
const END_DISTANCE: f64 = 5.0;
/// Views in which a 2D segment must run between the two.
const MIN_VIEWS: usize = 2;

/// Corners so many pixels from each other are asked whether an edge runs between them, judged: between
/// those farther apart most edges have 2D segments. With 30 and 120 the faces of random parts with
/// truth are the same to two thousandths; pairs however far apart cut edges that are joined later.
const NEAR: f64 = 60.0;
/// Nothing of an edge between two corners is open, but which two of them. With two, less of the faces
/// of random parts with truth is found, with none segments lose.
const FREE_VIEWS: usize = 1;

/// Adds the edges between corners that edgels which no line has speak for; returns how many.
pub(super) fn complete_edges(
    images: &Images,
    corners: &mut Corners,
    taken: &mut [Vec<bool>],
    (min_evidence, arcs): (f64, &KnownArcs),
) -> usize {
    let known: BTreeSet<[usize; 2]> = corners.pairs().collect();
    let mut pairs = drawn_pairs(images, corners);
    pairs.extend(near_junctions(corners));
    pairs.retain(|pair| !known.contains(pair));
    let found = supported(images, corners, pairs, taken, (min_evidence, arcs));
    drop_pieces(images, corners, &found);
    corners.add(&found);
    found.len()
}

/// The pairs of junctions between which edgels that no line has speak for an edge, by more than
/// `least`, and the size of a pixel there. The one with the most evidence takes its edgels first.
pub(super) fn supported(
    images: &Images,
    corners: &Corners,
    pairs: BTreeSet<[usize; 2]>,
    taken: &mut [Vec<bool>],
    (least, arcs): (f64, &KnownArcs),
) -> Vec<([usize; 2], f64)> {
    let junctions = &corners.junctions;
    let line = |[a, b]: [usize; 2]| LineSegment3::new(junctions[a], junctions[b]);
    let evidence = |pair: [usize; 2], taken: &[Vec<bool>]| {
        images.evidence_of(
            &line(pair),
            |_| Some(line(pair)),
            Some(taken),
            least,
            FREE_VIEWS,
        )
    };
    let mut weighed: Vec<(f64, [usize; 2])> = (pairs.into_par_iter())
        .map(|pair| (evidence(pair, taken).gain, pair))
        .filter(|(gain, pair)| *gain > least && !arcs.explain(images, &line(*pair), least))
        .collect();
    weighed.sort_by(|(a, i), (b, j)| b.total_cmp(a).then(i.cmp(j)));
    let mut found = Vec::new();
    for (_, pair) in weighed {
        let evidence = evidence(pair, taken);
        if evidence.gain > least {
            claim_edgels(images, &line(pair), taken);
            found.push((pair, images.pixel_size(&line(pair), evidence.views())));
        }
    }
    found
}

/// Takes away the lines that are pieces of new `edges`: from a corner of theirs to
/// an end of their own that lies on the edge.
fn drop_pieces(images: &Images, corners: &mut Corners, edges: &[([usize; 2], f64)]) {
    let junctions = &corners.junctions;
    let degrees = corners.degrees();
    let lines_at = corners.lines_at();
    let mut dropped = vec![false; corners.ends.len()];
    for (pair, _) in edges {
        let edge = LineSegment3::new(junctions[pair[0]], junctions[pair[1]]);
        for line in pair.iter().filter_map(|end| lines_at.get(end)).flatten() {
            let [a, b] = corners.ends[*line];
            let free = if pair.contains(&a) { b } else { a };
            let place = edge.line_parameter(&junctions[free]);
            let gap = edge.distance_to_line(&junctions[free]);
            let max_gap = MAX_GAP * images.reach * corners.pixels[*line];
            if degrees[free] == 1 && (0.0..1.0).contains(&place) && gap <= max_gap {
                dropped[*line] = true;
            }
        }
    }
    corners.keep(|line| !dropped[line]);
}

/// Pairs of junctions, ascending, between which 2D segments run in enough views.
fn drawn_pairs(images: &Images, corners: &Corners) -> BTreeSet<[usize; 2]> {
    let of_views: Vec<BTreeSet<[usize; 2]>> = (images.views.par_iter())
        .map(|view| {
            // Of each end of each segment the nearest corner, and how far it is.
            let mut corner_at = vec![[(f64::INFINITY, None); 2]; view.segments.len()];
            for (corner, point) in corners.junctions.iter().enumerate() {
                let Some(pixel) = project_in_front(&view.camera, point) else {
                    continue;
                };
                view.index.for_each_near(&pixel, END_DISTANCE, |segment| {
                    let ends = view.segments[segment].segment.ends();
                    for (end, nearest) in ends.iter().zip(&mut corner_at[segment]) {
                        let distance = (pixel - end).norm();
                        if distance <= END_DISTANCE && distance < nearest.0 {
                            *nearest = (distance, Some(corner));
                        }
                    }
                });
            }
            (corner_at.into_iter())
                .filter_map(|[(_, start), (_, end)]| {
                    let (a, b) = (start?, end?);
                    (a != b).then(|| [a.min(b), a.max(b)])
                })
                .collect()
        })
        .collect();
    let mut votes: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    for pair in of_views.into_iter().flatten() {
        *votes.entry(pair).or_default() += 1;
    }
    (votes.into_iter())
        .filter(|(_, views)| *views >= MIN_VIEWS)
        .map(|(pair, _)| pair)
        .collect()
}

/// Pairs of junctions, ascending, that are few pixels from each other.
fn near_junctions(corners: &Corners) -> impl Iterator<Item = [usize; 2]> {
    let junctions = &corners.junctions;
    let reach = NEAR * corners.pixel();
    let is_near = move |[a, b]: &[usize; 2]| (junctions[*a] - junctions[*b]).norm() <= reach;
    (0..junctions.len())
        .flat_map(|a| (a + 1..junctions.len()).map(move |b| [a, b]))
        .filter(is_near)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::corners::find_corners;
    use crate::assemble::test_views::{TestViews, chosen, cube_edge};
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};

    /// All edges of the cube but `left_out`, and what has the edgels.
    fn without(images: &Images, left_out: usize) -> (Corners, Vec<Vec<bool>>) {
        without_edge(images, left_out, cube_edge)
    }

    fn without_edge(
        images: &Images,
        left_out: usize,
        edge: impl Fn(usize) -> LineSegment3,
    ) -> (Corners, Vec<Vec<bool>>) {
        let mut taken = images.nothing_taken();
        let lines: Vec<_> = (0..12)
            .filter(|k| *k != left_out)
            .map(|k| chosen(images, &edge(k)))
            .collect();
        for line in &lines {
            claim_edgels(images, &line.line, &mut taken);
        }
        (find_corners(images, &lines, (&[], &[])), taken)
    }

    #[test]
    fn the_missing_edge_is_found() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        let (mut corners, mut taken) = without(&images, 7);
        let limits = (3.0, &KnownArcs::new(&[], &[]));
        assert_eq!(corners.junctions.len(), 8);
        assert_eq!(complete_edges(&images, &mut corners, &mut taken, limits), 1);
        assert_eq!(corners.ends.len(), 12);
        assert_eq!(complete_edges(&images, &mut corners, &mut taken, limits), 0);
    }

    #[test]
    fn short_edges_need_no_2d_segment() {
        let (junctions, edges) = cube();
        let added = |scale: f64| {
            let small: Vec<_> = junctions.iter().map(|corner| scale * corner).collect();
            let cameras = cameras_on_sphere(20);
            let seen = TestViews::of_edges(&cameras, &small, &edges);
            let without_segments: Vec<_> = (views_of_edges(&cameras, &small, &edges).iter())
                .map(|view| PreparedView::new(view, 1.0, f64::INFINITY))
                .collect();
            let images = Images {
                views: &without_segments,
                ..seen.images()
            };
            let edge = |k: usize| cube_edge(k).map(|end| scale * end);
            let (mut corners, mut taken) = without_edge(&images, 7, edge);
            let limits = (3.0, &KnownArcs::new(&[], &[]));
            complete_edges(&images, &mut corners, &mut taken, limits)
        };
        assert_eq!(added(0.1), 1);
        assert_eq!(added(1.0), 0, "what is longer has segments");
    }

    #[test]
    fn pieces_of_a_new_edge_go() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        let (mut corners, _) = without(&images, 7);
        let pair = [0, 1].map(|side| {
            let end = cube_edge(7).ends()[side];
            let apart = |k: &usize| (corners.junctions[*k] - end).norm();
            (0..8).min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap()
        });
        let free = corners.junctions.len();
        corners.junctions.push(cube_edge(7).point_at(0.3));
        corners.ends.push([pair[0], free]);
        corners.pixels.push(corners.pixels[0]);
        corners.windows.push(corners.windows[0]);
        let pixel = corners.pixels[0];
        drop_pieces(&images, &mut corners, &[(pair, pixel)]);
        assert_eq!(corners.ends.len(), 11);
        assert!(corners.ends.iter().flatten().all(|end| *end != free));
    }
}
