//! Solids with noisy, incomplete and false detections.

use crate::scores::scores_within;
use neat_core::synthetic::{Solid, SyntheticData, SyntheticScene, generate};
use neat_wireframe::line_tracks::{LineTracksConfig, LineTracksResult, run};
use neat_wireframe::{SegmentProposal, ViewObservation};

fn scene(solid: Solid, seed: u64) -> SyntheticData {
    let config = SyntheticScene {
        solid,
        views: 40,
        seed,
        shading: false,
        ..SyntheticScene::default()
    };
    generate(&config).unwrap()
}

fn reconstruct(data: &SyntheticData) -> LineTracksResult {
    let observations = ViewObservation::from_scene(&data.scene, 0.05);
    let radius = data.scene.sphere_radius;
    run(
        &observations,
        &[],
        None,
        radius,
        &LineTracksConfig::default(),
    )
}

/// (precision, recall) of segments within 0.01 at both ends.
fn precision_and_recall(data: &SyntheticData, result: &LineTracksResult) -> (f64, f64) {
    let (_, segments) = scores_within(0.01, &result.wireframe, &data.truth);
    (segments.precision, segments.recall)
}

#[test]
fn noisy_detections_give_the_true_edges() {
    for (seed, solid) in (0..).zip(Solid::ALL) {
        let data = scene(solid, seed);
        let result = reconstruct(&data);
        let (precision, recall) = precision_and_recall(&data, &result);
        assert!(
            precision >= 0.9 && recall >= 0.9,
            "{}: precision {precision:.3}, recall {recall:.3}",
            solid.name(),
        );
    }
}

#[test]
fn a_box_comes_back_exactly() {
    let data = scene(Solid::Box, 3);
    let result = reconstruct(&data);
    assert_eq!(result.wireframe.junctions.len(), 8);
    assert_eq!(result.wireframe.edges.len(), 12);
    assert_eq!(precision_and_recall(&data, &result), (1.0, 1.0));
}

#[test]
fn right_priors_do_no_harm_and_wrong_ones_little() {
    let data = scene(Solid::Box, 4);
    let observations = ViewObservation::from_scene(&data.scene, 0.05);
    let truth = data.truth.segments();
    let mut right = Vec::new();
    let mut wrong = Vec::new();
    for (view, observation) in observations.iter().enumerate() {
        let sources = &data.view_truths[view].sources;
        for (segment_in_view, detection) in observation.segments.iter().enumerate() {
            let Some(part) = sources[detection.edge] else {
                continue;
            };
            let edge = truth[data.view_truths[view].visible[part].edge];
            let projected = edge.map(|end| observation.camera.project(end).pixel);
            let oriented = if detection.segment.with_nearest_order(&projected) == projected {
                edge
            } else {
                edge.reversed()
            };
            let mut proposal = SegmentProposal {
                view,
                segment_in_view,
                segment: oriented,
                end_error_in_pixels: [0.0; 2],
                end_spread: [0.01; 2],
            };
            right.push(proposal);
            proposal.segment = oriented.map(|end| end * 0.8);
            wrong.push(proposal);
        }
    }
    let config = LineTracksConfig::default();
    let radius = data.scene.sphere_radius;
    for priors in [&right, &wrong] {
        let result = run(&observations, priors, None, radius, &config);
        assert_eq!(result.report.usable_priors, priors.len());
        assert_eq!(precision_and_recall(&data, &result), (1.0, 1.0));
    }
}

#[test]
fn every_edge_names_the_segments_that_show_it() {
    let data = scene(Solid::Box, 3);
    let result = reconstruct(&data);
    for (edge, evidence) in result.edges.iter().enumerate() {
        assert!(evidence.views >= 3);
        assert!(evidence.visible_views.is_none());
        let segment = result.wireframe.segment(edge);
        for support in &evidence.supports {
            let view = &data.scene.views[support.view];
            let detected = view.wireframe.segments(0.05)[support.segment_in_view].segment;
            let projected = segment.map(|end| view.camera.project(end).pixel);
            for end in detected.ends() {
                let foot = projected.point_at(projected.line_parameter(&end));
                assert!((foot - end).norm() < 2.5);
            }
        }
    }
}

#[test]
fn the_number_of_threads_and_the_unit_of_length_do_not_matter() {
    let data = scene(Solid::Box, 5);
    let observations = ViewObservation::from_scene(&data.scene, 0.05);
    let config = LineTracksConfig::default();
    let radius = data.scene.sphere_radius;
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| run(&observations, &[], None, radius, &config))
    };
    let alone = with_threads(1);
    let many = with_threads(5);
    assert_eq!(alone.wireframe, many.wireframe);
    assert_eq!((&alone.edges, &alone.report), (&many.edges, &many.report));

    // A power of two: the arithmetic is the same to the last bit.
    let mut scaled = observations.clone();
    for view in &mut scaled {
        view.camera.center_in_world *= 4.0;
    }
    let scaled = run(&scaled, &[], None, 4.0 * radius, &config);
    assert_eq!(scaled.wireframe.map(|x| x / 4.0), alone.wireframe);
}

#[test]
fn the_surface_says_where_edges_ought_to_be_seen() {
    use nalgebra::Vector3;
    use neat_wireframe::SignedDistance;

    struct Exact<'a>(&'a SyntheticData);
    impl SignedDistance for Exact<'_> {
        fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
            points.iter().map(|x| self.0.solid.sdf(x)).collect()
        }
        fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
            points
                .iter()
                .map(|x| self.0.solid.sdf_and_gradient(x))
                .collect()
        }
    }

    let data = scene(Solid::Box, 2);
    let observations = ViewObservation::from_scene(&data.scene, 0.05);
    let config = LineTracksConfig {
        occlusion_test: true,
        ..Default::default()
    };
    let radius = data.scene.sphere_radius;
    let result = run(&observations, &[], Some(&Exact(&data)), radius, &config);
    assert_eq!(result.wireframe.edges.len(), 12);
    assert!(
        result
            .edges
            .iter()
            .all(|edge| edge.visible_views >= Some(10))
    );
}
