//! Corners that an arc rounds, by the one number that is open: how far before the corner it begins.
//!
//! Where two lines are known, an arc that touches both has nothing else to tell. So of all of them
//! that one is sought beside which most edgels lie, from line to line, and asked against the sharp
//! corner. It is fitted to the edgels with what they lie aside of both lines, too: smoothing and shading
//! move them alike along all of an edge.

use super::arc_joints::rounds;
use super::arc_pieces::OWN_SHARE;
use super::circle_fitting::{FoundArc, SECTOR_IN_PIXELS, Sector, equal_parts};
use super::claimed_edgels::claim_edgels;
use super::corners::{
    MAX_GAP, MAX_WINDOW_SHARE, WINDOW_IN_PIXELS, beyond_end, nearest_points, pixel_sizes,
};
use super::curve_samples::distance_of_curve;
use super::curves::{BESIDE_IN_PIXELS, runs_beside};
use super::edge_samples::{Images, Sample};
use super::line_evidence::Showing;
use super::line_extent::gain_of_sample;
use super::line_fitting::change_by_edgels;
use super::line_selection::{ChosenLine, MIN_SHOWING};
use nalgebra::{SVector, Vector3};
use neat_core::{CircularArc, LineSegment3};
use rayon::prelude::*;

/// Smoothing rounds corners by so many pixels: nearer to a sharp one nothing is asked …
const ROUNDING_IN_PIXELS: f64 = 2.0;
/// … and an arc that comes nearer to it may be a sharp one, judged.
const MIN_RISE_IN_PIXELS: f64 = 2.5;
/// How far before the corner arcs that are tried begin: each by this factor farther than the last.
const STEP: f64 = 1.15;
/// An edge goes on over so many pixels of its arc, besides those that cannot be told apart, judged.
const OVER_IN_PIXELS: f64 = 4.0;
/// Of both lines so many pixels are asked with the arc.
const MARGIN_IN_PIXELS: f64 = 6.0;
/// Distance between samples, in pixels.
const SPACING: f64 = 2.0;
/// Probability that something hides a corner in a view that shows both of its lines, judged.
const HIDDEN: f64 = 0.3;
/// An arc must explain the edgels so much better than the sharp corner, in nats, as for outlines: it
/// is the best of many tries.
const ADVANTAGE: f64 = 12.0;
/// Lines under a smaller angle than this have no corner to round (cosine), about 15°.
const MAX_COSINE: f64 = 0.966;
/// So many parts of an arc must each be shown.
const THIRDS: f64 = 3.0;
/// Rounds of fitting.
const ROUNDS: usize = 3;
/// Fewer edgels tell nothing of an arc.
const MIN_EDGELS: usize = 12;
/// What keeps a number where no edgel tells of it.
const RIDGE: f64 = 1e-6;

/// Where two lines in one plane would meet beyond their ends.
struct Corner {
    lines: [usize; 2],
    ends: [usize; 2],
    point: Vector3<f64>,
    /// From it along both lines.
    toward: [Vector3<f64>; 2],
    /// Between both, and cosine and tangent of the angle to either.
    bisector: Vector3<f64>,
    cosine: f64,
    tangent: f64,
    /// From where to where an arc may begin, away from the corner.
    bounds: [f64; 2],
    pixel: f64,
}

impl Corner {
    fn between(images: &Images, lines: [&LineSegment3; 2], pixel: f64) -> Option<Self> {
        let reach = images.reach * pixel;
        let (places, gap) = nearest_points(lines[0], lines[1])?;
        if gap > MAX_GAP * reach {
            return None;
        }
        let beyond = [0, 1].map(|k| beyond_end(places[k], lines[k].length()));
        let point = 0.5 * (lines[0].point_at(places[0]) + lines[1].point_at(places[1]));
        let far = [0, 1].map(|k| lines[k].ends()[1 - beyond[k].1] - point);
        let toward = far.map(|far| far.normalize());
        let bisector = (toward[0] + toward[1]).try_normalize(1e-9)?;
        let cosine = bisector.dot(&toward[0]);
        let tangent = (1.0 - cosine * cosine).sqrt() / cosine;
        let short = beyond[0].0.max(beyond[1].0);
        // Beside an arc, twice as far as they cannot be told apart: t = short + 2 √(2 r δ), r = t tan.
        let over = (2.0 * reach * tangent).sqrt();
        let most = (over + (over * over + short.max(0.0)).sqrt()).powi(2);
        let rise = cosine.recip() - tangent;
        let bounds = [
            (short - WINDOW_IN_PIXELS * pixel).max(MIN_RISE_IN_PIXELS * pixel / rise),
            (most + OVER_IN_PIXELS * pixel)
                .min(far[0].norm())
                .min(far[1].norm()),
        ];
        let is_corner = toward[0].dot(&toward[1]).abs() < MAX_COSINE;
        let ends_there = beyond
            .iter()
            .all(|(beyond, _)| *beyond > -OVER_IN_PIXELS * pixel);
        (is_corner && ends_there && bounds[0] < bounds[1]).then_some(Self {
            lines: [0, 1],
            ends: beyond.map(|(_, end)| end),
            point,
            toward,
            bisector,
            cosine,
            tangent,
            bounds,
            pixel,
        })
    }

