//! Pairs of junctions that may be joined by an edge, with the 2D segments that say so. Not in
//! the paper, where the ends of a line go to the nearest junctions: on photographs a detector
//! cuts edges, and something hides a part of them.

use super::rendered_lines::RenderedLine;
use super::settling::SettledJunction;
use crate::ViewObservation;
use crate::interval_cover::covered_length;
use crate::projection::{project_in_front, project_segment_in_front};
use nalgebra::Vector2;
use neat_core::{LineSegment2, LineSegment3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

// Guesses. With lines followed once their length in place of four times F1 at 5 cm of
// house_1 is .587 in place of .607, where two views show an edge; the others were not varied.

/// A line that a cut ends is followed so often its length.
const EXTENSION: f64 = 4.0;
/// Of a line only so much may lie beyond a junction that it runs to.
const OVERHANG: f64 = 0.1;
/// A corner nearer to an edge than this cuts it in two, if it is farther than that from both
/// ends: pixels.
const CUTS: f64 = 3.0;

/// How candidates are sought.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// How far from the junction that it runs to a line may lie in space: pixels.
    pub(super) reach: f64,
    /// A 2D segment whose ends are nearer to two junctions joins them whatever the field says:
    /// squared pixels, summed over both ends.
    pub(super) max_squared_distance: f64,
    /// A 2D segment on an edge lies nearer to its line, in the mean of both ends: pixels.
    pub(super) max_offset: f64,
}

/// Two junctions, and what may be an edge between them.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// In ascending order.
    pub(super) junctions: [usize; 2],
    /// In world units.
    pub(super) length: f64,
    pub(super) observations: Vec<Observation>,
}

/// A 2D segment on a candidate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observation {
    /// Index of its line.
    pub(super) line: usize,
    /// From where to where along the projected candidate, between 0 and 1.
    pub(super) stretch: [f64; 2],
    /// How much of the 2D segment lies beside the candidate.
    pub(super) share: f64,
}

/// All pairs that a 2D segment speaks for and no junction cuts, sorted.
pub(super) fn candidates(
    lines: &[RenderedLine],
    junctions: &[SettledJunction],
    views: &[ViewObservation],
    search: Search,
) -> Vec<Candidate> {
    let mut speaking: BTreeMap<[usize; 2], BTreeSet<usize>> = BTreeMap::new();
    let seen: Vec<Vec<SeenJunction>> = (views.par_iter())
        .map(|view| seen(junctions, view))
        .collect();
    let pairs = |(index, line): (usize, &RenderedLine)| {
        let mut pairs = along(line, junctions, search.reach);
        pairs.extend(whole(line, &seen[line.view], search.max_squared_distance));
        pairs.into_iter().map(move |pair| (pair, index))
    };
    let spoken = (lines.par_iter().enumerate()).flat_map_iter(pairs);
    for (pair, line) in spoken.collect::<Vec<_>>() {
        speaking.entry(pair).or_default().insert(line);
    }
    let candidate = |(pair, speaking): (&[usize; 2], &BTreeSet<usize>)| {
        if is_cut(*pair, junctions) {
            return None;
        }
        let [a, b] = pair.map(|junction| junctions[junction].place);
        let observation = |line: &usize| {
            observation(
                *line,
                &lines[*line],
                &LineSegment3::new(a, b),
                views,
                search.max_offset,
            )
        };
        let observations: Vec<_> = speaking.iter().filter_map(observation).collect();
        (!observations.is_empty()).then_some(Candidate {
            junctions: *pair,
            length: (b - a).norm(),
            observations,
        })
    };
    let speaking: Vec<_> = speaking.iter().collect();
    speaking.into_par_iter().filter_map(candidate).collect()
}

/// Pairs of junctions between which a line runs in space.
fn along(line: &RenderedLine, junctions: &[SettledJunction], reach: f64) -> Vec<[usize; 2]> {
    let segment = &line.segment;
    let length = segment.length();
    if length <= 0.0 {
        return Vec::new();
    }
    let direction = (segment.end - segment.start) / length;
    let near = |(index, junction): (usize, &SettledJunction)| {
        let from = junction.place - segment.start;
        let at = from.dot(&direction);
        let beyond = (-at).max(at - length).max(0.0);
        // Both ends may be off, so that a line is the less sure the farther it is followed.
        let allowed = reach * line.pixel * (1.0 + 2.0 * beyond / length.max(4.0 * line.pixel));
        let aside = (from - at * direction).norm();
        (aside < allowed && beyond < EXTENSION * length).then_some((at, index))
    };
    let mut near: Vec<(f64, usize)> = junctions.iter().enumerate().filter_map(near).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pairs = Vec::new();
    for (nth, (from, a)) in near.iter().enumerate() {
        for (to, b) in &near[nth + 1..] {
            let overlaps = *from < (1.0 - OVERHANG) * length && *to > OVERHANG * length;
            if overlaps && to - from > CUTS * line.pixel {
                pairs.push([*a.min(b), *a.max(b)]);
            }
        }
    }
    pairs
}

