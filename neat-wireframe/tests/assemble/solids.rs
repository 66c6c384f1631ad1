//! Solids with noisy, incomplete and false detections.

use crate::scores::scores_within;
use nalgebra::Vector3;
use neat_core::synthetic::{Solid, SyntheticData, SyntheticScene, generate};
use neat_core::{CircularArc, EdgelMap, LineSegment2, LineSegment3};
use neat_detect::{DetectorConfig, edgel_map};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::{
    AssembleConfig, Assembled, Witnesses, assemble, assemble_with_progress,
};
use neat_wireframe::paper::NeatLine;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

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

fn reconstruct(data: &SyntheticData) -> Assembled {
    let observations = ViewObservation::from_scene(&data.scene, 0.05);
    let radius = data.scene.sphere_radius;
    assemble(&observations, &[], radius, &AssembleConfig::default())
}

/// (precision, recall) of segments within 0.01 at both ends.
fn precision_and_recall(data: &SyntheticData, result: &Assembled) -> (f64, f64) {
    let (_, segments) = scores_within(0.01, &result.wireframe, &data.truth);
    (segments.precision, segments.recall)
}

#[test]
fn noisy_detections_give_the_true_edges() {
    for (seed, solid) in (0..).zip(Solid::POLYHEDRA) {
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
fn a_circle_beside_a_box_comes_back_as_one_arc() {
    let truth = CircularArc {
        center: Vector3::new(0.05, -0.1, 0.1),
        axes: [Vector3::new(0.6, 0.8, 0.0), Vector3::z()],
        radius: 0.4,
        angles: [0.0, TAU],
    };
    let config = SyntheticScene {
        solid: Solid::Box,
        views: 40,
        noise_in_pixels: 0.0,
        shading: false,
        ..SyntheticScene::default()
    };
    let data = generate(&config).unwrap();
    let observations = ViewObservation::from_scene(&data.scene, 0.05);
    let edgels: Vec<EdgelMap> = (observations.iter())
        .map(
            |ViewObservation {
                 camera, segments, ..
             }| {
                let pixels: Vec<_> = (truth.points(0.05).iter())
                    .map(|point| camera.project(point).pixel)
                    .collect();
                let chords = pixels
                    .windows(2)
                    .map(|ends| LineSegment2::new(ends[0], ends[1]));
                let shapes: Vec<LineSegment2> = (segments.iter())
                    .map(|found| found.segment)
                    .chain(chords)
                    .collect();
                EdgelMap::of_segments(&shapes, camera.width, camera.height)
            },
        )
        .collect();
    let radius = data.scene.sphere_radius;
    let result = assemble(&observations, &edgels, radius, &AssembleConfig::default());
    assert_eq!(precision_and_recall(&data, &result), (1.0, 1.0));
    assert_eq!(result.arcs.len(), 1, "{:?}", result.arcs);
    let arc = &result.arcs[0];
    assert!((arc.center - truth.center).norm() < 2e-3);
    assert!((arc.radius - truth.radius).abs() < 2e-3);
    assert!(arc.sweep() > 6.1);
}

#[test]
fn a_box_comes_back_exactly() {
    let data = scene(Solid::Box, 3);
    let result = reconstruct(&data);
    assert_eq!(result.wireframe.junctions.len(), 8);
    assert_eq!(result.wireframe.edges.len(), 12);
    assert_eq!(precision_and_recall(&data, &result), (1.0, 1.0));
}

/// NEAT lines of a field that puts every 2D segment up to `error` aside.
fn field_lines(data: &SyntheticData, views: &[ViewObservation], error: f64) -> Vec<Vec<NeatLine>> {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut aside = || Vector3::from_fn(|_, _| rng.random_range(-error..error));
    let mut line = |view: &ViewObservation, segment_in_view: usize| {
        let detected = view.segments[segment_in_view].segment;
        // The true edge that the segment is nearest to.
        let edges = data.truth.segments();
        let seen = |edge: &LineSegment3| edge.map(|end| view.camera.project(end).pixel);
        let distance = |edge: &LineSegment3| detected.unordered_squared_end_distance(&seen(edge));
        let nearest = edges
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let edge = nearest.unwrap();
        NeatLine {
            segment_in_view,
            segment: LineSegment3::new(edge.start + aside(), edge.end + aside()),
            rays: 1,
            support_distance: 0.0,
        }
    };
    let mut lines_of = |view: &ViewObservation| {
        let segments = 0..view.segments.len();
        segments.map(|segment| line(view, segment)).collect()
    };
    views.iter().map(&mut lines_of).collect()
}

#[test]
fn partners_of_an_inexact_field_give_the_exact_box() {
    let data = scene(Solid::Box, 3);
    let views = ViewObservation::from_scene(&data.scene, 0.05);
    let radius = data.scene.sphere_radius;
    let config = AssembleConfig::default();
    let with = |lines: &[Vec<NeatLine>]| {
        let go_on = &mut |_| ControlFlow::Continue(());
        let witnesses = Witnesses {
            views: &views,
            field_lines: Some(lines),
            ..Witnesses::default()
        };
        match assemble_with_progress(&witnesses, radius, &config, go_on) {
            ControlFlow::Continue(assembled) => assembled,
            ControlFlow::Break(()) => unreachable!("nobody breaks"),
        }
    };
    let result = with(&field_lines(&data, &views, 0.05 * radius));
    assert_eq!(precision_and_recall(&data, &result), (1.0, 1.0));
    // Segments that the field does not know have no partner, whatever the poses allow.
    let unknown = vec![Vec::new(); views.len()];
    assert!(with(&unknown).wireframe.edges.is_empty());
    assert_eq!(with(&unknown[1..]), Assembled::default());
}

#[test]
fn images_show_a_box_as_well_as_its_segments() {
    let data = generate(&SyntheticScene {
        solid: Solid::Box,
        views: 20,
        ..SyntheticScene::default()
    })
    .unwrap();
    let edgels: Vec<EdgelMap> = (data.scene.views.iter())
        .map(|view| {
            let image = view.image.read().unwrap();
            edgel_map(&image, &DetectorConfig::default(), data.scene.pixel_center)
        })
        .collect();
    let observations = ViewObservation::from_scene(&data.scene, 0.05);
    let radius = data.scene.sphere_radius;
    let result = assemble(&observations, &edgels, radius, &AssembleConfig::default());
    assert_eq!(precision_and_recall(&data, &result), (1.0, 1.0));
}

#[test]
fn the_number_of_threads_and_the_unit_of_length_do_not_matter() {
    let data = scene(Solid::Box, 5);
    let observations = ViewObservation::from_scene(&data.scene, 0.05);
    let config = AssembleConfig::default();
    let radius = data.scene.sphere_radius;
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| assemble(&observations, &[], radius, &config))
    };
    let alone = with_threads(1);
    let many = with_threads(5);
    assert_eq!(alone, many);

    // A power of two: the arithmetic is the same to the last bit.
    let mut scaled = observations.clone();
    for view in &mut scaled {
        view.camera.center_in_world *= 4.0;
    }
    let scaled = assemble(&scaled, &[], 4.0 * radius, &config);
    assert_eq!(scaled.wireframe.map(|x| x / 4.0), alone.wireframe);
}
