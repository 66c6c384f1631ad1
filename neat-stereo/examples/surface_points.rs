//! Matches the photographs of a scene and writes the points on surfaces that they show, in
//! the frame of its files, as a PLY file with normals and deviations:
//!
//! ```sh
//! cargo run --release -p neat-stereo --example surface_points -- SCENE OUT.ply
//! ```

use neat_core::{LoadOptions, load_scene};
use neat_stereo::match_views;
use std::error::Error;
use std::fmt::Write;
use std::ops::ControlFlow;
use std::time::Instant;

#[allow(clippy::print_stdout)]
fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, out] = arguments.as_slice() else {
        return Err("usage: surface_points SCENE OUT.ply".into());
    };
    let options = LoadOptions {
        require_wireframes: false,
        ..LoadOptions::default()
    };
    let scene = load_scene(scene, &options)?.scene;
    let start = Instant::now();
    let go_on = &mut |_| ControlFlow::Continue(());
    let points = match_views(&scene, scene.sphere_radius, go_on)?;
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{} points of {} views in {seconds:.1} s",
        points.len(),
        scene.views.len()
    );

    let to_original = &scene.original_from_world;
    let mut ply = format!("ply\nformat ascii 1.0\nelement vertex {}\n", points.len());
    for name in ["x", "y", "z", "nx", "ny", "nz", "deviation"] {
        writeln!(ply, "property float {name}")?;
    }
    ply.push_str("end_header\n");
    for point in &points {
        let at = to_original.apply(&point.position_in_world);
        let normal = point.normal_in_world * to_original.scale.signum();
        let deviation = point.deviation * to_original.length_factor();
        writeln!(
            ply,
            "{} {} {} {} {} {} {deviation}",
            at.x, at.y, at.z, normal.x, normal.y, normal.z
        )?;
    }
    std::fs::write(out, ply)?;
    Ok(())
}
