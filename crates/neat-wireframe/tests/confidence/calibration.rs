//! Probabilities of existence: as often true as they say.

use crate::noise::Noise;
use crate::scenario::{Detector, Scene, scene};
use neat_core::synthetic::Solid;
use neat_core::{LineSegment3, Wireframe3d};
use neat_wireframe::SignedDistance;
use neat_wireframe::confidence::{ConfidenceConfig, assess};

/// The truth without some of its edges and with as many false ones: pairs of
/// junctions that no edge joins or runs along.
fn with_false_edges(scene: &Scene, seed: u64) -> (Wireframe3d, Vec<bool>) {
    let truth = &scene.truth;
    let mut noise = Noise(seed);
    let mut wireframe = truth.clone();
    let mut is_true = vec![true; truth.edges.len()];
    let runs_along = |pair: &LineSegment3, edge: &LineSegment3| {
        let far = edge.ends().map(|end| {
            let foot = pair.point_at(pair.line_parameter(&end));
            (foot - end).norm()
        });
        far[0].max(far[1]) < 0.05
    };
    while wireframe.edges.len() < 2 * truth.edges.len() {
        let [a, b] = [(); 2].map(|()| noise.below(truth.junctions.len()));
        let pair = LineSegment3::new(truth.junctions[a], truth.junctions[b]);
        if a != b && !truth.segments().iter().any(|edge| runs_along(&pair, edge)) {
            wireframe.edges.push([a, b]);
            is_true.push(false);
        }
    }
    (wireframe, is_true)
}

/// (probability, whether the edge is true) of edges of many scenes.
fn judged(with_surface: bool, views: usize) -> Vec<(f64, bool)> {
    let mut judged = Vec::new();
    for seed in 0..4 {
        for solid in Solid::ALL {
            let scene = scene(solid, Detector::Segments, 0.7, views, seed);
            let (wireframe, is_true) = with_false_edges(&scene, seed);
            let surface = with_surface.then_some(&scene.surface as &dyn SignedDistance);
            let config = ConfidenceConfig::default();
            let observations = &scene.observations;
            let confidence = assess(&wireframe, observations, surface, 1.0, &config).unwrap();
            let probabilities = confidence.edges.iter().map(|edge| edge.probability);
            judged.extend(probabilities.zip(is_true));
        }
    }
    judged
}

/// Mean squared difference of probability and truth.
fn brier_score(judged: &[(f64, bool)], probability: impl Fn(f64) -> f64) -> f64 {
    let square = |(p, is_true): &(f64, bool)| (probability(*p) - f64::from(*is_true)).powi(2);
    judged.iter().map(square).sum::<f64>() / judged.len() as f64
}

#[test]
fn probabilities_are_calibrated() {
    for (with_surface, views) in [(false, 40), (true, 40), (false, 10), (true, 10)] {
        let judged = judged(with_surface, views);
        let score = brier_score(&judged, |p| p);
        let share_true =
            judged.iter().filter(|(_, is_true)| *is_true).count() as f64 / judged.len() as f64;
        let constant = brier_score(&judged, |_| share_true);
        let case = format!("surface {with_surface}, {views} views: {score} of {constant}");
        assert!(score < 0.3 * constant, "{case}");

        // Reliability: what is said in bins of 0.2 agrees with what is true, as far
        // as so few edges tell (three standard deviations, and 0.12 of the model).
        for bin in 0..5 {
            let low = 0.2 * f64::from(bin);
            let in_bin: Vec<_> = (judged.iter())
                .filter(|(p, _)| (low..low + 0.2).contains(p))
                .collect();
            let count = in_bin.len() as f64;
            if count < 10.0 {
                continue;
            }
            let said = in_bin.iter().map(|(p, _)| p).sum::<f64>() / count;
            let is = in_bin.iter().filter(|(_, is_true)| *is_true).count() as f64 / count;
            let slack = 0.12 + 3.0 * (said * (1.0 - said) / count).sqrt();
            assert!(
                (said - is).abs() < slack,
                "{case}: {count} say {said}, {is} are"
            );
        }
    }
}

#[test]
fn the_surface_tells_which_views_ought_to_show_an_edge() {
    let scene = scene(Solid::Box, Detector::Vertices, 0.5, 40, 2);
    let config = ConfidenceConfig::default();
    let ask = |surface| assess(&scene.truth, &scene.observations, surface, 1.0, &config).unwrap();
    let without = ask(None);
    let with = ask(Some(&scene.surface as &dyn SignedDistance));
    for (without, with) in without.edges.iter().zip(&with.edges) {
        // Every edge of a box is hidden from a quarter of all sides.
        assert_eq!(without.supports, with.supports);
        assert!(without.expected_views >= 38);
        assert!(
            (20..=36).contains(&with.expected_views),
            "{}",
            with.expected_views
        );
        assert!(with.showing_views as f64 >= 0.6 * with.expected_views as f64);
        assert!(with.probability > 0.9);
    }
}
