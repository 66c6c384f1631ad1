//! Curves of which an arc explains the middle alone.
//!
//! A free curve that bends little is found as one arc, which leaves it near its ends. So each open arc
//! is asked whether a spline explains the images better: between ends of its own or junctions near its
//! circle, with as few control points as images need. A spline that an arc follows within the reach of
//! its edgels is that arc.

use super::arc_between_tangents::BetweenTangents;
use super::arc_ends::{MIN_RADIUS, OPEN_END};
use super::arc_joints::wrapped;
use super::circle_fitting::FoundArc;
use super::corners::WINDOW_IN_PIXELS;
use super::edge_samples::Images;
use super::spline_fitting::{COST, NUMBERS_OF_CONTROL, Points, gain_by_length, through_points};
use super::splines::DRIFT;
use nalgebra::Vector3;
use neat_core::Spline;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Parts of an arc of which each is asked how well images show it.
const PARTS: usize = 16;
/// An arc is the curve where images say this share of what they say where they say most, by length.
const SHOWN: f64 = 0.5;
/// Junctions that are tried as each end, those nearest to that of the arc.
const MOST_JUNCTIONS: usize = 4;
/// Control points that are tried first, and then.
const TRIED: usize = 5;
const CONTROLS: std::ops::Range<usize> = 4..8;
/// Reaches of the fits to edgels: the arc is far from the curve at its ends.
const FITTING_REACHES: [f64; 6] = [8.0, 4.0, 2.0, 1.0, 1.0, 1.0];
/// Places of a spline at which it is compared with its arc.
const PLACES: usize = 32;

/// The end of a curve: its angle on the circle of the arc, and its junction.
type End = (f64, Option<Vector3<f64>>);

