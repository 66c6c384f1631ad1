//! Smooth curves that are no circles.
//!
//! Ellipses and free curves are found as arcs, each of which goes on as the next one. A chain of
//! them is one curve: a spline with as few control points as images need, fitted to the edgels of
//! all views. It has to explain them as well as the arcs do, with fewer numbers. Two arcs that
//! touch are two arcs, as things are made of them. An arc alone may be a curve too (`free_curves.rs`).

use super::arc_joints::wrapped;
use super::arc_pieces::OWN_SHARE;
use super::circle_fitting::FoundArc;
use super::corners::{MAX_GAP, WINDOW_IN_PIXELS};
use super::curves::BESIDE_IN_PIXELS;
use super::edge_samples::Images;
use super::spline_fitting::{
    COST, NUMBERS_OF_ARC, NUMBERS_OF_CONTROL, Points, gain_by_length, parts_of, through_points,
};
use nalgebra::Vector3;
use neat_core::Spline;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// An arc goes on as another one if it turns by less there: cosine of 30°, judged. The arcs of an
/// ellipse turn by 1 to 15°.
const GOES_ON: f64 = 0.866;
/// Beside the end of one, the other is no farther away in pixels: both may have left the curve
/// there by as much as arcs of one edge lie beside each other.
pub(super) const DRIFT: f64 = 2.0 * BESIDE_IN_PIXELS;
/// Overlapping arcs have at most this share of the shorter one in common, judged: those of the
/// ellipses of `part-009` have up to .55.
const MOST_COMMON: f64 = 0.75;
/// Fewer arcs are no chain, unless they close.
const MIN_ARCS: usize = 3;
/// Pixels between the points of arcs that a spline is first fitted to.
const STEP_IN_PIXELS: f64 = 4.0;
/// Reaches of the fits to edgels.
const FITTING_REACHES: [f64; 4] = [1.5, 1.5, 1.0, 1.0];

/// An end of an arc: its place in the list, and 0 for its start, 1 for its end.
type End = (usize, usize);

/// Arcs one after the other, each with whether it is passed from its end to its start.
struct Chain {
    arcs: Vec<(usize, bool)>,
    closed: bool,
}

/// A spline in place of arcs, by their places in the list.
struct Found {
    arcs: Vec<usize>,
    pixel: f64,
    gain: f64,
    spline: Spline,
}

/// Takes the chains among the arcs that one spline explains as well, and arcs that a spline explains
/// better: those first that images say most for, and none that is another one again. `junctions` are
/// those of edges.
pub(super) fn take_splines(
    images: &Images,
    junctions: &[Vector3<f64>],
    arcs: &mut Vec<FoundArc>,
) -> Vec<Spline> {
    let found = |arcs: Vec<usize>, pixel: f64, spline: Spline| Found {
        arcs,
        pixel,
        gain: images.gain_of_spline(&spline, pixel, None),
        spline,
    };
    let of_chain = |chain: Chain| {
        let spline = images.spline_of(&chain, junctions, arcs)?;
        let pixel = chain.pixel(arcs);
        let of_chain = chain.arcs.into_iter().map(|(arc, _)| arc);
        Some(found(of_chain.collect(), pixel, spline))
    };
    let of_arc = |arc: usize| {
        let spline = images.free_curve(&arcs[arc], junctions)?;
        Some(found(vec![arc], arcs[arc].pixel, spline))
    };
    let chains = chains(images, junctions, arcs).into_par_iter();
    let of_chains: Vec<Found> = chains.filter_map(of_chain).collect();
    let taken = arcs_of(&of_chains);
    let others = (0..arcs.len()).into_par_iter();
    let others = others.filter(|arc| !taken.contains(arc));
    let mut found: Vec<Found> = others.filter_map(of_arc).collect();
    found.splice(..0, of_chains);
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut edgels = images.nothing_taken();
    found.retain(|found| {
        let own = images.gain_of_spline(&found.spline, found.pixel, Some(&edgels));
        let is_own = own > OWN_SHARE * found.gain;
        if is_own {
            let parts = parts_of(&found.spline, found.pixel);
            images.claim_curve(
                &parts,
                |place| Some(found.spline.point_at(place)),
                &mut edgels,
            );
        }
        is_own
    });
    let taken = arcs_of(&found);
    let mut index = 0..arcs.len();
    arcs.retain(|_| index.next().is_none_or(|index| !taken.contains(&index)));
    if !found.is_empty() {
        arcs.retain(|arc| images.has_own(arc, &edgels));
    }
    found.into_iter().map(|found| found.spline).collect()
}

fn arcs_of(found: &[Found]) -> BTreeSet<usize> {
    found
        .iter()
        .flat_map(|found| &found.arcs)
        .copied()
        .collect()
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
            let spline = self.fitted(start, ends, pixel, &FITTING_REACHES)?;
            let gain = self.gain_of_spline(&spline, pixel, None);
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
    fn one_arc_may_be_a_curve_that_ends_at_junctions_near_its_circle() {
        // A third of an ellipse, and the arc along its middle.
        let [start, end] = [0.6, 2.8];
        let junctions = [ellipse(start), ellipse(end)];
        let (left, found) = splines(ellipse, &[start, end], 0.0, &junctions);
        assert_eq!((left, found.len()), (0, 1));
        let controls = &found[0].controls;
        let mut ends = [controls[0], controls[controls.len() - 1]];
        ends.sort_by(|a, b| b.x.total_cmp(&a.x));
        assert_eq!(ends, junctions);
        assert!(farthest_from(ellipse, &found[0]) < 0.003);
    }

    #[test]
    fn an_arc_that_runs_on_along_its_tangents_is_no_spline() {
        // A circle's quarter, and so much of the lines that it touches.
        for along in [0.06, 0.15] {
            let curve = |place: f64| {
                let angle = place.clamp(0.0, 0.5 * PI);
                let (sine, cosine) = angle.sin_cos();
                let at = Vector3::new(0.4 * cosine, 0.4 * sine, 0.1);
                at + (place - angle) * 0.4 * Vector3::new(-sine, cosine, 0.0)
            };
            let places = [-0.5 * along, 0.5 * PI + along];
            let (left, found) = splines(curve, &places, 0.0, &[curve(0.0)]);
            assert_eq!((left, found.len()), (1, 0), "{along}");
        }
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