/// A junction, and where a view has it.
type SeenJunction = (usize, Vector2<f64>);

/// The junctions before a camera.
fn seen(junctions: &[SettledJunction], view: &ViewObservation) -> Vec<SeenJunction> {
    let seen = |(index, junction): (usize, &SettledJunction)| {
        Some((index, project_in_front(&view.camera, &junction.place)?))
    };
    junctions.iter().enumerate().filter_map(seen).collect()
}

/// Pairs of junctions at which the 2D segment of a line ends.
fn whole(line: &RenderedLine, seen: &[SeenJunction], max_squared_distance: f64) -> Vec<[usize; 2]> {
    let near = |end: Vector2<f64>| -> Vec<(usize, f64)> {
        (seen.iter())
            .map(|(index, pixel)| (*index, (pixel - end).norm_squared()))
            .filter(|(_, squared)| *squared < max_squared_distance)
            .collect()
    };
    let [starts, ends] = line.detection.ends().map(near);
    let mut pairs = Vec::new();
    for (a, to_a) in &starts {
        for (b, to_b) in &ends {
            if a != b && to_a + to_b < max_squared_distance {
                pairs.push([*a.min(b), *a.max(b)]);
            }
        }
    }
    pairs
}

/// Whether a corner lies on an edge: what runs on beyond it is another one. Of the
/// places where a detector has cut the edge none is one.
fn is_cut([a, b]: [usize; 2], junctions: &[SettledJunction]) -> bool {
    let [start, end] = [a, b].map(|junction| &junctions[junction]);
    let near = CUTS * start.pixel.max(end.pixel);
    let edge = LineSegment3::new(start.place, end.place);
    let length = edge.length();
    let margin = 4.0 / 3.0 * near;
    let mut corners = (junctions.iter()).filter(|junction| junction.corner_evidence > 0.0);
    corners.any(|junction| {
        let at = edge.line_parameter(&junction.place) * length;
        at > margin && at < length - margin && edge.distance_to_line(&junction.place) < near
    })
}

/// What a line's 2D segment says about an edge; `None` if it lies elsewhere.
fn observation(
    index: usize,
    line: &RenderedLine,
    edge: &LineSegment3,
    views: &[ViewObservation],
    max_offset: f64,
) -> Option<Observation> {
    let projected = project_segment_in_front(&views[line.view].camera, edge)?;
    if offset(&line.detection, &projected) >= max_offset {
        return None;
    }
    let mut along = (line.detection.ends()).map(|end| projected.line_parameter(&end));
    along.sort_by(f64::total_cmp);
    let stretch = along.map(|at| at.clamp(0.0, 1.0));
    let beside = stretch[1] - stretch[0];
    (beside > 0.0).then_some(Observation {
        line: index,
        stretch,
        share: beside / (along[1] - along[0]),
    })
}

/// How far a 2D segment lies beside the line of a projected edge: root of the mean square of
/// both ends, in pixels.
pub(super) fn offset(detection: &LineSegment2, projected: &LineSegment2) -> f64 {
    let squared = |end: &Vector2<f64>| projected.distance_to_line(end).powi(2);
    (0.5 * detection.ends().iter().map(squared).sum::<f64>()).sqrt()
}

/// The number of views whose 2D segments cover more than half of an edge, of those with a
/// score above `min_score`; and by how much they cover more of it than not, summed over these
/// views.
pub(super) fn showing_views(
    observations: &[Observation],
    lines: &[RenderedLine],
    min_score: f64,
) -> (usize, f64) {
    let mut stretches: BTreeMap<usize, Vec<[f64; 2]>> = BTreeMap::new();
    for Observation { line, stretch, .. } in observations {
        if lines[*line].score > min_score {
            let of_view = stretches.entry(lines[*line].view).or_default();
            of_view.push(*stretch);
        }
    }
    let surplus: Vec<f64> = (stretches.into_values())
        .map(|stretches| 2.0 * covered_length(stretches, [0.0, 1.0]) - 1.0)
        .filter(|surplus| *surplus > 0.0)
        .collect();
    (surplus.len(), surplus.iter().sum())
}
