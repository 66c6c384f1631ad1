//! The authors' toy object with its real HAWP detections, whose noise is neither
//! normal nor independent.

use crate::scenario::{Coverage, adjusted};
use crate::toy_data::toy_dir;
use neat_core::ground_truth::read_wireframe;
use neat_core::{LoadOptions, load_scene};
use neat_wireframe::ViewObservation;
use neat_wireframe::confidence::{ConfidenceConfig, assess};

#[expect(clippy::print_stderr, reason = "the figures are worth a look")]
#[test]
fn real_detections_are_covered_reasonably() {
    let Some(dir) = toy_dir() else {
        return;
    };
    let scene = load_scene(&dir, &LoadOptions::default()).unwrap().scene;
    let observations = ViewObservation::from_scene(&scene, 0.05);
    let truth = read_wireframe(&dir.join("gt_wireframe.json")).unwrap();
    for step in [1, 4, 8] {
        let mut coverage = Coverage::default();
        // Every `step`-th view, from each of the first ones.
        for first in 0..step {
            let part: Vec<_> = (observations.iter().skip(first))
                .step_by(step)
                .cloned()
                .collect();
            let wireframe = adjusted(&part, &truth, 1);
            let config = ConfidenceConfig::default();
            let confidence = assess(&wireframe, &part, None, 1.0, &config).unwrap();
            coverage.add(&wireframe, &confidence, |j| Some(truth.junctions[j]));
            if first == 0 {
                eprintln!("{} views: {:?}", part.len(), confidence.noise);
            }
        }
        let [half, two_thirds, most] = coverage.shares();
        let [claimed, error] = coverage.medians();
        eprintln!(
            "every {step}th view, {} junctions: {half:.2} {two_thirds:.2} {most:.2} inside 50, 68, \
             95 %; median sigma {claimed:.5}, error {error:.5}",
            coverage.junctions,
        );
        assert!(coverage.undetermined == 0 && most >= 0.5, "{coverage:?}");
    }
}
