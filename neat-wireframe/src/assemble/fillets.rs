//! Corners that an arc rounds, by the one number that is open: how far before the corner it begins.
//!
//! Where two lines are known, an arc that touches both has nothing else to tell. So of all of them
//! that one is sought beside which most edgels lie, from line to line, and asked against the sharp
//! corner and what cuts it (`corner_ways.rs`). It is fitted to the edgels with what they lie aside of both lines, too: smoothing and shading
//! move them alike along all of an edge.

use super::arc_joints::rounds;
use super::arc_pieces::OWN_SHARE;
use super::circle_fitting::{FoundArc, Sector, equal_parts};
use super::claimed_edgels::claim_edgels;
use super::corner_ways::{Corner, SPACING, Way};
use super::corners::{near_pairs, pixel_sizes};
use super::curve_samples::distance_of_curve;
use super::curves::{BESIDE_IN_PIXELS, runs_beside};
use super::edge_samples::{Images, Sample};
use super::line_evidence::Showing;
use super::line_fitting::change_by_edgels;
use super::line_selection::{ChosenLine, MIN_SHOWING};
use super::rounded_corners::NEAR;
use nalgebra::{SVector, Vector3};
use neat_core::CircularArc;
use rayon::prelude::*;

/// How far before the corner arcs that are tried begin: each by this factor farther than the last.
const STEP: f64 = 1.15;
/// Probability that something hides a corner in a view that shows both of its lines, judged.
const HIDDEN: f64 = 0.3;
/// An arc must explain the edgels so much better than the sharp corner, in nats, as for outlines: it
/// is the best of many tries.
const ADVANTAGE: f64 = 12.0;
/// Places at which an arc is asked whether it is another one.
const PLACES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// Rounds of fitting.
const ROUNDS: usize = 3;
/// Fewer edgels tell nothing of an arc.
const MIN_EDGELS: usize = 12;
/// What keeps a number where no edgel tells of it.
const RIDGE: f64 = 1e-6;

/// What all views say together, of which some may be hidden.
fn total(gains: &[f64]) -> f64 {
    let seen = |gain: &f64| {
        let most = gain.max(0.0);
        most + ((1.0 - HIDDEN) * (gain - most).exp() + HIDDEN * (-most).exp()).ln()
    };
    gains.iter().map(seen).sum()
}

/// How much better one way is than another one, by twice that half of the views which says less.
fn advantage(gains: &[f64], rival: &[f64]) -> f64 {
    let half = |half: usize| {
        let of_half =
            |gains: &[f64]| -> Vec<f64> { gains.iter().skip(half).step_by(2).copied().collect() };
        2.0 * (total(&of_half(gains)) - total(&of_half(rival)))
    };
    half(0).min(half(1))
}

/// A corner with the arc that rounds it, and how much better it is than a sharp one.
struct Rounded {
    ends: [usize; 2],
    advantage: f64,
    found: FoundArc,
}

/// Adds the arcs that round corners of lines, in place of those that are hardly known.
pub(super) fn round_corners(images: &Images, lines: &[ChosenLine], arcs: &mut Vec<FoundArc>) {
    let pixels = pixel_sizes(images, lines);
    let is_known = |corner: &Corner| {
        let pieces = corner.lines.map(|line| &lines[line].line);
        (arcs.iter())
            .any(|found| found.covariance.is_some() && rounds(images, found, pieces, corner.ends()))
    };
    let pairs = near_pairs(lines, |k| NEAR * lines[k].line.length());
    let corner = |[i, j]: [usize; 2]| {
        let pieces = [i, j].map(|line| &lines[line].line);
        Corner::between(images, [i, j], pieces, pixels[i].max(pixels[j]))
    };
    let corners: Vec<Corner> = pairs.into_par_iter().filter_map(corner).collect();
    // An end runs into one arc.
    let mut has_arc = vec![false; 2 * lines.len()];
    for corner in corners.iter().filter(|corner| is_known(corner)) {
        corner
            .ends_of_lines()
            .iter()
            .for_each(|end| has_arc[*end] = true);
    }
    let is_open = |corner: &&Corner| !corner.ends_of_lines().iter().any(|end| has_arc[*end]);
    let mut all: Vec<Rounded> = (corners.par_iter().filter(is_open))
        .filter_map(|corner| rounded(images, lines, corner))
        .collect();
    all.sort_by(|a, b| b.advantage.total_cmp(&a.advantage));
    let before = arcs.len();
    let mut added = Vec::new();
    for Rounded { ends, found, .. } in all {
        if ends.iter().any(|end| has_arc[*end]) {
            continue;
        }
        ends.iter().for_each(|end| has_arc[*end] = true);
        arcs.retain(|other| !is_again(other, &found));
        added.push(found);
    }
    tracing::debug!(
        added = added.len(),
        replaced = before - arcs.len(),
        "corners are rounded"
    );
    arcs.extend(added);
}

