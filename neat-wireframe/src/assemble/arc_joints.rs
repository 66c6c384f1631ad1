//! Where straight edges meet arcs.
//!
//! An edge that runs into an arc ends with it at the point of tangency. Beside that point line and arc lie within the noise of each other for long, over √(2 r δ): no
//! edgel tells where one becomes the other. But the circle and the line do, each fitted to all of
//! its edgels: it is the foot of the centre on the line. Across an arc, an edge that meets nothing
//! else ends on it.

use super::circle_fitting::{FoundArc, SECTOR_IN_PIXELS};
use super::corners::{Corners, MAX_GAP, WINDOW_IN_PIXELS};
use super::edge_samples::Images;
use super::line_selection::ChosenLine;
use nalgebra::Vector3;
use neat_core::{CircularArc, LineSegment3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Line and arc end within so many lengths over which they cannot be told apart of where they
/// touch, judged: each may stop short or go on by one.
const WITHIN: f64 = 2.0;

/// A piece of a circle is there if images say this much for it, by length, of what they say for
/// the piece that they show best. Of a circle with eight scallops (`knob`) those that are there say
/// .5 of it and more, those across scallops .02 at most.
pub(super) const OF_WHOLE: f64 = 0.1;

/// A tangency of an end of a line with an end of an arc.
struct Joint {
    /// Of all tangencies of this end the nearest counts.
    distance: f64,
    line_end: usize,
    arc: usize,
    arc_end: usize,
    point: Vector3<f64>,
}

/// Moves the ends of lines and arcs that run into each other to where they touch; returns which ends
/// of the lines these are.
pub(super) fn join_tangents(
    images: &Images,
    lines: &mut [ChosenLine],
    arcs: &mut [FoundArc],
) -> Vec<[bool; 2]> {
    let mut joined = vec![[false; 2]; lines.len()];
    let joints: Vec<Vec<Joint>> = (lines.par_iter())
        .map(|chosen| {
            let joint =
                |(index, found): (usize, &FoundArc)| tangency(images, &chosen.line, found, index);
            arcs.iter().enumerate().filter_map(joint).collect()
        })
        .collect();
    for ((chosen, joints), joined) in lines.iter_mut().zip(joints).zip(&mut joined) {
        for end in 0..2 {
            let nearest = (joints.iter().filter(|joint| joint.line_end == end))
                .min_by(|a, b| a.distance.total_cmp(&b.distance));
            let Some(joint) = nearest else { continue };
            joined[end] = true;
            match end {
                0 => chosen.line.start = joint.point,
                _ => chosen.line.end = joint.point,
            }
            let arc = &mut arcs[joint.arc].arc;
            let angle = arc.angles[joint.arc_end];
            arc.angles[joint.arc_end] += wrapped(arc.angle_of(&joint.point) - angle);
        }
    }
    joined
}

/// The end of a line at which it touches the circle of an arc.
pub(super) fn runs_into(images: &Images, line: &LineSegment3, found: &FoundArc) -> Option<usize> {
    touch(line, &found.arc, MAX_GAP * images.reach * found.pixel)
        .filter(|touch| touch.distance <= touch.within)
        .map(|touch| touch.line_end)
}

/// Whether an arc rounds the corner of two lines: each runs into it at its named end, and it turns
/// by less than half a circle, or they would not meet.
pub(super) fn rounds(
    images: &Images,
    found: &FoundArc,
    lines: [&LineSegment3; 2],
    ends: [usize; 2],
) -> bool {
    let mut of_lines = lines.into_iter().zip(ends);
    found.arc.sweep() < PI
        && of_lines.all(|(line, end)| runs_into(images, line, found) == Some(end))
}

/// The place along a line at which an arc goes on from it, at most `gap` apart.
pub(super) fn touching_place(line: &LineSegment3, arc: &CircularArc, gap: f64) -> Option<f64> {
    let touch = touch(line, arc, gap)?;
    let angle = arc.angle_of(&touch.point);
    (arc.contains(angle, touch.within / arc.radius)).then(|| line.line_parameter(&touch.point))
}

/// Where a line touches a circle.
struct Touch {
    point: Vector3<f64>,
    line_end: usize,
    /// From the end of the line, and how much of it is nothing.
    distance: f64,
    within: f64,
}

/// Where a line touches the circle of an arc, if they are at most `gap` apart there.
fn touch(line: &LineSegment3, arc: &CircularArc, gap: f64) -> Option<Touch> {
    let place = line.line_parameter(&arc.center);
    let point = line.point_at(place);
    let length = line.length();
    // The circle's plane holds the line, as far as both go beside each other.
    let beside = (2.0 * arc.radius * gap).sqrt();
    let out_of_plane = (line.end - line.start).dot(&arc.normal()).abs() / length * beside;
    let line_end = usize::from(place > 0.5);
    let touch = Touch {
        point,
        line_end,
        distance: (point - line.ends()[line_end]).norm(),
        within: WITHIN * beside,
    };
    (arc.distance_to_circle(&point).max(out_of_plane) <= gap && touch.within < length)
        .then_some(touch)
}

/// The tangency of a line with an end of an arc.
fn tangency(images: &Images, line: &LineSegment3, found: &FoundArc, index: usize) -> Option<Joint> {
    let arc = &found.arc;
    let gap = MAX_GAP * images.reach * found.pixel;
    let Touch {
        point,
        line_end,
        distance,
        within,
    } = touch(line, arc, gap).filter(|_| !arc.is_closed())?;
    if distance > within {
        return None;
    }
    let outward = (line.end - line.start) * [-1.0, 1.0][line_end];
    // By how much the arc ends before the point, and goes on beyond it.
    let by = |end: usize| {
        [-1.0, 1.0][end] * arc.radius * wrapped(arc.angle_of(&point) - arc.angles[end])
    };
    let ends = [0, 1].map(|end| (by(end), end));
    let (by, arc_end) = (ends.into_iter()).min_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))?;
    let into = arc.tangent_at(arc.angle_of(&point)) * [1.0, -1.0][arc_end];
    let distance = if by.abs() <= within {
        distance.max(by.abs())
    } else if hardly_goes_on(
        images,
        found,
        arc_end,
        [-by, within].map(|by| by / arc.radius),
    ) {
        distance
    } else {
        return None;
    };
    (into.dot(&outward) > 0.0).then_some(Joint {
        distance,
        line_end,
        arc: index,
        arc_end,
        point,
    })
}

