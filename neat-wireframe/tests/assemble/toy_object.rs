//! The authors' toy object with its real HAWP detections and images, and nothing else.

use crate::scores::scores_within;
use crate::toy_data::toy_dir;
use neat_core::ground_truth::read_wireframe;
use neat_core::{EdgelMap, LoadOptions, load_scene};
use neat_detect::{DetectorConfig, edgel_map};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::{
    AssembleConfig, Line3dConfig, assemble, line3d, wireframe_of_segments,
};

#[test]
fn the_true_graph_comes_back_among_others() {
    let Some(dir) = toy_dir() else {
        return;
    };
    let scene = load_scene(&dir, &LoadOptions::default()).unwrap().scene;
    let truth = read_wireframe(&dir.join("gt_wireframe.json")).unwrap();
    let views = ViewObservation::from_scene(&scene, 0.05);
    let edgels: Vec<EdgelMap> = (scene.views.iter())
        .map(|view| {
            let image = view.image.read().unwrap();
            edgel_map(&image, &DetectorConfig::default(), scene.pixel_center)
        })
        .collect();
    let config = AssembleConfig::default();
    let result = assemble(&views, &edgels, scene.sphere_radius, &config);
    let wireframe = result
        .wireframe
        .map(|junction| scene.original_from_world.apply(junction));
    let (junctions, segments) = scores_within(0.01, &wireframe, &truth);
    assert_eq!(junctions.recall, 1.0);
    assert_eq!(segments.recall, 1.0);
    // Half of the edges and most of the junctions are no truth: the object has a round hole,
    // and its chords are seen by many views too.
    assert!(junctions.precision >= 0.35, "{junctions:?}");
    assert!(segments.precision >= 0.5, "{segments:?}");
}

#[test]
fn the_baseline_finds_most_edges_and_no_graph() {
    let Some(dir) = toy_dir() else {
        return;
    };
    let scene = load_scene(&dir, &LoadOptions::default()).unwrap().scene;
    let truth = read_wireframe(&dir.join("gt_wireframe.json")).unwrap();
    let views = ViewObservation::from_scene(&scene, 0.05);
    let found = line3d(&views, scene.sphere_radius, &Line3dConfig::default());
    let wireframe =
        wireframe_of_segments(&found).map(|junction| scene.original_from_world.apply(junction));
    let (junctions, segments) = scores_within(0.01, &wireframe, &truth);
    assert!(segments.recall >= 0.8);
    // Each edge has ends of its own: the corners are there several times.
    assert!(junctions.precision < 0.5);
}
