//! What graph refinement is worth: the same run with and without it.

use crate::field::{BlockSurface, observations, proposals, supported_truth};
use crate::score::Score;
use neat_core::synthetic::BlockScene;
use neat_wireframe::fast::{FastBackEndConfig, Step, run};

#[test]
fn refinement_reduces_the_junction_error_threefold() {
    for (seed, noise_in_pixels) in [(0, 0.5), (1, 1.0)] {
        let scene = BlockScene {
            blocks: 6,
            views: 30,
            seed,
            noise_in_pixels,
            ..BlockScene::default()
        };
        let data = scene.generate().unwrap();
        let (views, proposals) = (observations(&data), proposals(&data, seed));
        let surface = BlockSurface(&data.blocks);
        let supported = supported_truth(&data, 5);
        let score = |config: &FastBackEndConfig| {
            let result = run(&views, &proposals, &[], &surface, 1.0, config);
            Score::new(&result.wireframe, &data.truth, &supported, 0.01)
        };
        let refined = score(&FastBackEndConfig::default());
        let unrefined = score(&FastBackEndConfig {
            bundle_adjustment: false,
            retriangulation: false,
            ..Default::default()
        });
        assert!(3.0 * refined.median_junction_error < unrefined.median_junction_error);
        assert!(refined.junction_precision >= unrefined.junction_precision);
        assert!(refined.junction_recall >= unrefined.junction_recall);
        assert!(refined.edge_recall >= unrefined.edge_recall);
        assert!(refined.edge_recall > 0.95 && refined.edge_precision > 0.95);
    }
}

#[test]
fn the_report_accounts_for_every_junction_and_edge() {
    let scene = BlockScene {
        blocks: 4,
        views: 20,
        ..BlockScene::default()
    };
    let data = scene.generate().unwrap();
    let (views, proposals) = (observations(&data), proposals(&data, 0));
    let surface = BlockSurface(&data.blocks);
    let config = FastBackEndConfig::default();
    let result = run(&views, &proposals, &[], &surface, 1.0, &config);
    let (mut junctions, mut edges) = (0, 0);
    for step in &result.report.steps {
        junctions = junctions + step.added_junctions - step.removed_junctions;
        edges = edges + step.added_edges - step.removed_edges;
        assert_eq!((step.junctions, step.edges), (junctions, edges), "{step:?}");
    }
    assert_eq!(junctions, result.wireframe.junctions.len());
    assert_eq!(edges, result.wireframe.edges.len());
    let last = result.report.steps.last().unwrap().step;
    assert_eq!(last, Step::EdgeSplitting);
}
