//! Arcs that run on along the lines that they touch.
//!
//! Where an arc touches a line both lie within the reach of edgels of each other for a while, and
//! an arc that was followed along the line is drawn after it. A spline explains that better than
//! any arc; a shorter arc between two tangents does so with fewer numbers.

use super::circle_fitting::{FoundArc, equal_parts};
use super::edge_samples::Images;
use super::spline_fitting::{COST, NUMBERS_OF_ARC, gain_by_length};
use nalgebra::Vector3;
use neat_core::CircularArc;
use rayon::prelude::*;

/// A tangent takes this share of an arc at most, at each end, judged …
const MOST: f64 = 0.25;
/// … and is sought in steps of such shares, so many each way.
const STEPS: [(f64, i32); 3] = [(0.0625, 4), (0.031_25, 1), (0.015_625, 1)];
/// Fits to what is left of the arc, which lies within a reach of its edgels already.
const FITS: usize = 2;

/// An arc, which runs on along its tangents before and after it.
pub(super) struct BetweenTangents {
    arc: CircularArc,
    tangents: usize,
}

impl BetweenTangents {
    /// A tangent has its length besides what the arc has.
    pub(super) fn numbers(&self) -> f64 {
        NUMBERS_OF_ARC + self.tangents as f64
    }

    /// At an angle of the circle, or as far along a tangent.
    fn point_at(&self, angle: f64) -> Vector3<f64> {
        let arc = &self.arc;
        let touches = angle.clamp(arc.angles[0], arc.angles[1]);
        arc.point_at(touches) + (angle - touches) * arc.radius * arc.tangent_at(touches)
    }
}

impl Images<'_> {
    /// The arc, or the shorter one with its tangents, that explains the images best all along it.
    pub(super) fn between_tangents(&self, found: &FoundArc) -> Option<BetweenTangents> {
        let parts = equal_parts(found.arc.angles, found.arc.length(), found.pixel);
        let cut = |cuts: [f64; 2]| {
            let mut arc = found.arc;
            let by = cuts.map(|share| share * arc.sweep());
            arc.angles = [arc.angles[0] + by[0], arc.angles[1] - by[1]];
            let tangents = cuts.iter().filter(|share| **share > 0.0).count();
            if tangents > 0 {
                arc = self.fitted_to_its_own(arc, found.pixel)?;
            }
            let curve = BetweenTangents { arc, tangents };
            let gains = (parts.iter()).map(|part| self.gain_between_tangents(&curve, *part));
            let gain = gain_by_length(gains.sum(), found.arc.length(), found.pixel);
            Some((gain - COST * curve.numbers(), cuts, curve))
        };
        let mut best = cut([0.0; 2])?;
        for (step, steps) in STEPS {
            for end in 0..2 {
                let from = best.1;
                let cuts = (-steps..=steps).filter_map(|k| {
                    let mut cuts = from;
                    cuts[end] += f64::from(k) * step;
                    (k != 0 && (0.0..=MOST).contains(&cuts[end])).then_some(cuts)
                });
                let tried: Vec<[f64; 2]> = cuts.collect();
                for other in tried.into_par_iter().filter_map(cut).collect::<Vec<_>>() {
                    if other.0 > best.0 {
                        best = other;
                    }
                }
            }
        }
        Some(best.2)
    }

    /// What images say about a part of such a curve.
    pub(super) fn gain_between_tangents(&self, curve: &BetweenTangents, angles: [f64; 2]) -> f64 {
        let at = |_, angle| Some(curve.point_at(angle));
        self.evidence_of_curve(&curve.arc, angles, at, None).gain
    }

    /// The arc that fits the edgels between its own ends.
    fn fitted_to_its_own(&self, mut arc: CircularArc, pixel: f64) -> Option<CircularArc> {
        for _ in 0..FITS {
            let parts: Vec<([f64; 2], Vec<usize>)> = equal_parts(arc.angles, arc.length(), pixel)
                .into_iter()
                .map(|part| {
                    let evidence = self.evidence_of_sector(&arc, part, None);
                    (part, evidence.views().collect())
                })
                .collect();
            arc = self.fit_circle(&arc, &parts, self.reach)?;
        }
        Some(arc)
    }
}
