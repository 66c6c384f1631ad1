//! Probabilities of existence: as often true as they say.

use crate::noise::Noise;
use crate::reliability::{Bin, bins, brier_score, judged};
use crate::scenario::{Detector, scene};
use nalgebra::Vector3;
use neat_core::synthetic::Solid;
use neat_core::{LineSegment2, LineSegment3, ScoredSegment2};
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
        // as so few edges tell (three standard deviations, and 0.12 of the model). Less may be
        // said than is: nothing here looks like an edge that is none.
        for Bin { count, said, is } in bins(&judged) {
            if count >= 10 {
                let deviation = 3.0 * (said * (1.0 - said) / count as f64).sqrt();
                let slack = [0.12, 0.25].map(|of_model| of_model + deviation);
                assert!(
                    said - is < slack[0] && is - said < slack[1],
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

/// As the outlines of round things: every view shows a line, each a little aside of where the
/// others do.
#[test]
fn lines_on_whose_place_views_do_not_agree_are_less_probable() {
    const LINES: usize = 4;
    let mut scene = scene(Solid::Box, Detector::Vertices, 0.3, 40, 5);
    let mut noise = Noise(9);
    let mut wireframe = scene.truth.clone();
    for line in 0..LINES {
        let middle = Vector3::new(-0.6 + 0.4 * line as f64, 0.7, 0.0);
        let ends = [-0.3, 0.3].map(|z| middle + z * Vector3::z());
        wireframe
            .edges
            .push([0, 1].map(|end| wireframe.junctions.len() + end));
        wireframe.junctions.extend(ends);
        for observation in &mut scene.observations {
            let edge = observation.segments.len();
            let exact = LineSegment3::new(ends[0], ends[1])
                .map(|end| observation.camera.project(end).pixel);
            let aside = 2.0 * noise.normal2();
            observation.segments.push(ScoredSegment2 {
                segment: LineSegment2::new(exact.start + aside, exact.end + aside),
                score: 0.9,
                edge,
            });
        }
    }
    let config = ConfidenceConfig::default();
    let confidence = assess(&wireframe, &scene.observations, None, 1.0, &config).unwrap();
    let (edges, lines) = confidence.edges.split_at(scene.truth.edges.len());
    let odds = |p: f64| p / (1.0 - p);
    let least = edges.iter().map(|e| e.probability).fold(1.0, f64::min);
    assert!(least > 0.95, "{least}");
    for line in lines {
        // By counts they are as sure as the edges.
        assert!(line.showing_views.len() >= 20);
        let probability = line.probability;
        assert!(
            1.8 * odds(probability) < odds(least),
            "{probability} of {least}"
        );
    }
}