/// Whether another arc runs along all of the one that is `found`, or that along most of it.
fn is_again(other: &FoundArc, found: &FoundArc) -> bool {
    let near = BESIDE_IN_PIXELS * found.pixel;
    let is_beside = |place: &&f64| {
        let point = (other.arc).point_at(other.arc.angles[0] + *place * other.arc.sweep());
        let angle = found.arc.angle_of(&point);
        found.arc.distance_to_circle(&point) < near && found.arc.contains(angle, 0.0)
    };
    runs_beside(other, &found.arc, near)
        || 2 * PLACES.iter().filter(is_beside).count() > PLACES.len()
}

/// The arc that rounds a corner, if the images say that one does.
fn rounded(images: &Images, lines: &[ChosenLine], corner: &Corner) -> Option<Rounded> {
    let [one, other] = corner.lines.map(|line| &lines[line].evidence.showing);
    let both = one.iter().filter_map(|one| {
        let other = other.iter().find(|other| other.view == one.view)?;
        Some(Showing {
            view: one.view,
            chance: one.chance.max(other.chance),
        })
    });
    let views: Vec<Showing> = both.collect();
    if views.len() < MIN_SHOWING {
        return None;
    }
    let (from, gains, advantage) = best_round(images, lines, corner, &views)?;
    let odds = (HIDDEN / (1.0 - HIDDEN)).ln();
    let seen: Vec<Showing> = (views.iter().zip(&gains))
        .filter(|(_, gain)| **gain > odds)
        .map(|(showing, _)| *showing)
        .collect();
    let arc = corner.meet.arc(fitted(images, corner, from, &seen)?)?;
    Some(Rounded {
        ends: corner.ends_of_lines(),
        advantage,
        found: shown(images, lines, corner, &arc)?,
    })
}

/// Where the arc begins that explains the views best, what each says, and by how much it is better than
/// its rivals.
fn best_round(
    images: &Images,
    lines: &[ChosenLine],
    corner: &Corner,
    views: &[Showing],
) -> Option<(f64, Vec<f64>, f64)> {
    let pieces = corner.lines.map(|line| &lines[line].line);
    let others = (0..lines.len()).filter(|k| !corner.lines.contains(k));
    let cut = others.filter_map(|other| Way::cut(corner, pieces, &lines[other].line));
    let rivals = [Way::sharp(corner)].into_iter().chain(cut);
    let rivals: Vec<Vec<f64>> = rivals.map(|way| way.gains(images, views)).collect();
    // A step more on both sides: an arc that is best at a bound is none.
    let (mut from, mut tried) = (corner.bounds[0] / STEP, Vec::new());
    while from < corner.bounds[1] * STEP {
        tried.push((from, Way::round(corner, from)?.gains(images, views)));
        from *= STEP;
    }
    let best =
        (0..tried.len()).max_by(|a, b| total(&tried[*a].1).total_cmp(&total(&tried[*b].1)))?;
    let is_inner = best > 0 && best + 1 < tried.len();
    let (from, gains) = tried.swap_remove(best);
    let advantages = rivals.iter().map(|rival| advantage(&gains, rival));
    let advantage = advantages.fold(f64::INFINITY, f64::min);
    (is_inner && advantage > ADVANTAGE).then_some((from, gains, advantage))
}

