//! How often the truth lies in the ellipsoids that the assessment claims, on
//! synthetic solids with detections of known noise.
//!
//! ```text
//! cargo run --release -p neat-wireframe --example honest_covariances
//! ```
//!
//! Prints one line per noise, number of views, detector and back end: "adjusted"
//! is the true graph, displaced and brought back by bundle adjustment to the
//! detections of its edges, "given" the displaced graph itself (0.003 per coordinate),
//! "assembled" what the assembler finds. A second table compares the
//! probabilities of true and false edges with the truth.

#![expect(clippy::print_stdout, reason = "an example shows its results")]

#[path = "../../tests/confidence/noise.rs"]
mod noise;
#[path = "../../tests/confidence/reliability.rs"]
mod reliability;
#[path = "../../tests/confidence/scenario.rs"]
mod scenario;

use nalgebra::Vector3;
use neat_core::Wireframe3d;
use neat_core::synthetic::Solid;
use neat_wireframe::assemble::{AssembleConfig, assemble};
use neat_wireframe::confidence::{ConfidenceConfig, DetectionNoise, assess};
use reliability::{Bin, bins, brier_score, judged};
use scenario::{Coverage, Detector, Scene, adjusted, displaced, scene};

const SEEDS: u64 = 2;
/// An assembled junction farther than this from all true ones is another
/// mistake than noise.
const MAX_ERROR: f64 = 0.03;

fn main() {
    print_covariances();
    println!();
    print_probabilities();
}

/// How often edges of one probability exist, where as many false edges have been
/// added as there are true ones.
fn print_probabilities() {
    println!("| views | surface | probability | edges | mean probability | true | Brier score |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for views in [10, 40] {
        for with_surface in [false, true] {
            let judged = judged(with_surface, views);
            let score = brier_score(&judged, |probability| probability);
            for (index, Bin { count, said, is }) in (0..).zip(bins(&judged)) {
                if count == 0 {
                    continue;
                }
                let low = 0.2 * f64::from(index);
                println!(
                    "| {views} | {with_surface} | {low:.1} to {:.1} | {count} | {said:.3} | {is:.3} | {score:.3} |",
                    low + 0.2,
                );
            }
        }
    }
}

fn print_covariances() {
    println!(
        "| noise | views | detector | wireframe | junctions | without | 50 % | 68 % | 95 % | lengths 95 % | median sigma | median error | estimated noise |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for detector in [Detector::Vertices, Detector::Segments] {
        for views in [12, 40] {
            for sigma in [0.3, 0.5, 1.0] {
                let scenes: Vec<(u64, Scene)> = (0..SEEDS)
                    .flat_map(|seed| Solid::POLYHEDRA.map(|solid| (seed, solid)))
                    .map(|(seed, solid)| (seed, scene(solid, detector, sigma, views, seed)))
                    .collect();
                for (name, wireframe) in WIREFRAMES {
                    let (coverage, noise) = measure(&scenes, wireframe);
                    let [half, two_thirds, most] = coverage.shares();
                    let [claimed, error] = coverage.medians();
                    println!(
                        "| {sigma} | {views} | {detector:?} | {name} | {} | {} | {half:.2} | {two_thirds:.2} | {most:.3} | {:.3} | {claimed:.5} | {error:.5} | {:.2} {:.2} {:.2} |",
                        coverage.junctions,
                        coverage.undetermined,
                        coverage.share_of_lengths(),
                        noise.vertex,
                        noise.across,
                        noise.along,
                    );
                }
            }
        }
    }
}

type Make = fn(&Scene, u64) -> Wireframe3d;

const WIREFRAMES: [(&str, Make); 3] = [
    ("adjusted", |scene, seed| {
        adjusted(&scene.observations, &scene.truth, seed)
    }),
    ("given", |scene, seed| displaced(&scene.truth, seed)),
    ("assembled", assembled),
];

fn assembled(scene: &Scene, _: u64) -> Wireframe3d {
    let config = AssembleConfig::default();
    assemble(&scene.observations, &[], 1.0, &config).wireframe
}

fn measure(scenes: &[(u64, Scene)], make: Make) -> (Coverage, DetectionNoise) {
    let mut coverage = Coverage::default();
    let mut last_noise = None;
    for (seed, scene) in scenes {
        let wireframe = make(scene, *seed);
        let config = ConfidenceConfig::default();
        let confidence = assess(&wireframe, &scene.observations, None, 1.0, &config);
        let confidence = confidence.expect("back ends return valid wireframes");
        let nearest = |index: usize| -> Option<Vector3<f64>> {
            let junction = wireframe.junctions[index];
            let distance = |x: &Vector3<f64>| (x - junction).norm();
            let truth = scene.truth.junctions.iter();
            let nearest = truth.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            (distance(nearest) < MAX_ERROR).then_some(*nearest)
        };
        coverage.add(&wireframe, &confidence, nearest);
        last_noise = Some(confidence.noise);
    }
    (coverage, last_noise.expect("there is at least one scene"))
}