    /// The arc that begins so far from the corner, on the first line.
    fn arc(&self, from: f64) -> Option<CircularArc> {
        let middle = from * (self.cosine.recip() - self.tangent) * self.bisector;
        let points = [from * self.toward[0], middle, from * self.toward[1]];
        CircularArc::through(points.map(|point| self.point + point))
    }

    /// How a point of the arc moves as that begins farther from the corner, by its direction from the
    /// centre.
    fn moved(&self, outward: &Vector3<f64>) -> f64 {
        self.tangent + outward.dot(&self.bisector) / self.cosine
    }

    /// Each `2 * line + end`.
    fn ends_of_lines(&self) -> [usize; 2] {
        [0, 1].map(|side| 2 * self.lines[side] + self.ends[side])
    }

    /// How far from the corner both lines are asked.
    fn asked(&self) -> f64 {
        self.bounds[1] + MARGIN_IN_PIXELS * self.pixel
    }
}

/// A way from one line to the other.
struct Way<'a> {
    corner: &'a Corner,
    /// How far from the corner it leaves the lines.
    from: [f64; 2],
    between: Between,
}

/// What lies between both lines.
enum Between {
    /// Nothing that is asked: they meet.
    Nothing,
    Line(LineSegment3),
    Arc(CircularArc),
}

impl<'a> Way<'a> {
    fn sharp(corner: &'a Corner) -> Self {
        Self {
            corner,
            from: [ROUNDING_IN_PIXELS * corner.pixel; 2],
            between: Between::Nothing,
        }
    }

    /// By a line that runs from one to the other.
    fn cut(corner: &'a Corner, lines: [&LineSegment3; 2], cut: &LineSegment3) -> Option<Self> {
        let gap = BESIDE_IN_PIXELS * corner.pixel;
        let window = (WINDOW_IN_PIXELS * corner.pixel).min(MAX_WINDOW_SHARE * cut.length());
        let from = |line: &LineSegment3, toward: &Vector3<f64>| {
            let ([place, along], apart) = nearest_points(line, cut)?;
            let from = (line.point_at(place) - corner.point).dot(toward);
            let beyond = beyond_end(along, cut.length()).0.abs();
            (apart <= gap && beyond <= window && from > 0.0).then_some((from, cut.point_at(along)))
        };
        let (one, start) = from(lines[0], &corner.toward[0])?;
        let (other, end) = from(lines[1], &corner.toward[1])?;
        Some(Self {
            corner,
            from: [one, other],
            between: Between::Line(LineSegment3::new(start, end)),
        })
    }

    fn round(corner: &'a Corner, from: f64) -> Option<Self> {
        Some(Self {
            corner,
            from: [from; 2],
            between: Between::Arc(corner.arc(from)?),
        })
    }

    /// The places of both lines, as distances from the corner along it: negative on the first.
    fn on_lines(&self) -> [[f64; 2]; 2] {
        let asked = self.corner.asked();
        let [one, other] = self.from;
        [[-asked, -one], [other, asked]]
    }

    fn point(&self, place: f64) -> Vector3<f64> {
        let Corner { point, toward, .. } = self.corner;
        point + place.abs() * toward[usize::from(place > 0.0)]
    }

    /// What each view says about it, by its length.
    fn gains(&self, images: &Images, views: &[Showing]) -> Vec<f64> {
        let of_view = |showing: &Showing| {
            let samples = |part: [f64; 2], at: &dyn Fn(f64) -> Vector3<f64>| {
                images.samples_of_curve(showing.view, part, SPACING, |place| Some(at(place)))
            };
            let between = match &self.between {
                Between::Nothing => None,
                Between::Line(line) => samples([0.0, 1.0], &|place| line.point_at(place)),
                Between::Arc(arc) => samples(arc.angles, &|angle| arc.point_at(angle)),
            };
            let on_lines = self.on_lines();
            let of_lines = on_lines.into_iter().filter(|part| part[0] < part[1]);
            let of_lines = of_lines.map(|part| samples(part, &|place| self.point(place)));
            (of_lines.chain([between]).flatten())
                .map(|samples| gain_of_part(images, showing, &samples))
                .sum()
        };
        views.iter().map(of_view).collect()
    }
}

