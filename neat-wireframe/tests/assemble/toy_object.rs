//! The authors' toy object with its real HAWP detections and images, and nothing else.
//!
//! The data are not part of the repository: set `NEAT_DATA`, or keep them in
//! `../shared/data`.

use crate::scores::scores_within;
use neat_core::ground_truth::read_wireframe;
use neat_core::{EdgelMap, LoadOptions, load_scene};
use neat_detect::{DetectorConfig, edgel_map};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::{
    AssembleConfig, Line3dConfig, assemble, line3d, wireframe_of_segments,
};
use std::path::PathBuf;

/// The folder of the toy object, or `None`, said aloud, where there is none.
#[expect(clippy::print_stderr, reason = "a skipped test must say so")]
fn toy_dir() -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let data = std::env::var_os("NEAT_DATA").map_or_else(|| default.into(), PathBuf::from);
    let dir = data.join("abc-00075213");
    if dir.is_dir() {
        return Some(dir);
    }
    eprintln!("skipped: {} is not there, set NEAT_DATA", dir.display());
    None
}

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
