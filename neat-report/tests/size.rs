//! A page stays small enough to be mailed.

use image::{Rgb, RgbImage};
use nalgebra::{Vector2, Vector3};
use neat_core::synthetic::{SyntheticScene, generate};
use neat_core::{Camera, LineSegment2, LoadOptions, Wireframe2d, load_scene};
use neat_report::{JunctionSnapshot, PhotographConfig, Report};
use neat_wireframe::export::{SupportingSegment, WireframeDocument};
use std::path::PathBuf;

/// Of a scene of 49 views with 1000 edges.
const MAX_BYTES: usize = 8_000_000;
const EDGES: usize = 1000;

/// Numbers that look like chance.
fn scrambled(seed: usize) -> f64 {
    let bits = (seed as u64)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .rotate_left(31)
        .wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (bits >> 40) as f64 / (1_u64 << 24) as f64
}

/// Edges between scrambled points, each supported by a third of the views.
fn crowded(document: &mut WireframeDocument, views: &[String]) {
    document.edges = (0..EDGES).map(|i| [2 * i, 2 * i + 1]).collect();
    document.views = views.to_vec();
    document.edge_support = (0..EDGES)
        .map(|edge| {
            let of_view = |view: usize| SupportingSegment {
                view,
                segment: [0, 1, 2, 3].map(|i| 1000.0 * scrambled(97 * edge + 7 * view + i)),
                residual: scrambled(edge + view),
            };
            (0..views.len()).step_by(3).map(of_view).collect()
        })
        .collect();
}

#[test]
fn a_page_of_rough_photographs_is_small() {
    let data = generate(&SyntheticScene {
        views: 49,
        image_size: 16,
        ..SyntheticScene::default()
    })
    .unwrap();
    let mut scene = data.scene;
    for (index, view) in scene.views.iter_mut().enumerate() {
        // Rough everywhere: as many bytes as a photograph of gravel needs.
        view.image = RgbImage::from_fn(800, 600, |x, y| {
            let at = (index * 600 + y as usize) * 800 + x as usize;
            Rgb([0, 1, 2].map(|c| (96.0 + 64.0 * scrambled(3 * at + c)) as u8))
        })
        .into();
        view.wireframe = Wireframe2d::empty(800, 600);
    }
    let mut document = WireframeDocument {
        junctions: (0..2 * EDGES)
            .map(|i| Vector3::new(scrambled(i), scrambled(i + 1), scrambled(i + 2)))
            .collect(),
        ..WireframeDocument::default()
    };
    let names: Vec<String> = scene.views.iter().map(|view| view.name.clone()).collect();
    crowded(&mut document, &names);
    let mut report =
        Report::of_scene(&scene, document, 0.05, &PhotographConfig::default()).unwrap();
    for view in &mut report.views {
        let end = |i| Vector2::new(800.0 * scrambled(i), 600.0 * scrambled(i + 1));
        view.segments = (0..EDGES)
            .map(|i| LineSegment2::new(end(4 * i), end(4 * i + 2)))
            .collect();
    }
    report.junction_evolution = (0..100)
        .map(|step| JunctionSnapshot::new(step, &report.document.junctions[..1024]))
        .collect();
    let bytes = report.render().unwrap().len();
    assert!(bytes < MAX_BYTES, "{bytes} bytes");
}

/// The data are not part of the repository: set `NEAT_DATA`, or keep them in
/// `../shared/data`.
#[test]
#[expect(clippy::print_stderr, reason = "a skipped test must be seen")]
fn a_page_of_a_real_scene_is_small() {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let root = std::env::var_os("NEAT_DATA").map_or_else(|| default.into(), PathBuf::from);
    let dir = root.join("dtu-scan24");
    if !dir.is_dir() {
        eprintln!("skipped: no real data at {}", dir.display());
        return;
    }
    let options = LoadOptions {
        require_wireframes: false,
        ..LoadOptions::default()
    };
    let scene = load_scene(&dir, &options).unwrap().scene;
    let points = scene.sparse_points.iter().take(2 * EDGES);
    let mut document = WireframeDocument {
        junctions: points
            .map(|point| scene.original_from_world.apply(&point.position_in_world))
            .collect(),
        ..WireframeDocument::default()
    };
    let names: Vec<String> = scene.views.iter().map(|view| view.name.clone()).collect();
    crowded(&mut document, &names);
    let report = Report::of_scene(&scene, document, 0.05, &PhotographConfig::default()).unwrap();
    assert_eq!(report.views.len(), 49);
    // Poses are in the frame of the files, as the junctions are.
    let seen = |camera: &Camera, point: &Vector3<f64>| camera.project(point).pixel;
    let in_world = &scene.sparse_points[0].position_in_world;
    let before = seen(&scene.views[3].camera, in_world);
    let after = seen(&report.views[3].camera, &report.document.junctions[0]);
    assert!((before - after).norm() < 1e-6);
    let bytes = report.render().unwrap().len();
    assert!(bytes < MAX_BYTES, "{bytes} bytes");
}
