//! points_of SCENE OUT.ply
use neat_core::{LoadOptions, load_scene};
use std::io::Write;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let scene = load_scene(
        &args[1],
        &LoadOptions {
            require_wireframes: false,
            ..Default::default()
        },
    )
    .unwrap()
    .scene;
    let radius = scene.sphere_radius;
    println!("{} views, radius {radius}", scene.views.len());
    let start = std::time::Instant::now();
    let points = neat_stereo::surface_points(&scene, radius).unwrap();
    println!(
        "{} points, {:.2} s",
        points.len(),
        start.elapsed().as_secs_f64()
    );
    let mut out = std::io::BufWriter::new(std::fs::File::create(&args[2]).unwrap());
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
        points.len()
    )
    .unwrap();
    for p in [
        "x",
        "y",
        "z",
        "nx",
        "ny",
        "nz",
        "deviation",
        "score",
        "sharpness",
        "views",
        "view",
    ] {
        writeln!(out, "property float {p}").unwrap();
    }
    writeln!(out, "end_header").unwrap();
    for p in &points {
        let q = scene.original_from_world.apply(&p.position_in_world);
        let n = p.normal_in_world;
        let values = [
            q.x,
            q.y,
            q.z,
            n.x,
            n.y,
            n.z,
            p.deviation * scene.original_from_world.length_factor(),
            f64::from(p.score),
            f64::from(p.sharpness),
            p.confirmed_by.len() as f64,
            p.view as f64,
        ];
        for v in values {
            out.write_all(&(v as f32).to_le_bytes()).unwrap();
        }
    }
}