/// Whether images hardly show the last part of an arc, but for its first stretch, beside which a line
/// may lie, against the rest of it. Both are angles.
fn hardly_goes_on(images: &Images, found: &FoundArc, end: usize, [last, beside]: [f64; 2]) -> bool {
    let [from, to] = found.arc.angles;
    let (beyond, before) = match end {
        0 => ([from, from + last - beside], [from + last, to]),
        _ => ([to - last + beside, to], [from, to - last]),
    };
    // What images say of a part of an arc they say by sectors.
    let is_small = found.arc.radius < SECTOR_IN_PIXELS * found.pixel;
    if is_small || last <= beside || before[1] <= before[0] {
        return false;
    }
    let rate = |angles: [f64; 2]| {
        images.gain_along(&found.arc, angles, found.pixel, None) / (angles[1] - angles[0])
    };
    rate(beyond) < OF_WHOLE * rate(before)
}

/// An end of an arc within so many pixels of where a line meets it is there, as for 2D segments.
const ARC_END: f64 = 5.0;
/// Squared sine of the angle under which a line crosses an arc at least, 15°, judged: else it
/// runs into it.
const MIN_SQUARED_SINE: f64 = 0.067;
/// Steps from the line to the circle and back: each lowers the distance by the cosine.
const STEPS: usize = 100;

