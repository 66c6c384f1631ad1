//! Lines followed beyond their ends to what they would meet there: the views that show most
//! of an edge are not those that show its rest.

use super::arc_joints::touching_place;
use super::circle_fitting::FoundArc;
use super::claimed_edgels::claim_edgels;
use super::corners::{
    MAX_GAP, MAX_WINDOW_SHARE, WINDOW_IN_PIXELS, beyond_end, nearest_points, pixel_sizes,
    sliver_end,
};
use super::edge_samples::Images;
use super::line_evidence::LineEvidence;
use super::line_selection::ChosenLine;
use super::rounded_corners::MIN_SHORT_IN_PIXELS;
use neat_core::LineSegment3;
use rayon::prelude::*;

/// A line is followed by this share of its length beyond each end: how far its direction, as
/// well as it is known, leads along an edge.
const BEYOND: f64 = 1.0;
/// The nearest things ahead that are asked for: behind so many that no edgels lead to,
/// nothing is hoped for.
const MOST_AHEAD: usize = 4;

/// Makes lines longer where edgels that no line has speak for it.
pub(super) fn continue_lines(
    images: &Images,
    lines: &mut [ChosenLine],
    arcs: &[FoundArc],
    taken: &mut [Vec<bool>],
    min_evidence: f64,
) {
    let pixels = pixel_sizes(images, lines);
    let ahead: Vec<[Vec<f64>; 2]> = (0..lines.len())
        .into_par_iter()
        .map(|k| places_ahead(images, lines, arcs, &pixels, k))
        .collect();
    for (chosen, ahead) in lines.iter_mut().zip(ahead) {
        let line = chosen.line;
        let mut reached = [0.0, 1.0];
        for (reached, places) in reached.iter_mut().zip(ahead) {
            for place in places {
                let stretch = LineSegment3::new(line.point_at(*reached), line.point_at(place));
                let evidence = images.evidence(&stretch, Some(taken), min_evidence);
                if evidence.gain > min_evidence {
                    let shown = shown_until(images, &stretch, &evidence);
                    let stretch = LineSegment3::new(stretch.start, stretch.point_at(shown));
                    claim_edgels(images, &stretch, taken);
                    *reached += shown * (place - *reached);
                    if shown < 1.0 {
                        break;
                    }
                }
            }
        }
        if reached != [0.0, 1.0] {
            let whole = LineSegment3::new(line.point_at(reached[0]), line.point_at(reached[1]));
            chosen.line = images.fit(&whole, chosen.evidence.views(), images.reach);
        }
    }
}

/// How far along a stretch the images show it: all of it unless they speak against the part after
/// which the views that show most of it do not.
fn shown_until(images: &Images, stretch: &LineSegment3, evidence: &LineEvidence) -> f64 {
    let Some(shown) = images.extent(stretch, &evidence.showing, None) else {
        return 1.0;
    };
    let ends = shown.ends().map(|end| stretch.line_parameter(&end));
    let until = ends.into_iter().fold(0.0, f64::max);
    let rest = LineSegment3::new(stretch.point_at(until), stretch.end);
    let pixels = images.projected_length(&rest, evidence.views());
    let is_known = until < 1.0 && pixels > WINDOW_IN_PIXELS;
    if is_known && images.evidence(&rest, None, f64::NEG_INFINITY).gain < 0.0 {
        until
    } else {
        1.0
    }
}

/// Lengthens lines to where they end in slivers.
pub(super) fn meet_in_slivers(images: &Images, lines: &mut [ChosenLine]) {
    let pixels = pixel_sizes(images, lines);
    let before: Vec<LineSegment3> = lines.iter().map(|chosen| chosen.line).collect();
    let ends_of = |k: usize| {
        let mut reached = [0.0, 1.0];
        let others = before.iter().zip(&pixels);
        let slivers = others.filter_map(|(other, pixel)| {
            sliver_end(images, &before[k], other, pixel.max(pixels[k]))
        });
        for (place, end) in slivers {
            let farther = |place: f64| (place - 0.5).abs();
            if reached[end] == [0.0, 1.0][end] || farther(place) < farther(reached[end]) {
                reached[end] = place;
            }
        }
        reached
    };
    let reached: Vec<[f64; 2]> = (0..lines.len()).into_par_iter().map(ends_of).collect();
    for (chosen, [low, high]) in lines.iter_mut().zip(reached) {
        if [low, high] != [0.0, 1.0] {
            let line = chosen.line;
            chosen.line = LineSegment3::new(line.point_at(low), line.point_at(high));
        }
    }
}

/// Parameters, nearest first, where a line would meet others before its start and beyond its
/// end.
fn places_ahead(
    images: &Images,
    lines: &[ChosenLine],
    arcs: &[FoundArc],
    pixels: &[f64],
    k: usize,
) -> [Vec<f64>; 2] {
    let line = &lines[k].line;
    let length = line.length();
    let gap = |pixel: f64| MAX_GAP * images.reach * pixel.max(pixels[k]);
    let of_lines = (lines.iter().zip(pixels)).flat_map(|(other, pixel)| {
        let short = MIN_SHORT_IN_PIXELS * pixel.max(pixels[k]);
        meeting_places(line, &other.line, gap(*pixel), short)
    });
    let of_arcs =
        (arcs.iter()).filter_map(|found| touching_place(line, &found.arc, gap(found.pixel)));
    let mut ahead = [Vec::new(), Vec::new()];
    for place in of_lines.chain(of_arcs) {
        let (beyond, end) = beyond_end(place, length);
        if beyond > 0.0 && beyond <= BEYOND * length {
            ahead[end].push(place);
        }
    }
    for (places, sign) in ahead.iter_mut().zip([-1.0, 1.0]) {
        places.sort_by(|a: &f64, b| (sign * a).total_cmp(&(sign * b)));
        places.truncate(MOST_AHEAD);
    }
    ahead
}

