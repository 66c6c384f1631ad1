//! Which pairs of junctions are edges. Not in the paper, which keeps what enough views show.
//!
//! A 2D segment speaks for one edge: the one that most views show. How far its segments then
//! lie beside the fitted edge is explained in two ways, as the ends at a
//! [corner](super::corner_evidence) are: by chance, for which all distances are alike, or by an
//! edge. Chords of a curve, cut elsewhere in each view, are no edge.

use super::corner_evidence::explained;
use super::edge_candidates::{Candidate, Observation, offset, showing_views};
use super::rendered_lines::RenderedLine;
use crate::ViewObservation;
use crate::projection::project_segment_in_front;
use neat_core::LineSegment3;
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

/// Of the views that show both ends of a true edge a mean of .77 to .97 show it on photographs
/// and objects; of a false one between true corners 0 to .33 on objects. With a quarter there
/// are three to five edges more of 350 on `house_1`.
const SHARE_OF_BOTH_ENDS: f64 = 0.5;
/// One view of 25 may show what is no edge. False ones of objects, which 100 views hold, are
/// shown by two or three. No other value was tried.
const SHARE_BY_CHANCE: f64 = 0.04;
/// 2D segments lie so far beside their edge, half of them nearer: pixels.
const SCALE: f64 = 0.5;

/// The candidates that enough views show, each with what no edge before it has taken, and in
/// how many views that is: those of most views first, and of these the one of whose length
/// most is explained.
pub(super) fn shown(
    mut candidates: Vec<Candidate>,
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
        let offset = project_segment_in_front(&views[line.view].camera, edge)
            .map_or(f64::INFINITY, |projected| {
                offset(&line.detection, &projected)
            });
        [offset]
    };
    let offsets: Vec<[f64; 1]> = observations.iter().map(offset).collect();
    let asked = views_holding(edge, views).max(1);
    explained(&offsets, max_offset, SCALE) - 0.5 * (asked as f64).ln()
}

/// The number of views whose images hold both ends of an edge.
pub(super) fn views_holding(edge: &LineSegment3, views: &[ViewObservation]) -> usize {
    let holds = |view: &&ViewObservation| edge.ends().iter().all(|end| view.camera.sees(end));
    views.iter().filter(holds).count()
}

/// How many views must show an edge which so many hold, and both of whose ends so many show:
/// those hide no end of it, and of the others chance makes a few show what is none.
pub(super) fn needed_views(holding: usize, showing_both_ends: usize) -> f64 {
    (SHARE_BY_CHANCE * holding as f64).max(SHARE_OF_BOTH_ENDS * showing_both_ends as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::cameras_on_sphere;
    use nalgebra::{Vector2, Vector3};
    use neat_core::LineSegment2;

    /// Lines of views 0, 1 and so on.
    fn lines(views: usize) -> Vec<RenderedLine> {
        let line = |view| RenderedLine {
            view,
            detection: LineSegment2::new(Vector2::zeros(), Vector2::x()),
            score: 0.9,
            segment: LineSegment3::new(Vector3::zeros(), Vector3::x()),
            pixel: 0.01,
        };
        (0..views).map(line).collect()
    }

    /// Seen by these lines along this stretch.
    fn candidate(junctions: [usize; 2], length: f64, seen: &[(usize, [f64; 2])]) -> Candidate {
        let observation = |(line, stretch): &(usize, [f64; 2])| Observation {
            line: *line,
            stretch: *stretch,
            share: 1.0,
        };
        Candidate {
            junctions,
            length,
            observations: seen.iter().map(observation).collect(),
        }
    }

    fn edges(shown: &[(Candidate, usize)]) -> Vec<([usize; 2], usize)> {
        (shown.iter())
            .map(|(edge, views)| (edge.junctions, *views))
            .collect()
    }

    #[test]
    fn more_views_are_needed_where_more_might_show_an_edge() {
        assert!(needed_views(40, 2) <= 2.0);
        assert!(needed_views(100, 2) > 3.0);
        assert!(needed_views(40, 8) > 3.0);
    }

    #[test]
    fn pieces_show_an_edge_together_and_less_than_half_of_it_does_not() {
        let mut lines = lines(2);
        lines[1].view = 0;
        let (first, second) = ((0, [0.0, 0.4]), (1, [0.8, 1.0]));
        let shown_by = |seen: &[(usize, [f64; 2])], min_score: f64| {
            edges(&shown(
                vec![candidate([0, 1], 1.0, seen)],
                &lines,
                1,
                min_score,
            ))
            .len()
        };
        assert_eq!(shown_by(&[first, second], 0.05), 1);
        assert_eq!(shown_by(&[first], 0.05), 0);
        assert_eq!(shown_by(&[first, second], 0.95), 0);
    }

    #[test]
    fn a_segment_speaks_for_the_edge_of_most_views() {
        let lines = lines(4);
        let all = [0.0, 1.0];
        let weak = candidate([0, 1], 1.0, &[(0, all), (1, all), (2, all)]);
        let strong = candidate([2, 3], 1.0, &[(0, all), (1, all), (2, all), (3, all)]);
        let found = shown(vec![weak, strong], &lines, 1, 0.05);
        assert_eq!(edges(&found), [([2, 3], 4)]);
    }

    #[test]
    fn of_edges_with_as_many_views_the_one_of_which_most_is_explained_comes_first() {
        let lines = lines(2);
        let half = candidate([0, 1], 0.6, &[(0, [0.0, 1.0]), (1, [0.0, 1.0])]);
        let whole = candidate([0, 2], 1.0, &[(0, [0.0, 0.95]), (1, [0.0, 0.95])]);
        let too_long = candidate([0, 3], 1.5, &[(0, [0.0, 0.65]), (1, [0.0, 0.65])]);
        let found = shown(vec![half, too_long, whole], &lines, 2, 0.05);
        assert_eq!(edges(&found), [([0, 2], 2)]);
    }

    #[test]
    fn segments_on_an_edge_speak_for_it_and_those_anywhere_beside_it_against() {
        let cameras = cameras_on_sphere(12);
        let views = crate::test_scenes::views_of_edges(&cameras, &[], &[]);
        let edge = LineSegment3::new(Vector3::new(-0.4, 0.1, 0.0), Vector3::new(0.3, 0.2, 0.1));
        let evidence = |offset: fn(usize) -> f64| {
            let line = |view: usize| {
                let seen = project_segment_in_front(&views[view].camera, &edge).unwrap();
                let along = (seen.end - seen.start).normalize();
                let aside = offset(view) * Vector2::new(-along.y, along.x);
                RenderedLine {
                    view,
                    detection: seen.map(|end| end + aside),
                    ..lines(1)[0]
                }
            };
            let lines: Vec<RenderedLine> = (0..12).map(line).collect();
            let seen: Vec<_> = (0..12).map(|line| (line, [0.0, 1.0])).collect();
            let observations = candidate([0, 1], 1.0, &seen).observations;
            edge_evidence(&edge, &observations, &lines, &views, 2.5)
        };
        assert!(evidence(|_| 0.2) > 5.0);
        assert!(evidence(|view| 0.2 * view as f64) < 0.0);
    }
}
