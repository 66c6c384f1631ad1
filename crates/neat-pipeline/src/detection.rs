//! 2D wireframes for scenes that come without: detected, and kept for next time.

mod folder;

pub use folder::{DetectOptions, Detected, SegmentSource, detect_folder};

use crate::error::PipelineError;
use crate::event::{Event, OnEvent, Stage};
use neat_core::file_cache::{CacheKey, FileCache};
use neat_core::{Scene, SceneError, View, Wireframe2d, hawp_json};
use neat_detect::{DetectorConfig, detect};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Files and detectors have pixel centres at integers.
const DETECTED_WITH_PIXEL_CENTER: f64 = 0.0;
/// Raised when the detector finds something else in the same image.
const DETECTOR_VERSION: u32 = 1;

/// Detects the 2D wireframes of all views and puts them into the scene, in image
/// coordinates. Views without a segment whose score is above `min_segment_score`
/// are left out, with a warning.
///
/// `dir` is the folder of the scene, for messages. What `cache` holds for an image
/// and this configuration is not detected again.
///
/// # Errors
/// If the configuration is out of range, or no view has a segment;
/// [`PipelineError::InterruptedIn`] once `cancelled` is set.
pub fn detect_wireframes(
    scene: &mut Scene,
    dir: &Path,
    config: &DetectorConfig,
    min_segment_score: f64,
    cache: Option<&FileCache>,
    cancelled: &AtomicBool,
    on_event: OnEvent<'_>,
) -> Result<Vec<String>, PipelineError> {
    config.validate()?;
    let mut warnings = Vec::new();
    let views = scene.views.len();
    let mut done = 0;
    // Some at a time, so that progress can be told in between.
    for chunk in scene.views.chunks_mut(4 * rayon::current_num_threads()) {
        if cancelled.load(Ordering::Relaxed) {
            return Err(PipelineError::InterruptedIn(Stage::Detect));
        }
        let found: Vec<_> = (chunk.par_iter())
            .map(|view| detect_in(view, config, cache))
            .collect();
        for (view, (mut wireframe, warning)) in chunk.iter_mut().zip(found) {
            for vertex in &mut wireframe.vertices {
                *vertex = vertex.add_scalar(scene.pixel_center);
            }
            view.wireframe = wireframe;
            // One is enough: all of them go into one folder.
            if warnings.is_empty() {
                warnings.extend(warning);
            }
        }
        done += chunk.len();
        on_event(Event::StageProgress {
            stage: Stage::Detect,
            fraction: done as f64 / views as f64,
        });
    }
    let has_segments = |view: &View| !view.wireframe.segments(min_segment_score).is_empty();
    let empty = scene.views.iter().filter(|view| !has_segments(view));
    warnings.extend(empty.map(|view| {
        let name = &view.name;
        format!("view `{name}` is left out: no segment was detected in it")
    }));
    scene.retain_views(has_segments);
    if scene.views.is_empty() {
        return Err(PipelineError::Scene(SceneError::NoUsableView {
            path: dir.into(),
            views,
            min_segment_score,
        }));
    }
    Ok(warnings)
}

/// The wireframe of one image, with pixel centres at integers, and a warning if
/// it could not be stored.
fn detect_in(
    view: &View,
    config: &DetectorConfig,
    cache: Option<&FileCache>,
) -> (Wireframe2d, Option<String>) {
    let Some(cache) = cache else {
        return (detect(&view.image, config), None);
    };
    let key = key(view, config);
    let name = Path::new("2D wireframe");
    let stored = cache
        .get(&key)
        .and_then(|bytes| hawp_json::parse(&bytes, DETECTED_WITH_PIXEL_CENTER, name).ok());
    if let Some(wireframe) = stored {
        return (wireframe, None);
    }
    let wireframe = detect(&view.image, config);
    let stored = cache.put(
        &key,
        &hawp_json::to_bytes(&wireframe, DETECTED_WITH_PIXEL_CENTER),
    );
    let warning = stored
        .err()
        .map(|error| format!("detected 2D wireframes are not kept for the next run: {error}"));
    (wireframe, warning)
}

fn key(view: &View, config: &DetectorConfig) -> CacheKey {
    let (width, height) = view.image.dimensions();
    let settings = toml::to_string(config).expect("detection::key: settings can be written");
    let inputs = [
        &width.to_le_bytes(),
        &height.to_le_bytes(),
        view.image.as_raw().as_slice(),
        settings.as_bytes(),
    ];
    CacheKey::new("wireframe2d", DETECTOR_VERSION, &inputs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::synthetic::{SyntheticScene, generate};

    fn scene() -> Scene {
        let small = SyntheticScene {
            views: 3,
            image_size: 128,
            ..SyntheticScene::default()
        };
        let mut scene = generate(&small).unwrap().scene;
        for view in &mut scene.views {
            view.wireframe = Wireframe2d::empty(128, 128);
        }
        scene
    }

    fn detected(
        scene: &mut Scene,
        cache: Option<&FileCache>,
    ) -> Result<Vec<String>, PipelineError> {
        detect_wireframes(
            scene,
            Path::new("scene"),
            &DetectorConfig::default(),
            0.05,
            cache,
            &AtomicBool::new(false),
            &mut |_| {},
        )
    }

    #[test]
    fn stored_wireframes_are_those_that_were_detected() {
        let dir = tempfile::tempdir().unwrap();
        let cache = FileCache::new(dir.path());
        let mut fresh = scene();
        assert!(detected(&mut fresh, None).unwrap().is_empty());
        let found = |scene: &Scene| -> Vec<Wireframe2d> {
            scene
                .views
                .iter()
                .map(|view| view.wireframe.clone())
                .collect()
        };
        assert!(
            found(&fresh)
                .iter()
                .all(|wireframe| wireframe.edges.len() > 3)
        );
        for _ in 0..2 {
            let mut cached = scene();
            detected(&mut cached, Some(&cache)).unwrap();
            assert_eq!(found(&cached), found(&fresh));
            assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 3);
        }
        // Other settings are another result.
        let mut other = scene();
        let config = DetectorConfig {
            min_length: 20.0,
            ..DetectorConfig::default()
        };
        detect_wireframes(
            &mut other,
            Path::new("scene"),
            &config,
            0.05,
            Some(&cache),
            &AtomicBool::new(false),
            &mut |_| {},
        )
        .unwrap();
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 6);
    }

    #[test]
    fn a_cache_that_cannot_be_written_is_a_warning() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("file");
        std::fs::write(&file, b"").unwrap();
        let warnings = detected(&mut scene(), Some(&FileCache::new(file.join("below")))).unwrap();
        assert_eq!(warnings.len(), 1, "{warnings:?}");
    }

    #[test]
    fn views_without_segments_are_left_out() {
        let mut two = scene();
        two.views[1].image.fill(0);
        let warnings = detected(&mut two, None).unwrap();
        assert_eq!(two.views.len(), 2);
        assert!(warnings[0].contains("image_0001"), "{warnings:?}");
        let mut none = scene();
        none.views.iter_mut().for_each(|view| view.image.fill(0));
        let error = detected(&mut none, None).unwrap_err();
        assert!(error.to_string().contains("none of the 3 views"));
    }
}
