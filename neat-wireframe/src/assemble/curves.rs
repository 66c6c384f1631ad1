//! The arcs of which lines are chords, each found once.

use super::circle_fitting::FoundArc;
use super::claimed_edgels::claim_edgels;
use super::coaxial_rims::coaxial_rims;
use super::config::AssembleConfig;
use super::curve_pieces::curve_pieces;
use super::edge_samples::Images;
use super::line_selection::{Chord, ChosenLine, MIN_SHOWING, Selection, select_chords};
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
use std::f64::consts::PI;
use std::ops::ControlFlow;

/// An arc that rises over its chord by no more than this share of how far edgels are off is a line.
const FLAT: f64 = 0.1;
/// Nearer to an arc than so many reaches, all along, a chord is one of its own.
const SAME: f64 = 2.0;

/// An arc all along a surer one, nearer than so many pixels, is what blur and rims make of the same
/// edge: smoothing leaves no two edges so near each other. Of parts 001 and 004 it leaves 24 and 29
/// arcs of 36 and 40, on the same length.
pub(super) const BESIDE_IN_PIXELS: f64 = 3.0;

/// The arcs that the images show, of the chords among the lines and of those that pieces of
/// curves propose.
pub(super) fn find_arcs(
    selection: &Selection,
    config: &AssembleConfig,
    progress: OnProgress<'_>,
) -> ControlFlow<(), Vec<FoundArc>> {
    let images = &selection.images;
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
    let circles = small_circles(images, &beside, config.min_evidence);
    for circle in &circles {
        images.claim_arc(circle, &mut taken);
    }
    chords.extend(rounded_corners(images, &selection.lines, &taken));
    tracing::debug!(pieces, chords = chords.len(), "curves are proposed");
    let grown = grown_arcs(images, &circles, &chords);
    let mut arcs = chosen_arcs(images, grown, taken.clone(), config.min_evidence);
    let merged = images.merge_arcs(arcs.clone());
    if merged.len() < arcs.len() {
        arcs = chosen_arcs(images, merged, taken.clone(), config.min_evidence);
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

/// Takes the arcs away that are straight lines, as far as the images can tell: those that these show as
/// they do other lines.
pub(super) fn take_straight(
    images: &Images,
    arcs: &mut Vec<FoundArc>,
    least: f64,
) -> Vec<ChosenLine> {
    let rise = |arc: &CircularArc| arc.radius * (1.0 - (0.5 * arc.sweep()).cos());
    let is_straight = |found: &FoundArc| {
        found.arc.sweep() < PI && rise(&found.arc) <= FLAT * images.reach * found.pixel
    };
    let mut lines = Vec::new();
    arcs.retain(|found| {
        if !is_straight(found) {
            return true;
        }
        let [start, end] = found.arc.angles.map(|angle| found.arc.point_at(angle));
        let line = LineSegment3::new(start, end);
        let evidence = images.evidence(&line, None, least);
        let is_shown = evidence.gain > least && evidence.showing.len() >= MIN_SHOWING;
        if is_shown {
            lines.push(ChosenLine {
                line,
                evidence,
                placed: false,
            });
        }
        !is_shown
    });
    lines
}

/// The arcs around chords, as far as the images show them, but for those along `known` ones.
fn grown_arcs(images: &Images, known: &[FoundArc], chords: &[Chord]) -> Vec<FoundArc> {
    let mut grown: Vec<FoundArc> = Vec::new();
    for Chord { arc, views } in chords {
        if !known
            .iter()
            .chain(&grown)
            .any(|other| covers(images, other, arc))
        {
            grown.extend(images.follow_arc(arc, views));
        }
    }
    grown
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
    use crate::assemble::circle_fitting::tests::found;
    use crate::assemble::test_views::{TestViews, cube_edge};

    #[test]
    fn an_arc_that_no_pixel_tells_from_a_line_is_one() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        let edge = cube_edge(0);
        let aside = edge.start + Vector3::repeat(0.1);
        // By a thirtieth of a pixel, and by three.
        let bowed = |pixels: f64| {
            let middle = edge.point_at(0.5);
            let out = (middle - aside).normalize() * pixels * found_pixel();
            found(CircularArc::through([edge.start, middle + out, edge.end]).unwrap())
        };
        let mut arcs = vec![bowed(0.03), bowed(3.0)];
        let lines = take_straight(&images, &mut arcs, 3.0);
        assert_eq!([lines.len(), arcs.len()], [1, 1]);
        assert!(lines[0].line.end_distances(&edge).iter().all(|d| *d < 1e-9));
        assert!(lines[0].evidence.gain > 20.0);
    }

    /// The size of a pixel of the arcs of tests.
    fn found_pixel() -> f64 {
        found(CircularArc::through([Vector3::x(), Vector3::y(), -Vector3::x()]).unwrap()).pixel
    }
}
