//! The arcs of which lines are chords, each found once. Chords of what does not turn are edges.

use super::circle_fitting::FoundArc;
use super::claimed_edgels::claim_edgels;
use super::coaxial_rims::coaxial_rims;
use super::config::AssembleConfig;
use super::curve_pieces::curve_pieces;
use super::edge_samples::Images;
use super::line_evidence::LineEvidence;
use super::line_selection::{Chord, ChosenLine, Selection, select_chords};
use super::neighbours::neighbours;
use super::progress::OnProgress;
use super::proposals;
use super::rounded_corners::rounded_corners;
use super::small_circles::small_circles;
use super::view_segments::PreparedView;
use super::wander::retain_steady;
use nalgebra::Vector3;
use neat_core::{CircularArc, LineSegment3};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Nearer to an arc than so many reaches, all along, a chord is one of its own.
const SAME: f64 = 2.0;

/// An arc all along a surer one, nearer than so many pixels, is what blur and rims make of the same
/// edge: smoothing leaves no two edges so near each other. Of parts 001 and 004 it leaves 24 and 29
/// arcs of 36 and 40, on the same length.
pub(super) const BESIDE_IN_PIXELS: f64 = 3.0;

/// The arcs that the images show, of the chords among the lines and of those that pieces of
/// curves propose. Chords of what does not turn are lines.
pub(super) fn find_arcs(
    selection: &mut Selection,
    config: &AssembleConfig,
    progress: OnProgress<'_>,
) -> ControlFlow<(), Vec<FoundArc>> {
    let (images, least) = (&selection.images.clone(), config.min_evidence);
    let views: Vec<PreparedView> = (images.views.par_iter().zip(images.maps))
        .zip(&selection.taken)
        .map(|((view, map), taken)| view.with_segments(&curve_pieces(map, |edgel| !taken[edgel])))
        .collect();
    let pieces: usize = views.iter().map(|view| view.segments.len()).sum();
    let with_pieces = Images {
        views: &views,
        ..*images
    };
    let alternatives = proposals(&views, None, config);
    let mut chords = selection.chords.clone();
    chords.extend(select_chords(
        with_pieces,
        &alternatives,
        selection,
        config,
        progress,
    )?);
    let mut taken = images.nothing_taken();
    for line in &selection.lines {
        claim_edgels(images, &line.line, &mut taken);
    }
    let beside = neighbours(images.views, config.ball_margin, config.neighbours);
    let circles = small_circles(images, &beside, least);
    for circle in &circles {
        images.claim_arc(circle, &mut taken);
    }
    chords.extend(rounded_corners(images, &selection.lines, &taken));
    tracing::debug!(pieces, chords = chords.len(), "curves are proposed");
    let (grown, lines) = grown_arcs(images, &circles, &chords, least);
    let lines = shown_lines(images, &lines, &mut taken, least);
    for line in &lines {
        claim_edgels(images, &line.line, &mut selection.taken);
    }
    selection.lines.extend(lines);
    let mut arcs = chosen_arcs(images, grown, taken.clone(), least);
    let merged = images.merge_arcs(arcs.clone());
    if merged.len() < arcs.len() {
        arcs = chosen_arcs(images, merged, taken.clone(), least);
    }
    arcs.extend(circles);
    for arc in &arcs {
        images.claim_arc(arc, &mut taken);
    }
    let ends = selection.lines.iter().flat_map(|found| found.line.ends());
    let places: Vec<Vector3<f64>> = ends
        .chain(arcs.iter().map(|found| found.arc.center))
        .collect();
    arcs.extend(coaxial_rims(images, &arcs, &places, taken));
    retain_steady(images, &mut arcs);
    ControlFlow::Continue(arcs)
}

/// The arcs around chords, as far as the images show them, but for those along `known` ones; and
/// the lines along which they do not turn.
fn grown_arcs(
    images: &Images,
    known: &[FoundArc],
    chords: &[Chord],
    least: f64,
) -> (Vec<FoundArc>, Vec<LineSegment3>) {
    let (mut grown, mut lines) = (Vec::<FoundArc>::new(), Vec::new());
    for Chord { arc, views, line } in chords {
        let mut all = known.iter().chain(&grown);
        if all.any(|other| covers(images, other, arc)) {
            continue;
        }
        let Some(found) = images.follow_arc(arc, views) else {
            continue;
        };
        if images.gain_by_turning(&found) > least {
            grown.push(found);
        } else {
            let [start, end] = found.arc.angles.map(|angle| found.arc.point_at(angle));
            lines.push(LineSegment3::new(start, end));
            lines.extend(*line);
        }
    }
    (grown, lines)
}

