//! Which pairs of junctions are edges. Not in the paper, which keeps what enough views show.
//!
//! A 2D segment speaks for one edge: the one that most views show. How far its segments then
//! lie beside the fitted edge is explained in two ways, as the ends at a
//! [corner](super::corner_evidence) are: by chance, for which all distances are alike, or by an
//! edge. Chords of a curve, cut elsewhere in each view, are no edge.

use super::corner_evidence::explained;
use super::edge_candidates::{Candidate, Observation, offset, projected, showing_views};
use super::rendered_lines::RenderedLine;
use crate::ViewObservation;
use neat_core::LineSegment3;
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

/// 2D segments lie so far beside their edge, half of them nearer: pixels.
const SCALE: f64 = 0.5;

/// The candidates that enough views show, each with what no edge before it has taken, and in
/// how many views that is: those of most views first, and of these the one of whose length
/// most is explained.
pub(super) fn shown(
    candidates: Vec<Candidate>,
    lines: &[RenderedLine],
    min_views: usize,
    min_score: f64,
) -> Vec<(Candidate, usize)> {
    // What is not negative is in the order of its bits.
    let strength = |length: f64, observations: &[Observation]| {
        let (views, surplus) = showing_views(observations, lines, min_score);
        (views, (surplus * length).to_bits())
    };
    let mut queue: BinaryHeap<_> = (candidates.iter().enumerate())
        .map(|(index, edge)| (strength(edge.length, &edge.observations), Reverse(index)))
        .collect();
    let mut candidates = candidates;
    let mut taken = BTreeSet::new();
    let mut shown = Vec::new();
    while let Some((before, Reverse(index))) = queue.pop() {
        let Candidate {
            length,
            observations,
            ..
        } = &mut candidates[index];
        observations.retain(|observation| !taken.contains(&observation.line));
        let now = strength(*length, observations);
        if now.0 < min_views {
            continue;
        }
        if now < before {
            queue.push((now, Reverse(index)));
            continue;
        }
        let mine = (observations.iter()).filter(|observation| observation.share > 0.5);
        taken.extend(mine.map(|observation| observation.line));
        shown.push((candidates[index].clone(), now.0));
    }
    shown
}

/// What speaks for an edge, in nats: its 2D segments lie on it, and not anywhere within
/// `max_offset` of it.
///
/// The share of them that do has been fitted, which costs half the logarithm of the number of
/// views that might show one (Schwarz's criterion).
pub(super) fn edge_evidence(
    edge: &LineSegment3,
    observations: &[Observation],
    lines: &[RenderedLine],
    views: &[ViewObservation],
    max_offset: f64,
) -> f64 {
    let offset = |observation: &Observation| {
        let line = &lines[observation.line];
        let offset = projected(edge, &views[line.view]).map_or(f64::INFINITY, |projected| {
            offset(&line.detection, &projected)
        });
        [offset]
    };
    let offsets: Vec<[f64; 1]> = observations.iter().map(offset).collect();
    let holds = |view: &&ViewObservation| edge.ends().iter().all(|end| view.camera.sees(end));
    let asked = views.iter().filter(holds).count().max(1);
    explained(&offsets, max_offset, SCALE) - 0.5 * (asked as f64).ln()
}
