//! True and false edges, and what the assessment says of them.

use crate::noise::Noise;
use crate::scenario::{Detector, Scene, scene};
use neat_core::synthetic::Solid;
use neat_core::{LineSegment3, Wireframe3d};
use neat_wireframe::SignedDistance;
use neat_wireframe::confidence::{ConfidenceConfig, assess};

/// The truth with as many false edges as it has true ones: pairs of
/// junctions that no edge joins or runs along.
pub fn with_false_edges(scene: &Scene, seed: u64) -> (Wireframe3d, Vec<bool>) {
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
pub fn judged(with_surface: bool, views: usize) -> Vec<(f64, bool)> {
    let mut judged = Vec::new();
    for seed in 0..4 {
        for solid in Solid::POLYHEDRA {
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
pub fn brier_score(judged: &[(f64, bool)], probability: impl Fn(f64) -> f64) -> f64 {
    let square = |(p, is_true): &(f64, bool)| (probability(*p) - f64::from(*is_true)).powi(2);
    judged.iter().map(square).sum::<f64>() / judged.len() as f64
}

/// A bin of probabilities: how many edges, their mean probability, and how many of
/// them are true.
pub struct Bin {
    pub count: usize,
    pub said: f64,
    pub is: f64,
}

/// Five bins of the same width.
pub fn bins(judged: &[(f64, bool)]) -> Vec<Bin> {
    let bin = |index: u32| {
        let low = 0.2 * f64::from(index);
        let in_bin: Vec<_> = (judged.iter())
            .filter(|(p, _)| (low..low + 0.2).contains(p))
            .collect();
        let count = in_bin.len() as f64;
        Bin {
            count: in_bin.len(),
            said: in_bin.iter().map(|(p, _)| p).sum::<f64>() / count,
            is: in_bin.iter().filter(|(_, is_true)| *is_true).count() as f64 / count,
        }
    };
    (0..5).map(bin).collect()
}
