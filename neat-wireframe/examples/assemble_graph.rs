//! A wireframe from cameras and 2D segments of any program: no field, no images.
//!
//! ```text
//! cargo run --release -p neat-wireframe --example assemble_graph -- [SCENE]
//! ```
//!
//! `SCENE` is a folder with cameras, images and 2D wireframes (`hawp/`). Without one, a
//! synthetic L-shaped solid is taken, with the errors of a detector.

#![expect(clippy::print_stdout, reason = "an example shows its results")]

use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_core::{LoadOptions, load_scene};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::{AssembleConfig, assemble};
use neat_wireframe::confidence::{ConfidenceConfig, assess};

/// Segments with a lower score are left out, as published.
const MIN_SCORE: f64 = 0.05;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = match std::env::args_os().nth(1) {
        Some(folder) => load_scene(folder, &LoadOptions::default())?.scene,
        None => {
            let config = SyntheticScene {
                solid: Solid::LPrism,
                ..SyntheticScene::default()
            };
            generate(&config)?.scene
        }
    };
    let views = ViewObservation::from_scene(&scene, MIN_SCORE);
    let radius = scene.sphere_radius;

    // With the edgels of the images in place of `&[]` positions are exacter.
    let graph = assemble(&views, &[], radius, &AssembleConfig::default()).wireframe;
    let config = ConfidenceConfig::default();
    let confidence = assess(&graph, &views, None, radius, &config)?;

    println!(
        "{} views → {} junctions, {} edges",
        views.len(),
        graph.junctions.len(),
        graph.edges.len()
    );
    for (edge, confidence) in graph.segments().iter().zip(&confidence.edges) {
        let [a, b] = edge.ends().map(|p| scene.original_from_world.apply(&p));
        println!(
            "({:.3}, {:.3}, {:.3}) – ({:.3}, {:.3}, {:.3})  probability {:.2}",
            a.x, a.y, a.z, b.x, b.y, b.z, confidence.probability
        );
    }
    Ok(())
}