/// Those lines that the images show, as edges, the surest first; they take their edgels.
fn shown_lines(
    images: &Images,
    lines: &[LineSegment3],
    taken: &mut [Vec<bool>],
    least: f64,
) -> Vec<ChosenLine> {
    let mut asked: Vec<(LineEvidence, &LineSegment3)> = (lines.par_iter())
        .map(|line| (images.evidence(line, Some(taken), least), line))
        .collect();
    asked.sort_by(|(one, _), (other, _)| other.gain.total_cmp(&one.gain));
    let mut shown = Vec::new();
    for (_, line) in asked {
        let evidence = images.evidence(line, Some(taken), least);
        if let Some(found) = images.settle_line(line, evidence, taken, least)
            && images.tube(&found.line, &found.evidence).is_none()
        {
            claim_edgels(images, &found.line, taken);
            shown.push(found);
        }
    }
    shown
}

/// The arcs that the images speak for most, one after the other, each by edgels that none before
/// it has.
fn chosen_arcs(
    images: &Images,
    mut grown: Vec<FoundArc>,
    mut taken: Vec<Vec<bool>>,
    least: f64,
) -> Vec<FoundArc> {
    grown.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut chosen = Vec::new();
    for arc in grown {
        if let Some(settled) = images.settle_arc(&arc, &taken)
            && settled.gain > least
        {
            images.claim_arc(&settled, &mut taken);
            let is_again = chosen
                .iter()
                .any(|other| runs_beside(other, &settled.arc, BESIDE_IN_PIXELS * settled.pixel));
            if !is_again && !images.is_outline(&settled.arc, settled.pixel) {
                chosen.push(settled);
            }
        }
    }
    chosen
}

/// Whether an arc runs along another one.
fn covers(images: &Images, whole: &FoundArc, part: &CircularArc) -> bool {
    runs_beside(whole, part, SAME * images.reach * whole.pixel)
}

/// Whether all of an arc is at most so far from another one.
pub(super) fn runs_beside(whole: &FoundArc, part: &CircularArc, near: f64) -> bool {
    [0.1, 0.5, 0.9].iter().all(|place| {
        let point = part.point_at(part.angles[0] + place * part.sweep());
        whole.arc.distance_to_circle(&point) < near
            && whole
                .arc
                .contains(whole.arc.angle_of(&point), near / whole.arc.radius)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::{arc, views_of_arcs};
    use crate::assemble::test_views::{TestViews, cube_edge};

    #[test]
    fn the_chord_of_an_arc_that_does_not_turn_is_an_edge() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        let edge = cube_edge(0);
        let out = (edge.point_at(0.5) - edge.start - Vector3::repeat(0.1)).normalize();
        let points = [edge.start, edge.point_at(0.5) + 1e-4 * out, edge.end];
        let chord = Chord {
            arc: CircularArc::through(points).unwrap(),
            views: (0..20).collect(),
            line: Some(LineSegment3::new(edge.point_at(0.3), edge.point_at(0.6))),
        };
        let (grown, lines) = grown_arcs(&images, &[], &[chord], 3.0);
        assert_eq!([grown.len(), lines.len()], [0, 2]);
        // Both are the edge, which is found once.
        let shown = shown_lines(&images, &lines, &mut images.nothing_taken(), 3.0);
        assert_eq!(shown.len(), 1);
        assert!(shown[0].evidence.gain > 20.0);
        let off = shown[0].line.end_distances(&edge);
        assert!(off.iter().all(|off| *off < 0.02), "{off:?}");
    }

    #[test]
    fn an_arc_that_turns_grows() {
        let views = views_of_arcs(20, |_| arc(1.5));
        let part = CircularArc {
            angles: [0.4, 0.9],
            ..arc(1.5)
        };
        let chord = Chord {
            arc: part,
            views: (0..20).collect(),
            line: None,
        };
        let (grown, lines) = grown_arcs(&views.images(), &[], &[chord.clone(), chord], 3.0);
        assert_eq!([grown.len(), lines.len()], [1, 0]);
    }
}
