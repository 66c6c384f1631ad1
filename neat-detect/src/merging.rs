//! One segment for each image edge: duplicates go, pieces of one line are joined,
//! and segments that run into each other under a small angle end where they meet.

use crate::line_fitting::{FittedSegment, LineFitter, normal_of};
use nalgebra::Vector2;
use neat_core::LineSegment2;

/// Edges of opposite contrast, such as the two sides of a thin line, are one
/// only if they are nearer than this, in pixels.
const SAME_EDGE: f64 = 0.75;
/// The ends of joined pieces lie no farther from their common line, in pixels:
/// else they meet under an angle.
const MAX_BEND: f64 = 0.75;
/// A segment that follows another edge beyond their crossing stays this near to
/// it, in pixels.
const OVERSHOOT: f64 = 1.5;

/// Collinear segments become one if the ends of each lie no farther from the line of the
/// other, in pixels: an edge is about as wide, in small images and in large ones.
const DISTANCE: f64 = 1.5;
/// The largest angle between them, in degrees: short pieces know their direction badly.
const MAX_ANGLE: f64 = 8.0;
/// Segments under a smaller angle than this, in degrees, can follow one another's edge.
const MAX_OVERSHOOT_ANGLE: f64 = 25.0;

/// One segment for each image edge, longest first: pieces are joined, chords across
/// corners go, and what runs on beyond a crossing is cut off.
pub(crate) fn merge(segments: Vec<FittedSegment>, fitter: &LineFitter) -> Vec<FittedSegment> {
    let mut lines = join_all(segments, fitter);
    let max_sin_angle = MAX_OVERSHOOT_ANGLE.to_radians().sin();
    drop_covered(&mut lines, max_sin_angle);
    trim_overshoots(&mut lines, max_sin_angle);
    lines
}

/// Joins `segments` until no two belong together.
fn join_all(mut segments: Vec<FittedSegment>, fitter: &LineFitter) -> Vec<FittedSegment> {
    let max_sin_angle = MAX_ANGLE.to_radians().sin();
    // Two that did not belong together in one round need not be asked again.
    let mut changed = vec![true; segments.len()];
    while changed.contains(&true) {
        let mut order: Vec<usize> = (0..segments.len()).collect();
        order.sort_by(|&a, &b| {
            segments[b]
                .segment
                .length()
                .total_cmp(&segments[a].segment.length())
        });
        let mut kept: Vec<(FittedSegment, bool, bool)> = Vec::new();
        for index in order {
            let (segment, was_changed) = (&segments[index], changed[index]);
            let merged = kept.iter_mut().find_map(|(long, long_changed, changes)| {
                let asked = was_changed || *long_changed || *changes;
                let joined = asked
                    .then(|| joined(long, segment, fitter, max_sin_angle))
                    .flatten()?;
                *changes |= joined != *long;
                *long = joined;
                Some(())
            });
            if merged.is_none() {
                kept.push((segment.clone(), was_changed, false));
            }
        }
        changed = kept.iter().map(|(_, _, changes)| *changes).collect();
        segments = kept.into_iter().map(|(segment, ..)| segment).collect();
    }
    segments
}

