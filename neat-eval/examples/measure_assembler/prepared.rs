//! Scenes as the assembler gets them.

use crate::Result;
use neat_core::{LoadOptions, Scene, hawp_json, load_scene};
use neat_detect::{DetectorConfig, detect_views};
use neat_images::assemble::assemble_images;
use neat_images::distilled::Distilled;
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::AssembleConfig;
use neat_wireframe::confidence::ConfidenceConfig;
use std::fs;
use std::path::Path;

/// As `neat reconstruct` has it.
pub const MIN_SEGMENT_SCORE: f64 = 0.05;

/// The scene in a unit ball, with 2D segments: those in `kept`, or else detected and kept.
/// Segments of others are used where there is no truth.
pub fn prepared(dir: &Path, kept: Option<&Path>) -> Result<Scene> {
    let has_truth = dir.join("gt_wireframe.json").exists() || dir.join("truth").exists();
    let given = dir.join("hawp").is_dir() && !has_truth;
    let options = LoadOptions {
        require_wireframes: given,
        ..LoadOptions::default()
    };
    let mut scene = load_scene(dir, &options)?.scene;
    if !given {
        let folder = kept.map(|kept| kept.join("segments"));
        let file = |folder: &Path, index: usize| folder.join(format!("{index:04}.json"));
        let center = scene.pixel_center;
        match &folder {
            Some(folder) if folder.is_dir() => {
                for (index, view) in scene.views.iter_mut().enumerate() {
                    view.wireframe = hawp_json::read(&file(folder, index), center)?;
                }
            }
            _ => detect_views(&mut scene, &DetectorConfig::default())?,
        }
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            fs::create_dir_all(&folder)?;
            for (index, view) in scene.views.iter().enumerate() {
                hawp_json::write(&file(&folder, index), &view.wireframe, center)?;
            }
        }
    }
    let radius = scene.sphere_radius;
    Ok(scene.scaled(radius.recip()))
}

/// What `neat reconstruct` makes of it without a field, where edges go that are structure with less
/// than this probability.
pub fn reconstructed(scene: &Scene, min_structure: f64) -> Result<Distilled> {
    let views = ViewObservation::from_scene(scene, MIN_SEGMENT_SCORE);
    let detector = DetectorConfig::default();
    let config = AssembleConfig {
        min_structure,
        ..AssembleConfig::default()
    };
    let go_on = &mut |_| Ok(());
    let draft = assemble_images(scene, &views, None, 1.0, &detector, &config, go_on)?;
    let assessing = ConfidenceConfig::default();
    Ok(draft.assess(scene, MIN_SEGMENT_SCORE, None, 1.0, &assessing)?)
}
