//! 2D wireframes for scenes that come without: detected, and kept for next time.

mod configured_detector;
mod folder;

pub use folder::{DetectOptions, Detected, SegmentSource, detect_folder};

use crate::error::ImagesError;
use crate::event::{Event, OnEvent, Stage, Warning, WarningKind};
use crate::resources::Resources;
use configured_detector::ConfiguredDetector;
use image::RgbImage;
use neat_core::file_cache::{CacheKey, FileCache};
use neat_core::{Scene, SceneError, View, Wireframe2d, hawp_json};
use neat_detect::DetectorConfig;
use std::path::Path;

/// Files and detectors have pixel centres at integers.
const DETECTED_WITH_PIXEL_CENTER: f64 = 0.0;
/// What detection takes, in bytes for each pixel of the image. Of 12 megapixels, 30 were
/// measured; a picture of the detections takes some more.
const BYTES_PER_PIXEL: u64 = 40;
const DETECTING: &str = "detecting segments in an image";
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
/// If the configuration is out of range, its detector has no weights, or no view has a segment;
/// [`ImagesError::InterruptedIn`] once that is wanted.
pub fn detect_wireframes<R>(
    scene: &mut Scene,
    dir: &Path,
    config: &DetectorConfig,
    min_segment_score: f64,
    resources: Resources<'_>,
    on_event: OnEvent<'_, R>,
) -> Result<(), ImagesError> {
    config.validate()?;
    let detector = ConfiguredDetector::open(config)?;
    let memory_limit = resources.memory_limit;
    let warn = |text: String| Event::Warning(Warning::new(WarningKind::Detection, text));
    let mut cache_works = true;
    let views = scene.views.len();
    let mut done = 0;
    let sizes = scene.views.iter().map(|view| view.image.dimensions());
    let bytes_each =
        memory_limit.bytes_each(sizes, BYTES_PER_PIXEL, DETECTING, dir)? + detector.model_bytes();
    // Some at a time, so that progress can be told in between.
    for chunk in scene.views.chunks_mut(4 * rayon::current_num_threads()) {
        if resources.is_cancelled() {
            return Err(ImagesError::InterruptedIn(Stage::Detect));
        }
        let cache = resources.cache;
        let found =
            memory_limit.try_map(chunk, bytes_each, |view| detect_in(view, &detector, cache))?;
        for (view, (mut wireframe, warning)) in chunk.iter_mut().zip(found) {
            for vertex in &mut wireframe.vertices {
                *vertex = vertex.add_scalar(scene.pixel_center);
            }
            view.wireframe = wireframe;
            // One is enough: all of them go into one folder.
            if let (true, Some(warning)) = (cache_works, warning) {
                cache_works = false;
                on_event(warn(warning));
            }
            on_event(Event::Detected(view));
        }
        done += chunk.len();
        on_event(Event::StageProgress {
            stage: Stage::Detect,
            fraction: done as f64 / views as f64,
        });
    }
    let has_segments = |view: &View| !view.wireframe.segments(min_segment_score).is_empty();
    let empty = scene.views.iter().filter(|view| !has_segments(view));
    for View { name, .. } in empty {
        let text = format!("view `{name}` is left out: no segment was detected in it");
        on_event(warn(text));
    }
    scene.retain_views(has_segments);
    if scene.views.is_empty() {
        return Err(ImagesError::Scene(SceneError::NoUsableView {
            path: dir.into(),
            views,
            min_segment_score,
        }));
    }
    Ok(())
}

/// The wireframe of one image, with pixel centres at integers, and a warning if
/// it could not be stored.
///
/// # Errors
/// If the image lies in a file that cannot be read, or a model cannot be run.
fn detect_in(
    view: &View,
    detector: &ConfiguredDetector<'_>,
    cache: Option<&FileCache>,
) -> Result<(Wireframe2d, Option<String>), SceneError> {
    let image = view.image.read()?;
    let Some(cache) = cache else {
        return Ok((detector.wireframe(&image)?, None));
    };
    let key = key(&image, detector);
    let name = Path::new("2D wireframe");
    let stored = cache
        .get(&key)
        .and_then(|bytes| hawp_json::parse(&bytes, DETECTED_WITH_PIXEL_CENTER, name).ok());
    if let Some(wireframe) = stored {
        return Ok((wireframe, None));
    }
    let wireframe = detector.wireframe(&image)?;
    let stored = cache.put(
        &key,
        &hawp_json::to_bytes(&wireframe, DETECTED_WITH_PIXEL_CENTER),
    );
    let warning = stored
        .err()
        .map(|error| format!("detected 2D wireframes are not kept for the next run: {error}"));
    Ok((wireframe, warning))
}

fn key(image: &RgbImage, detector: &ConfiguredDetector<'_>) -> CacheKey {
    let (width, height) = image.dimensions();
    let settings =
        toml::to_string(detector.config).expect("detection::key: settings can be written");
    let inputs = [
        &width.to_le_bytes(),
        &height.to_le_bytes(),
        image.as_raw().as_slice(),
        settings.as_bytes(),
        detector.identity(),
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

    fn detected(scene: &mut Scene, cache: Option<&FileCache>) -> Result<Vec<String>, ImagesError> {
        detected_by(&DetectorConfig::default(), scene, cache)
    }

    fn detected_by(
        config: &DetectorConfig,
        scene: &mut Scene,
        cache: Option<&FileCache>,
    ) -> Result<Vec<String>, ImagesError> {
        let mut warnings = Vec::new();
        detect_wireframes(
            scene,
            Path::new("scene"),
            config,
            0.05,
            Resources {
                cache,
                ..Resources::default()
            },
            &mut |event: Event<'_, ()>| {
                if let Event::Warning(warning) = event {
                    warnings.push(warning.message);
                }
            },
        )?;
        Ok(warnings)
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
        detected_by(&config, &mut other, Some(&cache)).unwrap();
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 6);
    }

    /// With the weights in the file `$NEAT_MLSD`.
    #[cfg(feature = "onnx")]
    #[test]
    #[expect(clippy::print_stderr, reason = "a skipped test must be seen")]
    fn what_mlsd_advised_is_kept_apart() {
        if std::env::var_os("NEAT_MLSD").is_none() {
            eprintln!("skipped: NEAT_MLSD names no weights (scripts/fetch_mlsd.sh fetches them)");
            return;
        }
        let dir = tempfile::tempdir().unwrap();
        let cache = FileCache::new(dir.path());
        let advised = DetectorConfig {
            detector: neat_detect::LineDetector::Mlsd,
            ..DetectorConfig::default()
        };
        for (config, files) in [(DetectorConfig::default(), 3), (advised, 6)] {
            let mut scene = scene();
            detected_by(&config, &mut scene, Some(&cache)).unwrap();
            let found = scene.views.iter().map(|view| view.wireframe.edges.len());
            assert!(found.min() > Some(3));
            assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), files);
        }
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
        two.views[1].image = RgbImage::new(128, 128).into();
        let warnings = detected(&mut two, None).unwrap();
        assert_eq!(two.views.len(), 2);
        assert!(warnings[0].contains("image_0001"), "{warnings:?}");
        let mut none = scene();
        for view in &mut none.views {
            view.image = RgbImage::new(128, 128).into();
        }
        let error = detected(&mut none, None).unwrap_err();
        assert!(error.to_string().contains("none of the 3 views"));
    }
}