/// What a view says about a part of a way, as if its samples were as far apart as others.
fn gain_of_part(images: &Images, Showing { view, chance }: &Showing, samples: &[Sample]) -> f64 {
    let gain = |sample: &Sample| gain_of_sample(images.has_edgel(*view, sample, None), *chance);
    let steps = samples
        .windows(2)
        .map(|pair| (pair[1].pixel - pair[0].pixel).norm());
    let spacing = steps.sum::<f64>() / (samples.len() - 1) as f64;
    spacing / SPACING * samples.iter().map(gain).sum::<f64>()
}

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
            .any(|found| found.covariance.is_some() && rounds(images, found, pieces, corner.ends))
    };
    let reach = |k: usize| 1.5 * lines[k].line.length();
    let middles: Vec<Vector3<f64>> = lines.iter().map(|line| line.line.point_at(0.5)).collect();
    let of_line = |i: usize| -> Vec<Corner> {
        (i + 1..lines.len())
            .filter(|j| (middles[i] - middles[*j]).norm() <= reach(i) + reach(*j))
            .filter_map(|j| {
                let pieces = [i, j].map(|line| &lines[line].line);
                let corner = Corner::between(images, pieces, pixels[i].max(pixels[j]))?;
                Some(Corner {
                    lines: [i, j],
                    ..corner
                })
            })
            .collect()
    };
    let corners: Vec<Corner> = (0..lines.len()).into_par_iter().flat_map(of_line).collect();
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
        arcs.retain(|other| !runs_beside(other, &found.arc, BESIDE_IN_PIXELS * found.pixel));
        added.push(found);
    }
    tracing::debug!(
        added = added.len(),
        replaced = before - arcs.len(),
        "corners are rounded"
    );
    arcs.extend(added);
}

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
    let pieces = corner.lines.map(|line| &lines[line].line);
    let others = (0..lines.len()).filter(|k| !corner.lines.contains(k));
    let others: Vec<&LineSegment3> = others.map(|k| &lines[k].line).collect();
    let cut = others
        .iter()
        .filter_map(|other| Way::cut(corner, pieces, other));
    let rivals = [Way::sharp(corner)].into_iter().chain(cut);
    let rivals: Vec<Vec<f64>> = rivals.map(|way| way.gains(images, &views)).collect();
    // A step more on both sides: an arc that is best at a bound is none.
    let (mut from, mut tried) = (corner.bounds[0] / STEP, Vec::new());
    while from < corner.bounds[1] * STEP {
        tried.push((from, Way::round(corner, from)?.gains(images, &views)));
        from *= STEP;
    }
    let best =
        (0..tried.len()).max_by(|a, b| total(&tried[*a].1).total_cmp(&total(&tried[*b].1)))?;
    let (from, gains) = &tried[best];
    let advantage =
        (rivals.iter().map(|rival| advantage(gains, rival))).fold(f64::INFINITY, f64::min);
    if best == 0 || best + 1 == tried.len() || advantage <= ADVANTAGE {
        return None;
    }
    let odds = (HIDDEN / (1.0 - HIDDEN)).ln();
    let seen: Vec<Showing> = (views.iter().zip(gains))
        .filter(|(_, gain)| **gain > odds)
        .map(|(showing, _)| *showing)
        .collect();
    let from = fitted(images, corner, *from, &seen)?;
    let arc = corner.arc(from)?;
    // What other lines have is no arc's: a chamfer, the sides of a polygon.
    let mut taken = images.nothing_taken();
    let middle = arc.point_at(0.5 * (arc.angles[0] + arc.angles[1]));
    for (k, line) in lines.iter().enumerate() {
        if !corner.lines.contains(&k) && line.line.distance_to_point(&middle) < arc.length() {
            claim_edgels(images, &line.line, &mut taken);
        }
    }
    let part = |angles| Sector {
        angles,
        evidence: images.evidence_of_sector(&arc, angles, Some(&taken)),
    };
    let gains = equal_parts(arc.angles, THIRDS * SECTOR_IN_PIXELS, 1.0)
        .into_iter()
        .map(|third| {
            [Some(&taken[..]), None].map(|taken| images.evidence_of_sector(&arc, third, taken).gain)
        });
    let gains: Vec<[f64; 2]> = gains.collect();
    let [own, all] = [0, 1].map(|k| gains.iter().map(|gain| gain[k]).sum::<f64>());
    if gains.iter().any(|[own, _]| *own <= 0.0) || own <= OWN_SHARE * all {
        return None;
    }
    let sectors: Vec<Sector> = (equal_parts(arc.angles, arc.length(), corner.pixel).into_iter())
        .map(part)
        .collect();
    Some(Rounded {
        ends: corner.ends_of_lines(),
        advantage,
        found: FoundArc {
            arc,
            gain: sectors.iter().map(|sector| sector.evidence.gain).sum(),
            pixel: corner.pixel,
            sectors,
            covariance: None,
        },
    })
}

/// Where the arc begins, by the edgels beside it, and how far these lie outward from both lines.
fn fitted(images: &Images, corner: &Corner, from: f64, views: &[Showing]) -> Option<f64> {
    let mut from = from;
    for _ in 0..ROUNDS {
        let arc = corner.arc(from)?;
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
            let toward = corner.toward[usize::from(sample.place > 0.0)];
            let outward = (corner.cosine * toward - corner.bisector).normalize();
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
            corner.moved(&outward) * outward,
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
    }
}
