//! Smooth curves that are no circles.
//!
//! Ellipses and free curves are found as arcs, each of which goes on as the next one. A chain of
//! them is one curve: a spline with as few control points as images need, fitted to the edgels of
//! all views. It has to explain them as well as the arcs do, with fewer numbers. Two arcs that
//! touch are two arcs, as things are made of them.

use super::arc_joints::wrapped;
use super::circle_fitting::{FoundArc, SECTOR_IN_PIXELS, equal_parts, sectors_along};
use super::corners::{MAX_GAP, WINDOW_IN_PIXELS};
use super::curve_samples::{SPACING, distance_of_curve};
use super::curves::BESIDE_IN_PIXELS;
use super::edge_samples::Images;
use super::line_evidence::LineEvidence;
use super::line_fitting::loss_of_reach;
use nalgebra::{DMatrix, DVector, Vector3};
use neat_core::Spline;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// An arc goes on as another one if it turns by less there: cosine of 30°, judged. The arcs of an
/// ellipse turn by 1 to 15°.
const GOES_ON: f64 = 0.866;
/// Beside the end of one, the other is no farther away in pixels: both may have left the curve
/// there by as much as arcs of one edge lie beside each other.
const DRIFT: f64 = 2.0 * BESIDE_IN_PIXELS;
/// Overlapping arcs have at most this share of the shorter one in common, judged: those of the
/// ellipses of `part-009` have up to .55.
const MOST_COMMON: f64 = 0.75;
/// Fewer arcs are no chain, unless they close.
const MIN_ARCS: usize = 3;
/// Pixels between the points of arcs that a spline is first fitted to.
const STEP_IN_PIXELS: f64 = 4.0;
/// An arc has six numbers and two ends, a control point three.
const NUMBERS_OF_ARC: f64 = 8.0;
const NUMBERS_OF_CONTROL: f64 = 3.0;
/// What a number costs in nats: half the logarithm of the hundreds of places that tell of it.
const COST: f64 = 3.0;
/// Reaches of the fits to edgels.
const FITTING_REACHES: [f64; 4] = [1.5, 1.5, 1.0, 1.0];
/// What keeps control points along the curve, where edgels say nothing: as a share of what they
/// say across it.
const RIDGE: f64 = 1e-4;
/// As much more keeps ends at junctions.
const AT_JUNCTION: f64 = 1e8;
/// Fewer edgels for each control point do not place it.
const MIN_EDGELS: usize = 8;

/// An end of an arc: its place in the list, and 0 for its start, 1 for its end.
type End = (usize, usize);

/// Arcs one after the other, each with whether it is passed from its end to its start.
struct Chain {
    arcs: Vec<(usize, bool)>,
    closed: bool,
}

/// Takes the chains among the arcs that one spline explains as well; `junctions` are those of
/// edges.
pub(super) fn take_splines(
    images: &Images,
    junctions: &[Vector3<f64>],
    arcs: &mut Vec<FoundArc>,
) -> Vec<Spline> {
    let found: Vec<(Chain, Spline)> = (chains(images, junctions, arcs).into_par_iter())
        .filter_map(|chain| {
            let spline = images.spline_of(&chain, junctions, arcs)?;
            Some((chain, spline))
        })
        .collect();
    let mut edgels = images.nothing_taken();
    for (chain, spline) in &found {
        let parts = parts_of(spline, chain.pixel(arcs));
        images.claim_curve(&parts, |place| Some(spline.point_at(place)), &mut edgels);
    }
    let taken: BTreeSet<usize> = (found.iter())
        .flat_map(|(chain, _)| chain.arcs.iter().map(|(arc, _)| *arc))
        .collect();
    let mut index = 0..arcs.len();
    arcs.retain(|_| index.next().is_none_or(|index| !taken.contains(&index)));
    if !found.is_empty() {
        arcs.retain(|arc| images.has_own(arc, &edgels));
    }
    found.into_iter().map(|(_, spline)| spline).collect()
}

fn point_of(arcs: &[FoundArc], (arc, end): End) -> Vector3<f64> {
    let arc = &arcs[arc].arc;
    arc.point_at(arc.angles[end])
}

