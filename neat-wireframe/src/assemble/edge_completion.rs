//! Edges that no pair of views can place, since all cameras lie in one plane with them, or
//! nearly: where 2D segments run from corner to corner, corners that other edges have placed.

use super::corners::Corners;
use super::edge_samples::Images;
use super::line_selection::claim_edgels;
use crate::projection::project_in_front;
use neat_core::LineSegment3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// An end of a 2D segment belongs to the nearest corner within so many pixels: detectors stop
/// short of corners by as much.
const END_DISTANCE: f64 = 5.0;
/// Views in which a 2D segment must run between the two.
const MIN_VIEWS: usize = 2;

/// Adds the edges between corners that edgels which no line has speak for; returns how many.
pub(super) fn complete_edges(
    images: &Images,
    corners: &mut Corners,
    taken: &mut [Vec<bool>],
    min_evidence: f64,
) -> usize {
    let junctions = &corners.junctions;
    let line = |[a, b]: [usize; 2]| LineSegment3::new(junctions[a], junctions[b]);
    let known: BTreeSet<[usize; 2]> = (corners.ends.iter())
        .map(|[a, b]| [*a.min(b), *a.max(b)])
        .collect();
    let mut drawn: Vec<(f64, [usize; 2])> = drawn_pairs(images, corners)
        .into_par_iter()
        .filter(|pair| !known.contains(pair))
        .map(|pair| {
            let evidence = images.evidence(&line(pair), Some(taken), min_evidence);
            (evidence.gain, pair)
        })
        .filter(|(gain, _)| *gain > min_evidence)
        .collect();
    drawn.sort_by(|(a, i), (b, j)| b.total_cmp(a).then(i.cmp(j)));
    let mut found = Vec::new();
    for (_, pair) in drawn {
        let evidence = images.evidence(&line(pair), Some(taken), min_evidence);
        if evidence.gain > min_evidence {
            claim_edgels(images, &line(pair), taken);
            found.push(pair);
        }
    }
    corners.ends.extend(&found);
    found.len()
}

/// Pairs of junctions, ascending, between which 2D segments run in enough views.
fn drawn_pairs(images: &Images, corners: &Corners) -> Vec<[usize; 2]> {
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