/// Moves ends of lines that meet nothing else, and run into no arc, to the arcs that they end on.
pub(super) fn end_on_arcs(images: &Images, corners: &mut Corners, arcs: &mut [FoundArc]) {
    let degrees = corners.degrees();
    for line in 0..corners.ends.len() {
        let edge = corners.edge(line);
        let gap = MAX_GAP * images.reach * corners.pixels[line];
        for (end, junction) in corners.ends[line].into_iter().enumerate() {
            if degrees[junction] > 1 {
                continue;
            }
            let mut tangencies = (arcs.iter().enumerate())
                .filter_map(|(index, found)| tangency(images, &edge, found, index));
            if tangencies.any(|joint| joint.line_end == end) {
                continue;
            }
            let nearest = (arcs.iter().enumerate())
                .filter_map(|(index, found)| {
                    let point = crossing(&edge, end, found, gap)?;
                    Some(((point - corners.junctions[junction]).norm(), index, point))
                })
                .filter(|(distance, ..)| *distance <= corners.windows[line])
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((distance, index, point)) = nearest {
                let stretch = LineSegment3::new(edge.ends()[end], point);
                let is_far = distance > WINDOW_IN_PIXELS * corners.pixels[line];
                let is_within = (0.0..1.0).contains(&edge.line_parameter(&point));
                let gain = || images.evidence(&stretch, None, f64::NEG_INFINITY).gain;
                if is_far && (is_within || gain() < 0.0) {
                    continue;
                }
                corners.junctions[junction] = point;
                let near = ARC_END * arcs[index].pixel;
                let arc = &mut arcs[index].arc;
                let off = arc
                    .angles
                    .map(|angle| wrapped(arc.angle_of(&point) - angle));
                let arc_end = usize::from(off[1].abs() < off[0].abs());
                if !arc.is_closed() && off[arc_end].abs() * arc.radius <= near {
                    arc.angles[arc_end] += off[arc_end];
                }
            }
        }
    }
}

/// The point near the end of an edge where it crosses an arc.
pub(super) fn crossing(
    edge: &LineSegment3,
    end: usize,
    found: &FoundArc,
    gap: f64,
) -> Option<Vector3<f64>> {
    let arc = &found.arc;
    let along = (edge.end - edge.start).try_normalize(0.0)?;
    let mut point = edge.ends()[end];
    for _ in 0..STEPS {
        let on_circle = arc.point_at(arc.angle_of(&point));
        point = edge.start + (on_circle - edge.start).dot(&along) * along;
    }
    let angle = arc.angle_of(&point);
    let cosine = arc.tangent_at(angle).dot(&along);
    let is_across = 1.0 - cosine * cosine >= MIN_SQUARED_SINE;
    let is_on_arc = arc.distance_to_circle(&point) <= gap
        && arc.contains(angle, ARC_END * found.pixel / arc.radius);
    (is_across && is_on_arc).then_some(point)
}