/// The direction in which an arc would go on from an end.
fn outward(arcs: &[FoundArc], (arc, end): End) -> Vector3<f64> {
    let arc = &arcs[arc].arc;
    arc.tangent_at(arc.angles[end]) * [-1.0, 1.0][end]
}

/// The junction at which an arc ends.
fn junction_at(
    images: &Images,
    junctions: &[Vector3<f64>],
    arcs: &[FoundArc],
    end: End,
) -> Option<Vector3<f64>> {
    let gap = MAX_GAP * images.reach * arcs[end.0].pixel;
    let point = point_of(arcs, end);
    let is_near = |junction: &&Vector3<f64>| (*junction - point).norm() <= gap;
    junctions.iter().find(is_near).copied()
}

/// What goes on as one another, ends that are nearest to each other first.
fn chains(images: &Images, junctions: &[Vector3<f64>], arcs: &[FoundArc]) -> Vec<Chain> {
    let free: Vec<End> = (0..arcs.len())
        .filter(|arc| !arcs[*arc].arc.is_closed())
        .flat_map(|arc| [(arc, 0), (arc, 1)])
        .filter(|end| junction_at(images, junctions, arcs, *end).is_none())
        .collect();
    let mut links: Vec<(f64, End, End)> = Vec::new();
    for (k, one) in free.iter().enumerate() {
        for other in free[k + 1..].iter().filter(|other| other.0 != one.0) {
            links.extend(apart(arcs, [*one, *other]).map(|apart| (apart, *one, *other)));
        }
    }
    links.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut next: Vec<[Option<End>; 2]> = vec![[None; 2]; arcs.len()];
    for (_, one, other) in links {
        if next[one.0][one.1].is_none() && next[other.0][other.1].is_none() {
            next[one.0][one.1] = Some(other);
            next[other.0][other.1] = Some(one);
        }
    }
    let follow = |first: usize, mut end: usize| {
        let (mut chain, mut arc) = (Vec::new(), first);
        loop {
            chain.push((arc, end == 0));
            match next[arc][end] {
                Some((following, _)) if following == first => return (chain, true),
                Some((following, entered)) => (arc, end) = (following, 1 - entered),
                None => return (chain, false),
            }
        }
    };
    let mut chains = Vec::new();
    // Open chains from their ends, and then what is left.
    let ends = (0..arcs.len()).flat_map(|arc| [(arc, 0), (arc, 1)]);
    let begins: Vec<End> = ends
        .filter(|(arc, end)| next[*arc][*end].is_none() && next[*arc][1 - end].is_some())
        .collect();
    let rest = (0..arcs.len()).filter(|arc| next[*arc].iter().all(Option::is_some));
    for (first, begin) in begins.into_iter().chain(rest.map(|arc| (arc, 0))) {
        let mut known = chains.iter().flat_map(|chain: &Chain| &chain.arcs);
        if known.any(|(arc, _)| *arc == first) {
            continue;
        }
        let (arcs, closed) = follow(first, 1 - begin);
        chains.push(Chain { arcs, closed });
    }
    let is_chain = |chain: &Chain| chain.arcs.len() >= MIN_ARCS - usize::from(chain.closed);
    chains.retain(is_chain);
    chains
}

/// How far apart two ends are at which one arc goes on as another; `None` if it does not.
fn apart(arcs: &[FoundArc], ends: [End; 2]) -> Option<f64> {
    let [one, other] = ends.map(|end| point_of(arcs, end));
    let [a, b] = ends.map(|(arc, _)| &arcs[arc]);
    let pixel = a.pixel.min(b.pixel);
    let apart = (other - one).norm();
    let is_gap = (other - one).dot(&outward(arcs, ends[0])) >= 0.0;
    let most = if is_gap {
        WINDOW_IN_PIXELS * pixel
    } else {
        MOST_COMMON * a.arc.length().min(b.arc.length())
    };
    // Beside the end of one, the other runs on as it does.
    let goes_on = |[one, other]: [End; 2]| {
        let (point, circle) = (point_of(arcs, one), &arcs[other.0].arc);
        let angle = circle.angle_of(&point);
        let into = circle.tangent_at(angle) * [1.0, -1.0][other.1];
        outward(arcs, one).dot(&into) >= GOES_ON
            && (circle.point_at(angle) - point).norm() <= DRIFT * pixel
    };
    let either = goes_on(ends) || goes_on([ends[1], ends[0]]);
    (either && apart <= most).then_some(apart)
}