/// An arc with what the images say about it, if they show all of it, and other lines do not have that:
/// a chamfer, the sides of a polygon.
fn shown(
    images: &Images,
    lines: &[ChosenLine],
    corner: &Corner,
    arc: &CircularArc,
) -> Option<FoundArc> {
    let mut taken = images.nothing_taken();
    let middle = arc.point_at(0.5 * (arc.angles[0] + arc.angles[1]));
    for (k, line) in lines.iter().enumerate() {
        if !corner.lines.contains(&k) && line.line.distance_to_point(&middle) < arc.length() {
            claim_edgels(images, &line.line, &mut taken);
        }
    }
    let third = arc.sweep() / 3.0;
    let gains = [0.0, 1.0, 2.0].map(|k| {
        let low = arc.angles[0] + k * third;
        let gain = |taken| {
            images
                .evidence_of_sector(arc, [low, low + third], taken)
                .gain
        };
        [gain(Some(&taken[..])), gain(None)]
    });
    let [own, all] = [0, 1].map(|k| gains.iter().map(|gain| gain[k]).sum::<f64>());
    if gains.iter().any(|[own, _]| *own <= 0.0) || own <= OWN_SHARE * all {
        return None;
    }
    let sectors: Vec<Sector> = (equal_parts(arc.angles, arc.length(), corner.pixel).into_iter())
        .map(|angles| Sector {
            angles,
            evidence: images.evidence_of_sector(arc, angles, Some(&taken)),
        })
        .collect();
    Some(FoundArc {
        arc: *arc,
        gain: sectors.iter().map(|sector| sector.evidence.gain).sum(),
        pixel: corner.pixel,
        sectors,
        covariance: None,
    })
}

/// Where the arc begins, by the edgels beside it, and how far these lie outward from both lines.
fn fitted(images: &Images, corner: &Corner, from: f64, views: &[Showing]) -> Option<f64> {
    let mut from = from;
    for _ in 0..ROUNDS {
        let arc = corner.meet.arc(from)?;
        let way = Way::round(corner, from)?;
        let rows: Vec<(SVector<f64, 2>, f64)> = (views.iter())
            .flat_map(|showing| rows(images, &way, &arc, showing.view))
            .collect();
        let change = change_by_edgels(&rows, MIN_EDGELS, images.reach, RIDGE, corner.pixel)?;
        from = (from + change.solution[0]).clamp(corner.bounds[0], corner.bounds[1]);
    }
    Some(from)
}

