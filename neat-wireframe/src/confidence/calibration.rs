//! What the probability by counts is worth: a logistic calibration (Platt 1999).
//!
//! Counts of views tell an edge from chance, and from nothing else. Chords of curves, outlines
//! of round things, leaves, and lines matched to their neighbours in a pattern look like edges
//! in many views. Two things betray them. The views do not agree on where they are: the
//! covariance of an end holds the scatter of its detections, how narrow a base sees it, and how
//! far it is from the best estimate. And where much is not straight, segments show only parts
//! of what is taken for an edge: that is said of the scene, not of an edge.
//!
//! The log-odds are a sum of both. What counts say against an edge is added; what they say for
//! it is the same for nearly all edges, false ones among them.
//!
//! The weights are those of a logistic regression with given signs, in which each scene counts
//! as much as any other, on the edges that the assembler finds in twenty scenes with exact truth
//! (ten parts, seven objects, three photographed places; each with all, half and a quarter of
//! its views). An edge exists there if a true straight line, painted or not, lies along more
//! than half of it. Hardly an edge of theirs has counts against it, so that a bound stands in: one
//! with 0.01 by counts is less likely than not, however exact it is and whatever its scene.

use super::covariance::largest_eigenvalue;
use super::existence::possible;
use super::provenance::EdgeProvenance;
use nalgebra::Matrix3;

/// Log-odds of an edge at the reference below, where no edge is shown whole. Without the parts,
/// the objects, the photographs: 0.4, 0.0, -0.3.
const BASE: f64 = 0.12;
/// What each factor e in precision adds. Without one of the classes: 0.82, 0.84, 0.90.
const PRECISION: f64 = 0.94;
/// The standard deviation that adds nothing, as a share of the scene radius.
const REFERENCE_SIGMA: f64 = 1e-3;
/// Shares that tell: the first is a tenth of a pixel where the scene fills an image of 2000;
/// from the second on, as where an end is not determined, false edges are no more frequent.
const TELLING_SIGMAS: [f64; 2] = [1e-4, 1e-2];
/// What is added if most views show all edges whole. Without one of the classes: 1.9, 2.7, 2.8.
const WHOLE: f64 = 2.3;

/// Calibrates the probabilities by counts of edges whose junctions have these covariances, in
/// a scene of that radius. Where no view shows any edge they stay as they are.
pub(super) fn calibrate(
    by_counts: &[f64],
    edges: &[[usize; 2]],
    found: &[EdgeProvenance],
    covariances: &[Option<Matrix3<f64>>],
    scene_radius: f64,
) -> Vec<f64> {
    let Some(whole_share) = whole_share(by_counts, found) else {
        return by_counts.to_vec();
    };
    let sigma = |junction: &usize| match &covariances[*junction] {
        Some(covariance) => largest_eigenvalue(covariance).max(0.0).sqrt() / scene_radius,
        None => f64::INFINITY,
    };
    let calibrated = |(edge, by_counts): (&[usize; 2], &f64)| {
        // The better end: the other may lie anywhere on a line that is there.
        let sigma = edge.iter().map(sigma).fold(f64::INFINITY, f64::min);
        probability(*by_counts, sigma, whole_share)
    };
    edges.iter().zip(by_counts).map(calibrated).collect()
}

/// Neither 0 nor 1.
fn probability(by_counts: f64, relative_sigma: f64, whole_share: f64) -> f64 {
    let counts = (by_counts / (1.0 - by_counts)).ln();
    let sigma = relative_sigma.clamp(TELLING_SIGMAS[0], TELLING_SIGMAS[1]);
    let precision = (REFERENCE_SIGMA / sigma).ln();
    let log_odds = BASE + PRECISION * precision + WHOLE * whole_share + counts.min(0.0);
    possible(1.0 / (1.0 + (-log_odds).exp()))
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
            calibrate(by_counts, &edges, found, &covariances, 1.0)
        };
        let whole: Vec<_> = (0..4).map(|_| shown(9, 5)).collect();
        let parts: Vec<_> = (0..4).map(|_| shown(9, 4)).collect();
        let [in_whole, in_parts] = [of(&clear, &whole), of(&clear, &parts)];
        // The better end of each counts.
        assert!(in_whole[0] > 0.98 && in_whole[1] > 0.95, "{in_whole:?}");
        assert!(in_whole[3] < 0.7 && in_parts[3] < 0.15, "{in_parts:?}");
        for probabilities in [&in_whole, &in_parts] {
            assert!(probabilities.is_sorted_by(|a, b| a > b));
        }
        assert!(in_whole.iter().zip(&in_parts).all(|(a, b)| a > b));
        // What counts speak against is none, however exact its junctions are …
        assert!(of(&[0.01; 4], &whole)[0] < 0.5);
        assert!(of(&[0.001; 4], &parts)[0] < 0.01);
        // … and does not tell what its scene is like.
        let mixed = [shown(9, 5), shown(9, 5), shown(9, 0), shown(9, 0)];
        let of_mixed = of(&[0.999, 0.999, 0.001, 0.001], &mixed);
        assert!((of_mixed[0] - in_whole[0]).abs() < 1e-3, "{of_mixed:?}");
    }

    #[test]
    fn the_unit_of_length_does_not_matter_and_nothing_known_changes_nothing() {
        let found = [shown(3, 3)];
        let ask = |sigma: f64, radius: f64| {
            calibrate(&[0.99], &[[0, 1]], &found, &[variance(sigma), None], radius)[0]
        };
        assert!((ask(0.002, 1.0) - ask(0.4, 200.0)).abs() < 1e-12);
        assert!(ask(f64::INFINITY, 1.0) > 0.0 && ask(0.0, 1.0) < 1.0);
        let unseen = calibrate(&[0.8], &[[0, 1]], &[shown(0, 0)], &[None, None], 1.0);
        assert_eq!(unseen, [0.8]);
    }
}