/// Points along a chain, with the place of each: from 0 to 1 by affine arc length, the integral of
/// the third root of the curvature, by which cubic pieces of an ellipse are all alike.
struct Points {
    points: Vec<Vector3<f64>>,
    places: Vec<f64>,
}

impl Chain {
    /// Where it begins and ends, unless it is closed.
    fn outer_ends(&self) -> [Option<End>; 2] {
        match (self.closed, &self.arcs[..]) {
            (false, [first, .., last]) => [
                Some((first.0, usize::from(first.1))),
                Some((last.0, usize::from(!last.1))),
            ],
            _ => [None; 2],
        }
    }

    /// The mean size of a pixel.
    fn pixel(&self, arcs: &[FoundArc]) -> f64 {
        let sizes = self.arcs.iter().map(|(arc, _)| arcs[*arc].pixel);
        sizes.sum::<f64>() / self.arcs.len() as f64
    }

    /// The part of an arc of the chain from the middle of what it has in common with the one
    /// before to that with the next one.
    fn angles_of(&self, arcs: &[FoundArc], place: usize) -> [f64; 2] {
        let (index, backward) = self.arcs[place];
        let arc = &arcs[index].arc;
        let mut angles = arc.angles;
        for (is_next, end) in [
            (false, usize::from(backward)),
            (true, usize::from(!backward)),
        ] {
            let count = self.arcs.len();
            let other = match (is_next, self.closed) {
                (true, false) if place + 1 == count => continue,
                (false, false) if place == 0 => continue,
                (true, _) => (place + 1) % count,
                (false, _) => (place + count - 1) % count,
            };
            let (other, other_backward) = self.arcs[other];
            let facing = (other, usize::from(is_next == other_backward));
            let off = wrapped(arc.angle_of(&point_of(arcs, facing)) - arc.angles[end]);
            let inward = [1.0, -1.0][end];
            angles[end] += 0.5 * (off * inward).max(0.0) * inward;
        }
        angles
    }

    fn points(&self, arcs: &[FoundArc]) -> Points {
        let (mut points, mut places) = (Vec::new(), Vec::new());
        let mut place = 0.0;
        for (k, (index, backward)) in self.arcs.iter().enumerate() {
            let FoundArc { arc, pixel, .. } = &arcs[*index];
            let mut ends = self.angles_of(arcs, k);
            let length = (ends[1] - ends[0]).abs() * arc.radius;
            if *backward {
                ends.reverse();
            }
            let count = (length / (STEP_IN_PIXELS * pixel)).ceil().max(2.0) as usize;
            for step in 0..=count {
                let share = step as f64 / count as f64;
                let point = arc.point_at(ends[0] + share * (ends[1] - ends[0]));
                let before: Vector3<f64> = points.last().copied().unwrap_or(point);
                place += (point - before).norm() / arc.radius.cbrt();
                points.push(point);
                places.push(place);
            }
        }
        let mut whole = place;
        if let (true, Some(last)) = (self.closed, points.last()) {
            whole += (points[0] - last).norm() / arcs[self.arcs[0].0].arc.radius.cbrt();
        }
        places.iter_mut().for_each(|place| *place /= whole);
        Points { points, places }
    }
}

/// What the sectors of a curve say, by length: they are as long as whole ones can be.
fn gain_by_length(gain: f64, length: f64, pixel: f64) -> f64 {
    gain * length / (SECTOR_IN_PIXELS * pixel * sectors_along(length, pixel))
}

/// From where to where the parts of a spline run that are as long as sectors of arcs.
fn parts_of(spline: &Spline, pixel: f64) -> Vec<[f64; 2]> {
    equal_parts([0.0, spline.pieces() as f64], spline.length(), pixel)
}