/// Where a line would meet another, at most `gap` beside it: a point of the other, which may stop
/// `short` of it, too, or the ends of one that lies on the same line.
fn meeting_places(line: &LineSegment3, other: &LineSegment3, gap: f64, short: f64) -> Vec<f64> {
    if let Some(([place, on_other], distance)) = nearest_points(line, other) {
        let length = other.length();
        let (beyond, _) = beyond_end(on_other, length);
        return if distance <= gap && beyond <= short.min(MAX_WINDOW_SHARE * length) {
            vec![place]
        } else {
            Vec::new()
        };
    }
    let places = other.ends().map(|end| line.line_parameter(&end));
    let near = (other.ends().iter()).all(|end| line.distance_to_line(end) <= gap);
    if near { places.to_vec() } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::found;
    use crate::assemble::line_fitting::directions_across;
    use crate::assemble::test_views::{TestViews, chosen, cube_edge, end_distance};
    use neat_core::CircularArc;

    #[test]
    fn a_line_grows_to_what_it_meets_where_edgels_speak_for_it() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        let edge = cube_edge(0);
        let mut lines: Vec<ChosenLine> = (1..12)
            .map(|edge| chosen(&images, &cube_edge(edge)))
            .collect();
        let piece = LineSegment3::new(edge.point_at(0.3), edge.point_at(0.7));
        lines.push(chosen(&images, &piece));
        let none = images.nothing_taken();
        let all: Vec<Vec<bool>> = none.iter().map(|map| vec![true; map.len()]).collect();
        let grown = |mut taken: Vec<Vec<bool>>| {
            let mut lines = lines.clone();
            continue_lines(&images, &mut lines, &[], &mut taken, 3.0);
            lines[11].line
        };
        assert!(end_distance(&grown(none), &edge) < 0.01);
        // Others have the edgels.
        assert!(end_distance(&grown(all), &piece) < 1e-9);
    }

    #[test]
    fn a_line_grows_to_the_arc_that_it_runs_into() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        let edge = cube_edge(0);
        let along = (edge.end - edge.start).normalize();
        let across = directions_across(&edge).unwrap();
        // From the end of the edge on, toward one side of it.
        let axes = [-across.column(0).into_owned(), along];
        let radius = 0.1;
        let arc = found(CircularArc {
            center: edge.end - radius * axes[0],
            axes,
            radius,
            angles: [0.0, 1.5],
        });
        let piece = LineSegment3::new(edge.start, edge.point_at(0.7));
        let grown = |arcs: &[FoundArc]| {
            let mut lines = [chosen(&images, &piece)];
            continue_lines(&images, &mut lines, arcs, &mut images.nothing_taken(), 3.0);
            end_distance(&lines[0].line, &edge)
        };
        assert!(grown(&[arc]) < 0.01);
        assert!(grown(&[]) > 0.2);
    }

    #[test]
    fn what_the_images_speak_against_is_not_followed() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        let edge = cube_edge(0);
        let until = |from: f64, to: f64| {
            let stretch = LineSegment3::new(edge.point_at(from), edge.point_at(to));
            let evidence = images.evidence(&stretch, None, 0.0);
            shown_until(&images, &stretch, &evidence)
        };
        assert_eq!(until(0.3, 1.0), 1.0);
        // Two thirds of it are edge.
        let found = until(0.4, 1.3);
        assert!((found - 0.6 / 0.9).abs() < 0.05, "{found}");
    }

    #[test]
    fn lines_meet_others_where_these_may_end_and_pieces_of_themselves() {
        let line = |a: [f64; 3], b: [f64; 3]| LineSegment3::new(a.into(), b.into());
        let along = line([0.0; 3], [1.0, 0.0, 0.0]);
        let places = |other: LineSegment3| meeting_places(&along, &other, 0.01, 0.1);
        let across = places(line([1.5, -1.0, 0.005], [1.5, 1.0, 0.005]));
        assert!(across.len() == 1 && (across[0] - 1.5).abs() < 1e-9);
        assert!(places(line([1.5, -1.0, 0.02], [1.5, 1.0, 0.02])).is_empty());
        assert_eq!(places(line([1.5, 0.08, 0.0], [1.5, 1.0, 0.0])), across);
        assert!(places(line([1.5, 0.2, 0.0], [1.5, 1.0, 0.0])).is_empty());
        assert!(places(line([1.5, 0.08, 0.0], [1.5, 0.2, 0.0])).is_empty());
        let piece = places(line([1.4, 0.0, 0.0], [2.0, 0.005, 0.0]));
        assert!(piece.len() == 2 && (piece[0] - 1.4).abs() < 1e-9);
        assert!(places(line([1.4, 0.02, 0.0], [2.0, 0.02, 0.0])).is_empty());
    }
}