/// An angle between -π and π.
pub(super) fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::found;
    use crate::assemble::corners::find_corners;
    use crate::assemble::test_views::{TestViews, chosen};
    use crate::test_scenes::cameras_on_sphere;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    /// A quarter of a circle from (0.3, 0, 0.1) on, which runs along y there, to (0, 0.3, 0.1).
    fn quarter() -> FoundArc {
        found(CircularArc {
            center: Vector3::new(0.0, 0.0, 0.1),
            axes: [Vector3::x(), Vector3::y()],
            radius: 0.3,
            angles: [0.0, FRAC_PI_2],
        })
    }

    fn line(start: [f64; 3], end: [f64; 3]) -> LineSegment3 {
        LineSegment3::new(start.into(), end.into())
    }

    /// What `join` makes of one line and the quarter of a circle, which begins 5° late.
    fn joined(line: &LineSegment3) -> (LineSegment3, CircularArc) {
        let junctions = line.ends();
        let views = TestViews::of_edges(&cameras_on_sphere(20), &junctions, &[[0, 1]]);
        let images = views.images();
        let mut lines = [chosen(&images, line)];
        let mut arcs = [quarter()];
        arcs[0].arc.angles[0] += 0.08;
        join_tangents(&images, &mut lines, &mut arcs);
        (lines[0].line, arcs[0].arc)
    }

    #[test]
    fn a_line_and_the_arc_it_runs_into_end_where_they_touch() {
        let corner = Vector3::new(0.3, 0.0, 0.1);
        for end in [-0.02, 0.02] {
            for turned in [false, true] {
                let edge = line([0.3, -0.4, 0.1], [0.3, end, 0.1]);
                let (found, arc) = joined(&if turned { edge.reversed() } else { edge });
                let [start, end] = found.ends();
                let joint = if turned { start } else { end };
                assert!((joint - corner).norm() < 1e-9);
                assert!((arc.point_at(arc.angles[0]) - corner).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn lines_that_touch_an_arc_otherwise_are_left_alone() {
        let as_it_was = quarter().arc.angles[0] + 0.08;
        for other in [
            // Backwards, out of the plane, beside the circle, and far from its end.
            line([0.3, 0.4, 0.1], [0.3, 0.02, 0.1]),
            line([0.3, -0.4, 0.2], [0.3, 0.0, 0.1]),
            line([0.31, -0.4, 0.1], [0.31, 0.0, 0.1]),
            line([0.3, -0.5, 0.1], [0.3, -0.3, 0.1]),
        ] {
            let (found, arc) = joined(&other);
            assert_eq!(found, other);
            assert!((arc.angles[0] - as_it_was).abs() < 1e-12);
        }
    }

    #[test]
    fn an_arc_ends_where_a_line_touches_it_if_images_hardly_show_it_beyond() {
        let late = -1.2;
        for shown_from in [0.0, late] {
            let edge = line([0.3, -0.4, 0.1], [0.3, 0.0, 0.1]);
            let mut arc = quarter();
            arc.arc.angles[0] = shown_from;
            let mut points = edge.ends().to_vec();
            points.extend(arc.arc.points(0.05));
            let edges: Vec<[usize; 2]> = std::iter::once([0, 1])
                .chain((3..points.len()).map(|k| [k - 1, k]))
                .collect();
            let views = TestViews::of_edges(&cameras_on_sphere(20), &points, &edges);
            let images = views.images();
            let (mut lines, mut arcs) = ([chosen(&images, &edge)], [quarter()]);
            lines[0].line.end.y = 0.02;
            arcs[0].arc.angles[0] = late;
            join_tangents(&images, &mut lines, &mut arcs);
            let ended = [lines[0].line.end.y, arcs[0].arc.angles[0]];
            if shown_from == late {
                assert_eq!(ended, [0.02, late]);
            } else {
                assert!(ended.iter().all(|off| off.abs() < 1e-9), "{ended:?}");
            }
        }
    }

    #[test]
    fn a_free_end_comes_to_the_arc_that_it_crosses() {
        let ends_at = |edge: LineSegment3, late: f64| {
            let views = TestViews::of_edges(&cameras_on_sphere(20), &edge.ends(), &[[0, 1]]);
            let images = views.images();
            let mut corners = find_corners(&images, &[chosen(&images, &edge)], (&[], &[]));
            let mut arcs = [quarter()];
            arcs[0].arc.angles[0] += late;
            end_on_arcs(&images, &mut corners, &mut arcs);
            (corners.edge(0).end, arcs[0].arc.angles[0])
        };
        // Along x at the middle of the arc, short of it and beyond.
        let middle = 0.3 * FRAC_PI_4.sin();
        for short in [-0.01, 0.01] {
            let edge = line([-0.2, middle, 0.1], [middle - short, middle, 0.1]);
            let (end, angle) = ends_at(edge, 0.0);
            assert!((end - Vector3::new(middle, middle, 0.1)).norm() < 1e-9);
            assert!(angle.abs() < 1e-12);
        }
        // At its end, which comes along.
        let (end, angle) = ends_at(line([-0.2, 0.0, 0.1], [0.29, 0.0, 0.1]), 0.02);
        assert!((end - Vector3::new(0.3, 0.0, 0.1)).norm() < 1e-9 && angle.abs() < 1e-9);
        // Above it.
        let above = line([-0.2, middle, 0.2], [middle - 0.01, middle, 0.2]);
        assert_eq!(ends_at(above, 0.0).0, above.end);
    }

    #[test]
    fn an_end_that_runs_into_an_arc_crosses_no_other_one() {
        // The rim of a pocket within that of its block, which is round, too.
        let edge = line([0.3, -0.4, 0.1], [0.3, 0.004, 0.1]);
        let mut around = quarter();
        around.arc.radius = 0.32;
        let crossing = Vector3::new(0.3, (0.32_f64.powi(2) - 0.09).sqrt(), 0.1);
        let shown = [edge.start, crossing];
        let views = TestViews::of_edges(&cameras_on_sphere(20), &shown, &[[0, 1]]);
        let images = views.images();
        let end_of = |mut arcs: Vec<FoundArc>| {
            let mut corners = find_corners(&images, &[chosen(&images, &edge)], (&[], &[]));
            corners.windows[0] = 0.2;
            end_on_arcs(&images, &mut corners, &mut arcs);
            corners.edge(0).end
        };
        assert!((end_of(vec![around.clone()]) - crossing).norm() < 5e-3);
        assert_eq!(end_of(vec![quarter(), around]), edge.end);
    }

    #[test]
    fn no_end_goes_far_to_an_arc_where_images_show_nothing() {
        let edge = line([-0.6, 0.2, 0.1], [0.12, 0.2, 0.1]);
        let crossing = Vector3::new((0.09_f64 - 0.04).sqrt(), 0.2, 0.1);
        let end_of = |shown: &LineSegment3| {
            let views = TestViews::of_edges(&cameras_on_sphere(20), &shown.ends(), &[[0, 1]]);
            let images = views.images();
            let mut corners = find_corners(&images, &[chosen(&images, &edge)], (&[], &[]));
            corners.windows[0] = 0.2;
            end_on_arcs(&images, &mut corners, &mut [quarter()]);
            corners.edge(0).end
        };
        assert_eq!(end_of(&edge), edge.end);
        let whole = LineSegment3::new(edge.start, crossing);
        assert!((end_of(&whole) - crossing).norm() < 1e-9);
    }

    #[test]
    fn ends_that_an_arc_joins_meet_in_no_corner() {
        let mut round = quarter();
        round.arc.radius = 0.03;
        let lines = [
            line([0.03, -0.4, 0.1], [0.03, 0.0, 0.1]),
            line([0.0, 0.03, 0.1], [-0.4, 0.03, 0.1]),
        ];
        // Images show the ways to the corner.
        let [one, other] = lines.map(|line| line.ends());
        let shown = [one[0], Vector3::new(0.03, 0.03, 0.1), other[1]];
        let views = TestViews::of_edges(&cameras_on_sphere(20), &shown, &[[0, 1], [1, 2]]);
        let images = views.images();
        let chosen = lines.map(|line| chosen(&images, &line));
        let junctions = |arc: Option<FoundArc>| {
            let corners = find_corners(&images, &chosen, (arc.as_slice(), &[]));
            corners.junctions.len()
        };
        assert_eq!(junctions(None), 3);
        assert_eq!(junctions(Some(round.clone())), 4);
        // One that turns back, and one beside them.
        let mut back = round.clone();
        back.arc.angles[1] = 1.5 * PI;
        assert_eq!(junctions(Some(back)), 3);
        round.arc.center.z += 0.1;
        assert_eq!(junctions(Some(round)), 3);
    }
}