impl Images<'_> {
    /// The spline that explains the images as well as a chain of arcs does, with fewer numbers.
    fn spline_of(
        &self,
        chain: &Chain,
        junctions: &[Vector3<f64>],
        arcs: &[FoundArc],
    ) -> Option<Spline> {
        let pixel = chain.pixel(arcs);
        let ends = chain
            .outer_ends()
            .map(|end| junction_at(self, junctions, arcs, end?));
        let points = chain.points(arcs);
        let numbers = NUMBERS_OF_ARC * chain.arcs.len() as f64;
        let most = (numbers / NUMBERS_OF_CONTROL).ceil() as usize;
        let worth = |controls: usize| {
            let start = through_points(&points, controls, chain.closed, ends)?;
            let spline = self.fitted(start, ends, pixel)?;
            let parts = self.evidence_along(&spline, pixel);
            let gain = parts.iter().map(|(_, evidence)| evidence.gain).sum();
            let gain = gain_by_length(gain, spline.length(), pixel);
            Some((gain - COST * NUMBERS_OF_CONTROL * controls as f64, spline))
        };
        let splines = (4 + usize::from(chain.closed)..most).filter_map(worth);
        let (worth, best) = splines.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let of_arcs = self.gain_of_arcs(chain, arcs) - COST * numbers;
        let (arcs, controls) = (chain.arcs.len(), best.controls.len());
        tracing::debug!(arcs, controls, worth, of_arcs, "arcs may be a spline");
        (worth >= of_arcs).then_some(best)
    }

    /// What the images say about the arcs of a chain.
    fn gain_of_arcs(&self, chain: &Chain, arcs: &[FoundArc]) -> f64 {
        let pixel = chain.pixel(arcs);
        let gains = chain.arcs.iter().enumerate().map(|(k, (index, _))| {
            let (arc, angles) = (&arcs[*index].arc, chain.angles_of(arcs, k));
            let gain = self.gain_along(arc, angles, pixel, None);
            gain_by_length(gain, (angles[1] - angles[0]) * arc.radius, pixel)
        });
        gains.sum()
    }

    /// What the images say about each part of a spline, about as long as a sector of an arc.
    fn evidence_along(&self, spline: &Spline, pixel: f64) -> Vec<([f64; 2], LineEvidence)> {
        let evidence = |places: [f64; 2]| {
            let middle = spline.point_at(0.5 * (places[0] + places[1]));
            let at = |place: f64| Some(spline.point_at(place));
            let in_view = |view| self.samples_of_curve(view, places, SPACING, at);
            let least = f64::NEG_INFINITY;
            (
                places,
                self.evidence_of_samples(&middle, in_view, None, least, 1),
            )
        };
        parts_of(spline, pixel)
            .into_par_iter()
            .map(evidence)
            .collect()
    }

    /// A spline moved to the edgels of the views that show it.
    fn fitted(
        &self,
        mut spline: Spline,
        ends: [Option<Vector3<f64>>; 2],
        pixel: f64,
    ) -> Option<Spline> {
        for reaches in FITTING_REACHES {
            let reach = reaches * self.reach;
            let rows: Vec<Row> = (self.evidence_along(&spline, pixel).into_par_iter())
                .flat_map_iter(|(places, evidence)| {
                    let views: Vec<usize> = evidence.views().collect();
                    let of_view = |view| self.rows_of_spline(&spline, places, view, reach);
                    views.into_iter().flat_map(of_view).collect::<Vec<Row>>()
                })
                .collect();
            if rows.len() < MIN_EDGELS * spline.controls.len() {
                return None;
            }
            let loss = loss_of_reach(reach);
            let mut equations = Equations::new(&spline, ends);
            for row in &rows {
                let weight = loss.weight(row.distance * row.distance);
                equations.add(row, weight);
            }
            spline = equations.solved(&spline)?;
        }
        let last = spline.controls.len() - 1;
        for (control, end) in [0, last].into_iter().zip(ends) {
            spline.controls[control] = end.unwrap_or(spline.controls[control]);
        }
        Some(spline)
    }

    /// What the edgels beside a part of a spline in a view say.
    fn rows_of_spline(
        &self,
        spline: &Spline,
        places: [f64; 2],
        view: usize,
        reach: f64,
    ) -> Vec<Row> {
        let at = |place: f64| Some(spline.point_at(place));
        let samples = self.samples_of_curve(view, places, SPACING, at);
        let half = 0.5 * (places[1] - places[0]);
        let row = |place: f64, edgel: usize| {
            let position = self.maps[view].get(edgel).position.cast();
            let last = spline.pieces() as f64;
            let [before, after] = [place - half, place + half].map(|end| end.clamp(0.0, last));
            let tangent = spline.point_at(after) - spline.point_at(before);
            let camera = &self.views[view].camera;
            let point = spline.point_at(place);
            let (distance, by_point) = distance_of_curve(camera, &point, &tangent, &position)?;
            Some(Row {
                weights: spline.weights_at(place),
                by_point,
                distance,
            })
        };
        let rows = samples
            .iter()
            .flatten()
            .filter_map(|sample| row(sample.place, self.edgel(view, sample, reach)?));
        rows.collect()
    }
}

