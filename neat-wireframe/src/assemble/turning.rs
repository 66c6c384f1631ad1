//! Whether an arc turns where the images say so.
//!
//! Where poses are off by a tenth of a pixel, a straight edge of two metres rises over its chord by
//! a millimetre, and a curve of 400 m radius explains its edgels better; and from one course of
//! bricks to the next one leads a curve, too. But edgels have directions, which poses do not
//! change: along an arc they turn as it does, beside all else they stay as they are.

use super::circle_fitting::FoundArc;
use super::curve_samples::SPACING;
use super::edge_samples::Images;
use super::straightness::CORRELATION;
use nalgebra::Vector2;
use rayon::prelude::*;

/// A view with fewer edgels says nothing.
const MIN_EDGELS: usize = 4;
/// No edgel's direction is known better, in radians, judged: pixels have eight neighbours.
const LEAST_NOISE: f64 = 0.01;

/// Sums over the edgels of an arc, in squared radians.
#[derive(Clone, Copy, Default)]
struct Turns {
    edgels: usize,
    /// How much less they differ from the arc's directions than from one direction in each view.
    gain: f64,
    /// How much they differ from those of the arc.
    left: f64,
}

impl Images<'_> {
    /// What the directions of edgels say for an arc against what does not turn, in nats.
    pub(super) fn gain_by_turning(&self, found: &FoundArc) -> f64 {
        let of_view = |view| self.turns_in_view(view, found).unwrap_or_default();
        let of_views: Vec<Turns> = (0..self.views.len()).into_par_iter().map(of_view).collect();
        let sum = |of: fn(&Turns) -> f64| of_views.iter().map(of).sum::<f64>();
        let edgels = sum(|turns| turns.edgels as f64).max(1.0);
        let variance = (sum(|turns| turns.left) / edgels).max(LEAST_NOISE.powi(2));
        sum(|turns| turns.gain) / (2.0 * CORRELATION * variance)
    }

    /// What a view says by the edgels beside the sectors that it shows.
    fn turns_in_view(&self, view: usize, found: &FoundArc) -> Option<Turns> {
        // How far the arc has turned in the image, and how much farther the edgel there.
        let mut turned: Vec<Vector2<f64>> = Vec::new();
        let mut last: Option<(f64, Vector2<f64>)> = None;
        let shown = (found.sectors.iter())
            .filter(|sector| sector.evidence.views().any(|showing| showing == view));
        for sector in shown {
            let samples = self.samples_of_sector(view, &found.arc, sector.angles, SPACING);
            for sample in samples.unwrap_or_default() {
                let Some(edgel) = self.edgel(view, &sample, self.reach) else {
                    continue;
                };
                let normal = sample.normal;
                let of_arc = last.map_or(0.0, |(angle, from)| angle + turn(&from, &normal));
                last = Some((of_arc, normal));
                let across: Vector2<f64> = self.maps[view].get(edgel).normal.cast();
                let across = across * normal.dot(&across).signum();
                turned.push(Vector2::new(of_arc, turn(&normal, &across)));
            }
        }
        if turned.len() < MIN_EDGELS {
            return None;
        }
        let mean = turned.iter().sum::<Vector2<f64>>() / turned.len() as f64;
        let mut turns = Turns {
            edgels: turned.len(),
            ..Turns::default()
        };
        for of_edgel in turned {
            let [of_arc, beside]: [f64; 2] = (of_edgel - mean).into();
            turns.left += beside * beside;
            turns.gain += (of_arc + beside).powi(2) - beside * beside;
        }
        Some(turns)
    }
}

/// From one direction to another, in radians.
fn turn(from: &Vector2<f64>, to: &Vector2<f64>) -> f64 {
    from.perp(to).atan2(from.dot(to))
}

#[cfg(test)]
mod tests {
    use crate::assemble::circle_fitting::tests::{arc, views_of_arcs};
    use crate::assemble::test_views::{TestViews, cube_edge};
    use nalgebra::Vector3;
    use neat_core::CircularArc;

    #[test]
    fn an_arc_turns_and_a_bowed_edge_does_not() {
        let gain = |views: &TestViews, start: &CircularArc| {
            let images = views.images();
            let all: Vec<usize> = (0..images.views.len()).collect();
            images.gain_by_turning(&images.follow_arc(start, &all).unwrap())
        };
        let round = gain(&views_of_arcs(20, |_| arc(1.5)), &arc(1.5));
        assert!(round > 100.0, "{round}");
        // The edge of a cube, beside an arc that rises by half a pixel.
        let edge = cube_edge(0);
        let middle = edge.point_at(0.5);
        let out = (middle - Vector3::repeat(0.1) - edge.start).normalize() * 0.002;
        let bowed = CircularArc::through([edge.start, middle + out, edge.end]).unwrap();
        let straight = gain(&TestViews::of_cube(20), &bowed);
        assert!(straight < 1.0, "{straight}");
    }
}