/// The one segment that stands for both; `None` if they are two.
fn joined(
    long: &FittedSegment,
    short: &FittedSegment,
    fitter: &LineFitter,
    max_sin_angle: f64,
) -> Option<FittedSegment> {
    let direction = long.direction();
    if direction.perp(&short.direction()).abs() > max_sin_angle {
        return None;
    }
    let normal = normal_of(&direction);
    let length = long.segment.length();
    let same_way = direction.dot(&short.direction()) >= 0.0;
    let short_way = if same_way {
        short.segment
    } else {
        short.segment.reversed()
    };
    let offsets = short_way.ends().map(|end| end - long.segment.start);
    let [first, last] = offsets.map(|offset| offset.dot(&direction));
    if first > length + fitter.max_gap || last < -fitter.max_gap {
        return None;
    }
    let across = offsets.map(|offset| offset.dot(&normal).abs());
    let same_contrast = (long.change.dot(&short.change) >= 0.0) == same_way;
    let distance = if same_contrast { DISTANCE } else { SAME_EDGE };
    if across[0].max(across[1]) > distance {
        return None;
    }
    if first >= -DISTANCE && last <= length + DISTANCE {
        return Some(long.clone());
    }
    let mut whole = long.segment;
    if first < 0.0 {
        whole.start = short_way.start;
    }
    if last > length {
        whole.end = short_way.end;
    }
    fitter.fit_between_ends(&whole, DISTANCE).filter(|fitted| {
        let line = &fitted.segment;
        let off_line = |end: &Vector2<f64>| line.distance_to_line(end);
        let all_ends = long.segment.ends().into_iter().chain(short_way.ends());
        all_ends.map(|end| off_line(&end)).fold(0.0, f64::max) <= MAX_BEND
    })
}

/// Drops segments of which longer ones of about the same direction cover all:
/// chords across a corner between two long edges.
fn drop_covered(segments: &mut Vec<FittedSegment>, max_sin_angle: f64) {
    segments.sort_by(|a, b| b.segment.length().total_cmp(&a.segment.length()));
    for index in (0..segments.len()).rev() {
        let (longer, rest) = segments.split_at(index);
        let covered = rest.first().is_some_and(|segment| {
            let covering: Vec<&LineSegment2> = (longer.iter())
                .filter(|other| segment.direction().perp(&other.direction()).abs() <= max_sin_angle)
                .map(|other| &other.segment)
                .collect();
            let steps = segment.segment.length().ceil() as usize;
            (0..=steps).all(|step| {
                let point = segment.segment.point_at(step as f64 / steps as f64);
                covering
                    .iter()
                    .any(|other| other.distance_to_point(&point) <= OVERSHOOT)
            })
        });
        if covered {
            segments.remove(index);
        }
    }
}

/// Cuts off what runs on along another segment beyond the point where they meet:
/// edges that bend a little at a junction are followed too far from both sides.
/// Only pairs under an angle below `max_sin_angle` do so.
fn trim_overshoots(segments: &mut [FittedSegment], max_sin_angle: f64) {
    for i in 0..segments.len() {
        for j in 0..i {
            let [a, b] = [&segments[i].segment, &segments[j].segment];
            let sine = segments[i].direction().perp(&segments[j].direction()).abs();
            if sine > max_sin_angle {
                continue;
            }
            let Some([at_a, at_b]) = crossing(a, b) else {
                continue;
            };
            let [trimmed_a, trimmed_b] = [trimmed(a, at_a, b), trimmed(b, at_b, a)];
            segments[i].segment = trimmed_a;
            segments[j].segment = trimmed_b;
        }
    }
}

/// The parameters at which two segments cross.
fn crossing(a: &LineSegment2, b: &LineSegment2) -> Option<[f64; 2]> {
    let [along_a, along_b, between] = [a.end - a.start, b.end - b.start, b.start - a.start];
    let determinant = along_a.perp(&along_b);
    let at = [
        between.perp(&along_b) / determinant,
        between.perp(&along_a) / determinant,
    ];
    at.iter().all(|t| (0.0..=1.0).contains(t)).then_some(at)
}

/// `segment` without the shorter of the parts before and after `at`, if that part
/// keeps near to `other`.
fn trimmed(segment: &LineSegment2, at: f64, other: &LineSegment2) -> LineSegment2 {
    let crossing = segment.point_at(at);
    let near = |end| other.distance_to_point(end) <= OVERSHOOT;
    if at <= 0.5 && near(&segment.start) {
        LineSegment2::new(crossing, segment.end)
    } else if at > 0.5 && near(&segment.end) {
        LineSegment2::new(segment.start, crossing)
    } else {
        *segment
    }
}