/// How the distance of an edgel from a spline changes with the point beside it, and so with four
/// control points.
struct Row {
    weights: [(usize, f64); 4],
    by_point: Vector3<f64>,
    distance: f64,
}

/// Normal equations for changes of the control points.
struct Equations {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    fixed: Vec<usize>,
}

impl Equations {
    /// Control points at the `ends` stay.
    fn new(spline: &Spline, ends: [Option<Vector3<f64>>; 2]) -> Self {
        let count = spline.controls.len();
        let of_end = [0, count - 1].into_iter().zip(ends);
        Self {
            matrix: DMatrix::zeros(3 * count, 3 * count),
            right: DVector::zeros(3 * count),
            fixed: of_end
                .filter_map(|(control, end)| end.map(|_| control))
                .collect(),
        }
    }

    fn add(&mut self, row: &Row, weight: f64) {
        let by = |k: usize| row.by_point[k % 3] * row.weights[k / 3].1;
        let place = |k: usize| 3 * row.weights[k / 3].0 + k % 3;
        for a in 0..12 {
            self.right[place(a)] -= weight * by(a) * row.distance;
            for b in 0..12 {
                self.matrix[(place(a), place(b))] += weight * by(a) * by(b);
            }
        }
    }

    fn solved(mut self, spline: &Spline) -> Option<Spline> {
        let count = spline.controls.len();
        let ridge = RIDGE * self.matrix.trace() / (3 * count) as f64;
        for control in 0..count {
            let held = if self.fixed.contains(&control) {
                AT_JUNCTION
            } else {
                1.0
            };
            for k in 3 * control..3 * control + 3 {
                self.matrix[(k, k)] += held * ridge;
            }
        }
        let change = self.matrix.cholesky()?.solve(&self.right);
        let mut moved = spline.clone();
        for (control, point) in moved.controls.iter_mut().enumerate() {
            *point += change.fixed_rows::<3>(3 * control);
        }
        moved.is_valid().then_some(moved)
    }
}

