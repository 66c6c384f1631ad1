//! A posed scene in memory: what other programs build on.
//!
//! ```text
//! cargo run --release -p neat-core --example load_scene -- SCENE
//! ```
//!
//! Reads the folder in whatever layout it has, and prints its views with the
//! point of the world that their middle pixel sees. Without an argument a
//! synthetic scene is made and looked at.

#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nalgebra::Vector2;
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_core::{LoadOptions, Scene, load_scene};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = match std::env::args_os().nth(1) {
        Some(folder) => {
            // Photographs without 2D wireframes are fine here.
            let options = LoadOptions {
                require_wireframes: false,
                ..LoadOptions::default()
            };
            let loaded = load_scene(Path::new(&folder), &options)?;
            println!("layout {:?}", loaded.layout);
            for warning in &loaded.warnings {
                println!("warning: {warning}");
            }
            loaded.scene
        }
        None => {
            let config = SyntheticScene {
                solid: Solid::Wedge,
                views: 4,
                ..SyntheticScene::default()
            };
            generate(&config)?.scene
        }
    };
    describe(&scene);
    Ok(())
}

fn describe(scene: &Scene) {
    println!(
        "{}: {} views, sphere of radius {:.3}, {} sparse points",
        scene.name,
        scene.views.len(),
        scene.sphere_radius,
        scene.sparse_points.len()
    );
    for view in &scene.views {
        let camera = &view.camera;
        let middle = Vector2::new(f64::from(camera.width), f64::from(camera.height)) / 2.0;
        let ray = camera.ray_through(&middle);
        // Where the ray passes nearest to the middle of the scene, in the frame
        // of the user's files.
        let nearest = ray.origin - ray.direction * ray.origin.dot(&ray.direction);
        let seen = scene.original_from_world.apply(&nearest);
        println!(
            "{}: {}×{}, {} segments, looks at ({:.3}, {:.3}, {:.3})",
            view.name,
            camera.width,
            camera.height,
            view.wireframe.segments(0.05).len(),
            seen.x,
            seen.y,
            seen.z
        );
    }
}
