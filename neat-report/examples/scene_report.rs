//! A report on a scene folder without any training: 2D wireframes are detected where
//! there are none, and the assembler reconstructs from them and the images, unless a
//! wireframe is given.
//!
//! ```text
//! cargo run --release -p neat-report --example scene_report -- SCENE OUT.html [WIREFRAME.json]
//! ```

#![expect(clippy::print_stdout, reason = "an example tells what it does")]

use neat_core::layout::HAWP_DIR;
use neat_core::{LoadOptions, load_scene};
use neat_detect::{DetectorConfig, detect_views, edgel_maps};
use neat_report::{FactGroup, PhotographConfig, Report};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::{AssembleConfig, assemble};
use neat_wireframe::confidence::{ConfidenceConfig, assess};
use neat_wireframe::export::{WireframeDocument, read_json};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

const MIN_SCORE: f64 = 0.05;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let (folder, out, given) = match arguments.as_slice() {
        [folder, out] => (folder, out, None),
        [folder, out, given] => (folder, out, Some(given)),
        _ => return Err("usage: scene_report SCENE OUT.html [WIREFRAME.json]".into()),
    };
    let detected = !folder.join(HAWP_DIR).is_dir();
    let options = LoadOptions {
        require_wireframes: !detected,
        ..LoadOptions::default()
    };
    let start = Instant::now();
    let loaded = load_scene(folder, &options)?;
    let mut scene = loaded.scene;
    if detected {
        detect_views(&mut scene, &DetectorConfig::default())?;
    }
    let observations = ViewObservation::from_scene(&scene, MIN_SCORE);
    let in_world = match given {
        Some(path) => {
            let world_from_original = scene.original_from_world.inverse();
            (read_json(path)?.wireframe()).map(|point| world_from_original.apply(point))
        }
        None => {
            let config = DetectorConfig::default();
            let edgels = edgel_maps(&scene.views, &config, scene.pixel_center)?;
            let config = AssembleConfig::default();
            assemble(&observations, &edgels, scene.sphere_radius, &config).wireframe
        }
    };
    let reconstructed = start.elapsed().as_secs_f64();
    let radius = scene.sphere_radius;
    let config = ConfidenceConfig::default();
    let confidence = assess(&in_world, &observations, None, radius, &config)?;
    let original = in_world.map(|point| scene.original_from_world.apply(point));
    let mut document = WireframeDocument::from(&original);
    let names: Vec<String> = scene.views.iter().map(|view| view.name.clone()).collect();
    confidence.fill(&mut document, &names, &scene.original_from_world);

    let start = Instant::now();
    let mut report = Report::of_scene(&scene, document, MIN_SCORE, &PhotographConfig::default())?;
    report.warnings = loaded.warnings.iter().map(ToString::to_string).collect();
    report.facts = vec![FactGroup {
        heading: "Seconds".to_owned(),
        facts: vec![("Reconstruction".to_owned(), format!("{reconstructed:.1}"))],
    }];
    report.write(Path::new(out))?;
    let bytes = std::fs::metadata(out)?.len();
    println!(
        "{}: {} segments, {} views, {:.2} MB in {:.2} s",
        out.display(),
        report.document.edges.len(),
        report.views.len(),
        bytes as f64 / 1e6,
        start.elapsed().as_secs_f64()
    );
    Ok(())
}