/// How the distance of each edgel from the way changes with both, and what takes it away.
fn rows(
    images: &Images,
    way: &Way<'_>,
    arc: &CircularArc,
    view: usize,
) -> Vec<(SVector<f64, 2>, f64)> {
    let camera = &images.views[view].camera;
    let row = |sample: &Sample,
               point: Vector3<f64>,
               tangent: Vector3<f64>,
               moved: Vector3<f64>,
               outward: Vector3<f64>| {
        let edgel = images.edgel(view, sample, images.reach)?;
        let position = images.maps[view].get(edgel).position.cast();
        let (distance, by_point) = distance_of_curve(camera, &point, &tangent, &position)?;
        let side = by_point.dot(&outward).signum() * by_point.norm();
        Some((SVector::from([by_point.dot(&moved), side]), -distance))
    };
    let corner = way.corner;
    let mut rows = Vec::new();
    for part in way.on_lines() {
        let samples = images.samples_of_curve(view, part, SPACING, |place| Some(way.point(place)));
        for sample in samples.into_iter().flatten() {
            let toward = corner.meet.toward[usize::from(sample.place > 0.0)];
            let outward = (corner.meet.cosine * toward - corner.meet.bisector).normalize();
            rows.extend(row(
                &sample,
                way.point(sample.place),
                toward * arc.radius,
                Vector3::zeros(),
                outward,
            ));
        }
    }
    let samples = images.samples_of_sector(view, arc, arc.angles, SPACING);
    for sample in samples.into_iter().flatten() {
        let outward = arc.toward(sample.place);
        let tangent = arc.radius * arc.tangent_at(sample.place);
        rows.extend(row(
            &sample,
            arc.point_at(sample.place),
            tangent,
            corner.meet.moved(&outward) * outward,
            outward,
        ));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, chosen};
    use crate::test_scenes::cameras_on_sphere;
    use neat_core::LineSegment3;
    use std::f64::consts::FRAC_PI_2;

    const RADIUS: f64 = 0.1;

    fn at(x: f64, y: f64) -> Vector3<f64> {
        Vector3::new(x, y, 0.1)
    }

    /// Views of a way along points, and the arcs that round the corners of lines.
    fn arcs_of(points: &[Vector3<f64>], lines: &[LineSegment3]) -> Vec<FoundArc> {
        let edges: Vec<[usize; 2]> = (1..points.len()).map(|k| [k - 1, k]).collect();
        let views = TestViews::of_edges(&cameras_on_sphere(20), points, &edges);
        let images = views.images();
        let lines: Vec<ChosenLine> = lines.iter().map(|line| chosen(&images, line)).collect();
        let mut arcs = Vec::new();
        round_corners(&images, &lines, &mut arcs);
        arcs
    }

    /// Along x to a corner at the origin, which an arc rounds, and along y; in steps of this angle.
    fn around_the_corner(step: f64) -> Vec<Vector3<f64>> {
        let rounded = CircularArc {
            center: at(-RADIUS, RADIUS),
            axes: [-Vector3::y(), Vector3::x()],
            radius: RADIUS,
            angles: [0.0, FRAC_PI_2],
        };
        let mut points = vec![at(-0.5, 0.0)];
        points.extend(rounded.points(step));
        points.push(at(0.0, 0.5));
        points
    }

    #[test]
    fn an_arc_rounds_a_corner_wherever_the_lines_end() {
        for (one, other) in [(0.0, 0.0), (0.02, -0.01), (-0.02, 0.03)] {
            let lines = [
                LineSegment3::new(at(-0.5, 0.0), at(-RADIUS - one, 0.0)),
                LineSegment3::new(at(0.0, RADIUS + other), at(0.0, 0.5)),
            ];
            let arcs = arcs_of(&around_the_corner(0.15), &lines);
            assert_eq!(arcs.len(), 1);
            let arc = arcs[0].arc;
            assert!((arc.radius - RADIUS).abs() < 1e-3, "{}", arc.radius);
            assert!((arc.center - at(-RADIUS, RADIUS)).norm() < 2e-3);
            assert!((arc.sweep() - FRAC_PI_2).abs() < 1e-9);
            assert!(arcs[0].gain > 20.0);
        }
    }

    #[test]
    fn sharp_corners_and_cut_ones_stay() {
        let [one, other] = [-0.5, 0.5];
        let sharp = [at(one, 0.0), at(0.0, 0.0), at(0.0, other)];
        let cut = [
            at(one, 0.0),
            at(-RADIUS, 0.0),
            at(0.0, RADIUS),
            at(0.0, other),
        ];
        for points in [&sharp[..], &cut, &around_the_corner(0.8)] {
            // Each may stop a little short.
            let lines: Vec<LineSegment3> = (points.windows(2))
                .map(|ends| LineSegment3::new(ends[0], ends[1]))
                .map(|line| LineSegment3::new(line.point_at(0.02), line.point_at(0.98)))
                .collect();
            assert!(arcs_of(points, &lines).is_empty());
        }
    }

    #[test]
    fn an_arc_that_is_hardly_known_gives_way() {
        let lines = [
            LineSegment3::new(at(-0.5, 0.0), at(-RADIUS, 0.0)),
            LineSegment3::new(at(0.0, RADIUS), at(0.0, 0.5)),
        ];
        let points = around_the_corner(0.15);
        let edges: Vec<[usize; 2]> = (1..points.len()).map(|k| [k - 1, k]).collect();
        let views = TestViews::of_edges(&cameras_on_sphere(20), &points, &edges);
        let images = views.images();
        let lines = lines.map(|line| chosen(&images, &line));
        let known = arcs_of(&points, &lines.clone().map(|line| line.line))[0].clone();
        let tilted = |covariance| FoundArc {
            arc: known
                .arc
                .map(|point| point + Vector3::new(0.0, 0.0, 0.01 * point.x)),
            covariance,
            ..known.clone()
        };
        for (covariance, is_kept) in [(None, false), (Some(nalgebra::Matrix4::identity()), true)] {
            let mut arcs = vec![tilted(covariance)];
            round_corners(&images, &lines, &mut arcs);
            assert_eq!(arcs.len(), 1);
            assert_eq!(arcs[0].arc == tilted(None).arc, is_kept);
        }
        // A piece of it, too, and one that goes on past its end.
        for places in [[0.2, 0.6], [0.3, 1.25]] {
            let mut arcs = vec![known.clone()];
            arcs[0].arc.angles = places.map(|place| known.arc.angles[0] + place * FRAC_PI_2);
            round_corners(&images, &lines, &mut arcs);
            assert_eq!(arcs.len(), 1, "{places:?}");
            assert!((arcs[0].arc.sweep() - FRAC_PI_2).abs() < 1e-9);
        }
    }
}