impl Images<'_> {
    /// The spline that explains the images better than an arc; `junctions` are those of edges.
    pub(super) fn free_curve(
        &self,
        found: &FoundArc,
        junctions: &[Vector3<f64>],
    ) -> Option<Spline> {
        let FoundArc { arc, pixel, .. } = found;
        if arc.is_closed() || arc.radius < MIN_RADIUS * pixel {
            return None;
        }
        let fitted = |ends: [End; 2], controls: usize, reaches: &[f64]| {
            let pins = ends.map(|(_, junction)| junction);
            let start = through_points(&points_between(found, ends), controls, false, pins)?;
            self.fitted(start, pins, *pixel, reaches)
        };
        // Where edgels of one are none of the other.
        let leaves_arc = |spline: &Spline| {
            let last = spline.pieces() as f64;
            let mut places = (0..PLACES).map(|k| (k as f64 + 0.5) / PLACES as f64 * last);
            places.any(|place| {
                let off = arc.distance_to_circle(&spline.point_at(place));
                off > self.reach * pixel
            })
        };
        let free = arc.angles.map(|angle| (angle, None));
        let first = fitted(free, TRIED, &FITTING_REACHES[2..])?;
        if !leaves_arc(&first) {
            return None;
        }
        let rival = self.between_tangents(found)?;
        // Images show more of it beside the arc than of the rival.
        let is_better = |spline: &Spline| {
            let numbers = NUMBERS_OF_CONTROL * spline.controls.len() as f64 - rival.numbers();
            let worth = self.gain_over(&rival, spline, found) - COST * numbers;
            tracing::debug!(worth, "an arc may be a spline");
            worth > 0.0
        };
        if !is_better(&first) {
            return None;
        }
        // Where it hardly is the curve another one may run on, and nothing speaks for an end without
        // a junction.
        let worth = |spline: &Spline, ends: &[End; 2]| {
            let gains = self.evidence_along(spline, *pixel, None).into_iter();
            let gains: Vec<f64> = gains.map(|(_, evidence)| evidence.gain).collect();
            let least = SHOWN * gains.iter().copied().fold(0.0, f64::max);
            let shown = gains.iter().filter(|gain| **gain >= least).sum();
            let open = ends.iter().filter(|(_, junction)| junction.is_none());
            let cost = COST * NUMBERS_OF_CONTROL * spline.controls.len() as f64;
            gain_by_length(shown, spline.length(), *pixel) - cost - OPEN_END * open.count() as f64
        };
        let best = |tried: &mut dyn Iterator<Item = ([End; 2], usize)>| {
            let splines = tried.filter_map(|(ends, controls)| {
                let spline = fitted(ends, controls, &FITTING_REACHES)?;
                Some((worth(&spline, &ends), ends, spline))
            });
            splines.max_by(|a, b| a.0.total_cmp(&b.0))
        };
        let [starts, stops] = self.possible_ends(found, junctions);
        let mut pairs = starts
            .iter()
            .flat_map(|from| stops.iter().map(move |to| ([*from, *to], TRIED)))
            .filter(|([from, to], _)| {
                let is_again = from.1.is_some() && from.1 == to.1;
                (0.0..TAU).contains(&(to.0 - from.0)) && !is_again
            });
        let (_, ends, _) = best(&mut pairs)?;
        let (.., spline) = best(&mut CONTROLS.map(|controls| (ends, controls)))?;
        (leaves_arc(&spline) && is_better(&spline)).then_some(spline)
    }

    /// How much more images say about the part of a spline that an arc runs along than about its
    /// rival there, part by part.
    fn gain_over(&self, rival: &BetweenTangents, spline: &Spline, found: &FoundArc) -> f64 {
        let arc = &found.arc;
        let middle = 0.5 * (arc.angles[0] + arc.angles[1]);
        let angle_at = |place: f64| {
            let angle = arc.angle_of(&spline.point_at(place));
            middle + wrapped(angle - middle)
        };
        let gains = self.evidence_along(spline, found.pixel, None);
        let more: Vec<f64> = (gains.par_iter())
            .filter_map(|([from, to], evidence)| {
                let angles = [angle_at(*from), angle_at(*to)];
                let is_beside = arc.contains(angle_at(0.5 * (from + to)), 0.0);
                is_beside.then(|| evidence.gain - self.gain_between_tangents(rival, angles))
            })
            .collect();
        gain_by_length(more.iter().sum(), spline.length(), found.pixel)
    }

    /// Where the curve may start and end: at junctions near the circle, from the part of the arc that
    /// is shown on to a window beyond its end, or where the arc ends.
    fn possible_ends(&self, found: &FoundArc, junctions: &[Vector3<f64>]) -> [Vec<End>; 2] {
        let arc = &found.arc;
        let shown = self.well_shown(found);
        let window = WINDOW_IN_PIXELS * found.pixel / arc.radius;
        let near: Vec<(f64, Vector3<f64>)> = (junctions.iter())
            .filter(|junction| arc.distance_to_circle(junction) <= DRIFT * found.pixel)
            .map(|junction| (arc.angle_of(junction), *junction))
            .collect();
        [0, 1].map(|k| {
            let sign = [-1.0, 1.0][k];
            let beyond = (arc.angles[k] - shown[k]) * sign;
            let at_junctions = near.iter().filter_map(|(angle, junction)| {
                let by = wrapped(angle - shown[k]) * sign;
                let is_there = (-window..=beyond + window).contains(&by);
                is_there.then_some((shown[k] + by * sign, Some(*junction)))
            });
            let mut ends: Vec<End> = at_junctions.collect();
            let off = |end: &End| (end.0 - arc.angles[k]).abs();
            ends.sort_by(|a, b| off(a).total_cmp(&off(b)));
            ends.truncate(MOST_JUNCTIONS);
            ends.push((arc.angles[k], None));
            ends
        })
    }

    /// From which angle to which an arc is shown well.
    fn well_shown(&self, found: &FoundArc) -> [f64; 2] {
        let arc = &found.arc;
        let at = |k: usize| arc.angles[0] + arc.sweep() * k as f64 / PARTS as f64;
        let gains: Vec<f64> = (0..PARTS)
            .map(|k| self.gain_along(arc, [at(k), at(k + 1)], found.pixel, None))
            .collect();
        let most = gains.iter().copied().fold(0.0, f64::max);
        let is_shown = |k: &usize| gains[*k] >= SHOWN * most;
        let first = (0..PARTS).find(is_shown).unwrap_or(0);
        let last = (0..PARTS).rev().find(is_shown).unwrap_or(PARTS - 1);
        [at(first), at(last + 1)]
    }
}

/// Points along the circle of an arc from one end to the other, at places by angle.
fn points_between(found: &FoundArc, [from, to]: [End; 2]) -> Points {
    let count = PLACES;
    let share = |k: usize| k as f64 / count as f64;
    let inner = (0..=count).map(|k| found.arc.point_at(from.0 + (to.0 - from.0) * share(k)));
    let mut points: Vec<Vector3<f64>> = inner.collect();
    points[0] = from.1.unwrap_or(points[0]);
    points[count] = to.1.unwrap_or(points[count]);
    Points {
        points,
        places: (0..=count).map(share).collect(),
    }
}
