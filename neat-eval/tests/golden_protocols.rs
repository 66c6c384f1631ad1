//! The protocols of NEAT against the published evaluation scripts (golden case
//! 12).

#[path = "../../neat-wireframe/tests/golden/mod.rs"]
mod golden;

use golden::{Geometry, Golden};
use neat_core::Wireframe3d;
use neat_eval::{NeatAbc, NeatSurface, ScannedSurface, wireframe_of_segments};
use neat_wireframe::metrics::PrecisionRecall;

/// Float64 on both sides: only the order of additions differs.
const TOLERANCE: f64 = 1e-9;

fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        assert!(
            (found - expected).abs() < TOLERANCE,
            "{what}: {found} is not {expected}"
        );
    }
}

#[test]
fn abc_and_surface_protocols_give_the_published_numbers() {
    let golden = Golden::open("12_metrics");
    let truth = Wireframe3d {
        junctions: golden.points("gt_junctions"),
        edges: golden.index_rows("gt_lines"),
    };
    let surface = ScannedSurface {
        points: golden.points("surface_points"),
        ..Default::default()
    };
    for set in ["A", "B"] {
        let expected = |name: &str| golden.numbers(&format!("{set}/{name}"));
        let mut graph = wireframe_of_segments(&golden.segments(&format!("{set}/lines")));
        let ends = graph.junctions.len() as f64;
        assert_eq!(ends, expected("n_unique_endpoints")[0]);

        let scores = NeatSurface::blended_mvs()
            .evaluate(&graph, &surface)
            .unwrap();
        let accuracy = [scores.junction_accuracy, scores.segment_accuracy];
        let of_script = [
            expected("acc_junctions_unique_endpoints")[0],
            expected("acc_lines")[0],
        ];
        assert_close(&accuracy.map(Option::unwrap), &of_script, set);
        let completeness = [scores.completeness.unwrap()];
        assert_close(&completeness, &expected("comp_lines"), set);

        let segments = NeatAbc::default().evaluate(&graph, None, &truth).unwrap();
        // The script's junctions are a list of their own.
        graph.junctions = golden.points(&format!("{set}/junctions"));
        graph.edges.clear();
        let junctions = NeatAbc::default().evaluate(&graph, None, &truth).unwrap();
        for (name, found) in [
            ("junctions_", &junctions.wireframe.junctions),
            ("lines_max/", &segments.wireframe.segments_max),
            ("lines_mean/", &segments.wireframe.segments_mean),
        ] {
            let of = |value: fn(&PrecisionRecall) -> f64| -> Vec<f64> {
                found.iter().map(value).collect()
            };
            assert_close(
                &of(|s| s.precision),
                &expected(&format!("{name}precision")),
                name,
            );
            assert_close(&of(|s| s.recall), &expected(&format!("{name}recall")), name);
        }
    }
}