/// The spline with so many control points nearest to points at their places.
fn through_points(
    points: &Points,
    controls: usize,
    closed: bool,
    ends: [Option<Vector3<f64>>; 2],
) -> Option<Spline> {
    let mut spline = Spline {
        controls: vec![Vector3::zeros(); controls],
        closed,
    };
    let pieces = spline.pieces() as f64;
    let mut matrix = DMatrix::zeros(controls, controls);
    let mut right = DMatrix::zeros(controls, 3);
    let mut add = |weights: [(usize, f64); 4], point: &Vector3<f64>, held: f64| {
        for (a, by_a) in weights {
            for (b, by_b) in weights {
                matrix[(a, b)] += held * by_a * by_b;
            }
            for k in 0..3 {
                right[(a, k)] += held * by_a * point[k];
            }
        }
    };
    for (point, place) in points.points.iter().zip(&points.places) {
        add(spline.weights_at(place * pieces), point, 1.0);
    }
    for (end, place) in ends.iter().zip([0.0, pieces]) {
        if let Some(end) = end {
            add(spline.weights_at(place), end, AT_JUNCTION);
        }
    }
    let ridge = 1e-9 * points.points.len() as f64;
    for k in 0..controls {
        matrix[(k, k)] += ridge;
    }
    let solved = matrix.cholesky()?.solve(&right);
    for (control, point) in spline.controls.iter_mut().enumerate() {
        *point = Vector3::from_fn(|k, _| solved[(control, k)]);
    }
    spline.is_valid().then_some(spline)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::found;
    use crate::assemble::test_views::TestViews;
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use neat_core::CircularArc;
    use std::f64::consts::{PI, TAU};

    /// An ellipse with half axes of .5 and .3.
    fn ellipse(place: f64) -> Vector3<f64> {
        let (sine, cosine) = place.sin_cos();
        Vector3::new(0.5 * cosine, 0.3 * sine, 0.1 + 0.2 * cosine)
    }

    /// What is left of arcs along a curve from each place to the next one, and the splines, where
    /// views show it from the first to the last.
    fn splines(
        curve: impl Fn(f64) -> Vector3<f64>,
        places: &[f64],
        overlap: f64,
        junctions: &[Vector3<f64>],
    ) -> (usize, Vec<Spline>) {
        let last = places.len() - 1;
        let pieces = 200;
        let place = |k: usize| places[0] + (places[last] - places[0]) * k as f64 / pieces as f64;
        let points: Vec<Vector3<f64>> = (0..=pieces).map(|k| curve(place(k))).collect();
        let edges: Vec<[usize; 2]> = (1..=pieces).map(|k| [k - 1, k]).collect();
        let seen = views_of_edges(&cameras_on_sphere(20), &points, &edges);
        let views = (seen.iter()).map(|view| PreparedView::new(view, 1.0, 0.0));
        let views = TestViews::of(views.collect());
        let closes = junctions.is_empty();
        let arc = |k: usize| {
            let after = overlap * f64::from(u8::from(closes || k < last));
            let [a, b] = [places[k - 1], places[k] + after];
            // Every other one the other way round.
            let ends = if k.is_multiple_of(2) { [a, b] } else { [b, a] };
            let through = [ends[0], 0.5 * (a + b), ends[1]].map(&curve);
            found(CircularArc::through(through).unwrap())
        };
        let mut arcs: Vec<FoundArc> = (1..=last).map(arc).collect();
        let found = take_splines(&views.images(), junctions, &mut arcs);
        (arcs.len(), found)
    }

    fn farthest_from(curve: impl Fn(f64) -> Vector3<f64>, spline: &Spline) -> f64 {
        let truth: Vec<Vector3<f64>> = (0..4000).map(|k| curve(TAU * k as f64 / 4000.0)).collect();
        let distance = |point: &Vector3<f64>| {
            let distances = truth.iter().map(|other| (other - point).norm());
            distances.fold(f64::INFINITY, f64::min)
        };
        spline.points(0.1).iter().map(distance).fold(0.0, f64::max)
    }

    #[test]
    fn arcs_around_an_ellipse_are_one_closed_spline() {
        let places: Vec<f64> = (0..=8).map(|k| TAU * f64::from(k) / 8.0).collect();
        for overlap in [-0.02, 0.1] {
            let (left, found) = splines(ellipse, &places, overlap, &[]);
            assert_eq!((left, found.len()), (0, 1), "overlap {overlap}");
            assert!(found[0].closed && found[0].controls.len() < 16);
            let off = farthest_from(ellipse, &found[0]);
            // A pixel is .003 there.
            assert!(off < 0.003, "{off}");
        }
    }

    #[test]
    fn open_chains_end_at_their_junctions() {
        let places: Vec<f64> = (0..=5).map(|k| PI * f64::from(k) / 5.0).collect();
        let junctions = [ellipse(0.0), ellipse(PI)];
        let (left, found) = splines(ellipse, &places, 0.05, &junctions);
        assert_eq!((left, found.len()), (0, 1));
        let controls = &found[0].controls;
        let mut ends = [controls[0], controls[controls.len() - 1]];
        ends.sort_by(|a, b| b.x.total_cmp(&a.x));
        assert_eq!(ends, junctions);
        assert!(!found[0].closed && farthest_from(ellipse, &found[0]) < 0.003);
    }

    #[test]
    fn two_arcs_that_touch_are_two_arcs() {
        // Radii of .5 and .25 about centres on one line.
        let curve = |place: f64| {
            let (radius, at) = if place < 1.0 {
                (0.5, 0.0)
            } else {
                (0.25, 0.25)
            };
            let (sine, cosine) = (place - 1.0).sin_cos();
            Vector3::new(radius * cosine + at, radius * sine, 0.1)
        };
        let junctions = [curve(0.0), curve(2.0)];
        let (left, found) = splines(curve, &[0.0, 1.0, 2.0], 0.0, &junctions);
        assert_eq!((left, found.len()), (2, 0));
    }
}
