//! How good the detector is: precision and recall of junctions and segments on
//! synthetic scenes with noise and blur, and on real objects with known truth.
//!
//! `cargo run --release -p neat-lab --example detector_table [-- SCENE...]`
//!
//! A SCENE is a folder that loads, with `gt_wireframe.json` and `mesh.obj`; where
//! it has HAWP wireframes, they are measured by the same truth.

#![expect(clippy::print_stdout, reason = "an example prints its table")]

mod degradation;
mod matching;
mod mesh_visibility;

use degradation::Degradation;
use image::RgbImage;
use matching::{Tally, ViewTruth};
use mesh_visibility::Mesh;
use neat_core::ground_truth::read_ground_truth;
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_core::{LineSegment2, LoadOptions, Wireframe2d, load_scene};
use neat_detect::{DetectorConfig, detect};
use rayon::prelude::*;
use std::error::Error;
use std::path::Path;

/// Downstream keeps segments above this score.
const MIN_SCORE: f64 = 0.05;

fn main() -> Result<(), Box<dyn Error>> {
    let config = DetectorConfig::default();
    println!("{}", Tally::HEADER);
    for degradation in Degradation::ALL {
        let tallies: Vec<Tally> = Solid::ALL
            .par_iter()
            .map(|&solid| synthetic(solid, &degradation, &config))
            .collect();
        println!(
            "{}",
            Tally::sum(&tallies).row(&format!("synthetic, {degradation}"))
        );
    }
    for scene in std::env::args().skip(1) {
        real(Path::new(&scene), &config)?;
    }
    Ok(())
}

/// All views of one synthetic solid.
fn synthetic(solid: Solid, degradation: &Degradation, config: &DetectorConfig) -> Tally {
    let data = generate(&SyntheticScene {
        solid,
        views: 12,
        ..SyntheticScene::default()
    })
    .expect("the configuration is valid");
    let mut tally = Tally::default();
    for (index, (view, truth)) in data.scene.views.iter().zip(&data.view_truths).enumerate() {
        let parts = (truth.visible.iter()).map(|part| {
            (
                part.segment,
                part.junctions.map(|junction| junction.is_some()),
            )
        });
        let truth = ViewTruth::new(parts, data.scene.pixel_center);
        let image = degradation.apply(
            &view.image.read().expect("the image is in memory"),
            index as u64,
        );
        tally.add(&truth, &confident(&detect(&image, config)));
    }
    tally
}

/// All views of a real scene, by neat-detect and by HAWP.
fn real(dir: &Path, config: &DetectorConfig) -> Result<(), Box<dyn Error>> {
    let options = LoadOptions {
        require_wireframes: false,
        ..LoadOptions::default()
    };
    let scene = load_scene(dir, &options)?.scene;
    let wireframe = read_ground_truth(&dir.join("gt_wireframe.json"))?.wireframe;
    let mesh = Mesh::read(&dir.join("mesh.obj"))?;
    let tallies: Vec<[Tally; 2]> = (scene.views.par_iter())
        .map(|view| {
            let parts = mesh.visible_parts(&wireframe, &view.camera);
            let truth = ViewTruth::new(parts.into_iter(), scene.pixel_center);
            let image = view.image.read().expect("the image is in memory");
            let mut tallies = [Tally::default(), Tally::default()];
            tallies[0].add(&truth, &confident(&detect(&image, config)));
            tallies[1].add(
                &truth,
                &shifted(confident(&view.wireframe), -scene.pixel_center),
            );
            tallies
        })
        .collect();
    for (detector, name) in ["neat-detect", "HAWP"].iter().enumerate() {
        let of_detector: Vec<Tally> = tallies.iter().map(|t| t[detector].clone()).collect();
        let sum = Tally::sum(&of_detector);
        if sum.has_predictions() {
            println!("{}", sum.row(&format!("{}, {name}", scene.name)));
        }
    }
    Ok(())
}

/// The segments that downstream uses.
fn confident(wireframe: &Wireframe2d) -> Vec<LineSegment2> {
    wireframe
        .segments(MIN_SCORE)
        .iter()
        .map(|s| s.segment)
        .collect()
}

fn shifted(segments: Vec<LineSegment2>, by: f64) -> Vec<LineSegment2> {
    segments
        .iter()
        .map(|segment| segment.map(|end| end.add_scalar(by)))
        .collect()
}
