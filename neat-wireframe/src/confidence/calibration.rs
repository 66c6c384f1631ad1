//! What the probability by counts is worth: a logistic calibration (Platt 1999).
//!
//! Counts of views tell an edge from chance, and from nothing else. Chords of curves, outlines
//! of round things, leaves, and lines matched to their neighbours in a pattern look like edges
//! in many views. Two things betray them. The views do not agree on where they are: the
//! covariance of an end holds the scatter of its detections, how narrow a base sees it, and how
//! far it is from the best estimate. And where much is not straight, segments show only parts
//! of what is taken for an edge: that is said of the scene, not of an edge.
//!
//! The log-odds that what is more than chance is an edge are a sum of both. It exists if it is
//! both: what counts say for it is the same for nearly all edges, false ones among them, and what
//! is chance by counts is none, however exact.
//!
//! The weights are those of a logistic regression, in which a scene counts as the root of its
//! edges, on what the assembler finds in 53 scenes with exact truth (ten parts, seven objects,
//! three photographed places, 33 everyday parts of `scripts/make_parts.py`; each with all, half
//! and a quarter of its views: `measure_assembler --reliability --every 4,2,1` prints them). An
//! edge exists there if a true straight line, painted or not, lies along more than half of it.

use super::covariance::largest_eigenvalue;
use super::existence::possible;
use super::provenance::EdgeProvenance;
use nalgebra::Matrix3;

/// Log-odds of an edge at the reference below, where no edge is shown whole. Without the parts,
/// the objects, the photographs, the first and the second everyday parts: 0.38, 0.10, -0.02, 0.11
/// and 0.26.
const BASE: f64 = 0.16;
/// What each factor e in precision adds. Without one of the classes: 0.65, 0.65, 0.72, 0.77, 0.71.
const PRECISION: f64 = 0.69;
/// The standard deviation that adds nothing, as a share of the scene radius.
const REFERENCE_SIGMA: f64 = 1e-3;
/// Shares that tell: the first is a tenth of a pixel where the scene fills an image of 2000;
/// from the second on, as where an end is not determined, false edges are no more frequent.
const TELLING_SIGMAS: [f64; 2] = [1e-4, 1e-2];
/// What is added if most views show all edges whole. Without one of the classes: 2.9, 3.7, 4.0,
/// 3.8, 3.0.
const WHOLE: f64 = 3.45;

/// What the probability of an edge is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExistenceWitnesses {
    /// The probability that it is more than chance, by the views that show it.
    pub by_counts: f64,
    /// How exactly the better of its ends is known: the logarithm of a thousandth of the scene
    /// radius by its standard deviation, within bounds.
    pub precision: f64,
    /// The share of the scene's edges that most views show whole.
    pub whole_share: f64,
}

impl ExistenceWitnesses {
    /// The probability that the edge exists if it is more than chance, by the log-odds at the
    /// reference and by what precision and whole edges add.
    pub fn if_more_than_chance(&self, [base, precision, whole]: [f64; 3]) -> f64 {
        let log_odds = base + precision * self.precision + whole * self.whole_share;
        1.0 / (1.0 + (-log_odds).exp())
    }

    /// The probability that the edge exists, neither 0 nor 1.
    fn probability(&self) -> f64 {
        possible(self.by_counts * self.if_more_than_chance([BASE, PRECISION, WHOLE]))
    }
}

/// The calibrated probabilities of edges, and what each is made of, by those by counts and by the
/// covariances of their junctions, in a scene of that radius. Where no view shows any edge they
/// stay as they are.
pub(super) fn calibrate(
    by_counts: &[f64],
    edges: &[[usize; 2]],
    found: &[EdgeProvenance],
    covariances: &[Option<Matrix3<f64>>],
    scene_radius: f64,
) -> Vec<(f64, Option<ExistenceWitnesses>)> {
    let Some(whole_share) = whole_share(by_counts, found) else {
        return by_counts
            .iter()
            .map(|by_counts| (*by_counts, None))
            .collect();
    };
    let sigma = |junction: &usize| match &covariances[*junction] {
        Some(covariance) => largest_eigenvalue(covariance).max(0.0).sqrt() / scene_radius,
        None => f64::INFINITY,
    };
    let calibrated = |(edge, by_counts): (&[usize; 2], &f64)| {
        // The better end: the other may lie anywhere on a line that is there.
        let sigma = edge.iter().map(sigma).fold(f64::INFINITY, f64::min);
        let sigma = sigma.clamp(TELLING_SIGMAS[0], TELLING_SIGMAS[1]);
        let witnesses = ExistenceWitnesses {
            by_counts: *by_counts,
            precision: (REFERENCE_SIGMA / sigma).ln(),
            whole_share,
        };
        (witnesses.probability(), Some(witnesses))
    };
    edges.iter().zip(by_counts).map(calibrated).collect()
}

