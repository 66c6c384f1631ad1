//! Probabilities of existence: as often true as they say.

use crate::reliability::{Bin, bins, brier_score, judged};
use crate::scenario::{Detector, scene};
use neat_core::synthetic::Solid;
use neat_wireframe::SignedDistance;
use neat_wireframe::confidence::{ConfidenceConfig, assess};

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
        for Bin { count, said, is } in bins(&judged) {
            if count >= 10 {
                let slack = 0.12 + 3.0 * (said * (1.0 - said) / count as f64).sqrt();
                assert!(
                    (said - is).abs() < slack,
                    "{case}: {count} say {said}, {is} are"
                );
            }
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
        assert!(with.showing_views.len() as f64 >= 0.6 * with.expected_views as f64);
        assert!(with.probability > 0.9);
    }
}