/// The share of the edges of which most of the views that show them show all; each counts as
/// much as it is probable, for chance shows no edge whole.
fn whole_share(by_counts: &[f64], found: &[EdgeProvenance]) -> Option<f64> {
    let (mut whole, mut all) = (0.0, 0.0);
    for (probability, edge) in by_counts.iter().zip(found) {
        let views = edge.showing_views.len();
        all += probability * f64::from(u8::from(views > 0));
        whole += probability * f64::from(u8::from(2 * edge.whole_views > views));
    }
    (all > 0.0).then(|| whole / all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An edge that so many views show, some of them whole.
    fn shown(views: usize, whole_views: usize) -> EdgeProvenance {
        EdgeProvenance {
            showing_views: (0..views).collect(),
            whole_views,
            ..Default::default()
        }
    }

    fn variance(sigma: f64) -> Option<Matrix3<f64>> {
        Some(Matrix3::from_diagonal_element(sigma * sigma))
    }

    #[test]
    fn exact_edges_that_are_shown_whole_are_sure_and_others_are_not() {
        let edges = [[0, 1], [1, 2], [2, 3], [3, 4]];
        let covariances = [1e-4, 5e-4, 3e-3, 8e-3, 0.1].map(variance);
        let clear = [0.999; 4];
        let of = |by_counts: &[f64], found: &[EdgeProvenance]| {
            let calibrated = calibrate(by_counts, &edges, found, &covariances, 1.0);
            calibrated.into_iter().map(|(p, _)| p).collect::<Vec<f64>>()
        };
        let whole: Vec<_> = (0..4).map(|_| shown(9, 5)).collect();
        let parts: Vec<_> = (0..4).map(|_| shown(9, 4)).collect();
        let [in_whole, in_parts] = [of(&clear, &whole), of(&clear, &parts)];
        // The better end of each counts.
        assert!(in_whole[0] > 0.98 && in_whole[1] > 0.95, "{in_whole:?}");
        assert!(in_whole[3] < 0.9 && in_parts[3] < 0.25, "{in_parts:?}");
        for probabilities in [&in_whole, &in_parts] {
            assert!(probabilities.is_sorted_by(|a, b| a > b));
        }
        assert!(in_whole.iter().zip(&in_parts).all(|(a, b)| a > b));
        // What is chance by counts is none, however exact its junctions are …
        assert!(of(&[0.01; 4], &whole)[0] < 0.01);
        assert!(of(&[0.001; 4], &parts)[0] <= 0.001);
        // … and does not tell what its scene is like.
        let mixed = [shown(9, 5), shown(9, 5), shown(9, 0), shown(9, 0)];
        let of_mixed = of(&[0.999, 0.999, 0.001, 0.001], &mixed);
        assert!((of_mixed[0] - in_whole[0]).abs() < 1e-3, "{of_mixed:?}");
    }

    #[test]
    fn the_unit_of_length_does_not_matter_and_nothing_known_changes_nothing() {
        let found = [shown(3, 3)];
        let ask = |sigma: f64, radius: f64| {
            calibrate(&[0.99], &[[0, 1]], &found, &[variance(sigma), None], radius)[0].0
        };
        assert!((ask(0.002, 1.0) - ask(0.4, 200.0)).abs() < 1e-12);
        assert!(ask(f64::INFINITY, 1.0) > 0.0 && ask(0.0, 1.0) < 1.0);
        let unseen = calibrate(&[0.8], &[[0, 1]], &[shown(0, 0)], &[None, None], 1.0);
        assert_eq!(unseen, [(0.8, None)]);
    }
}
