//! Reading a scene as a configuration wants it.

use crate::config::DataConfig;
use crate::detection::detect_wireframes;
use crate::error::ImagesError;
use crate::event::{Decision, Event, OnEvent, Stage, Warning, WarningKind, timed};
use crate::resources::Resources;
use neat_core::file_cache::FileCache;
use neat_core::layout::{CameraAxes, HAWP_DIR};
use neat_core::{LoadOptions, MemoryLimit, Scene, SceneSphere, SphereChoice, View, load_scene};
use neat_detect::DetectorConfig;
use neat_doctor::{Depth, ExamineOptions, Finding, Level, Repair, Verdict};
use std::path::{Path, PathBuf};

/// A scene as a run needs it.
#[derive(Clone, Debug)]
pub struct PreparedScene {
    /// The scene: every view has a 2D wireframe with segments.
    pub scene: Scene,
    /// Its sphere, in the frame and unit of the files.
    pub sphere: SceneSphere,
    /// The files that it was read from.
    pub files: Vec<PathBuf>,
    /// Whether its 2D wireframes were detected, for want of files.
    pub detected: bool,
    /// The axes of cameras in these files.
    pub file_axes: CameraAxes,
}

/// Reads the scene in the folder `dir`, and detects its 2D wireframes if it has
/// none. `placed` is the sphere of an earlier part of the run, which stays. Cancellation
/// ends the detection.
///
/// Without a configured radius the world is scaled so that the scene sphere has
/// radius 1: every length of a configuration (β, grid, encoding) then means the
/// same in a scene of millimetres and in one of metres.
///
/// # Errors
/// If the scene cannot be read, or no view has a segment;
/// [`ImagesError::InterruptedIn`] after cancellation.
pub fn prepare_scene<R>(
    dir: &Path,
    data: &DataConfig,
    detector: &DetectorConfig,
    placed: Option<&SceneSphere>,
    resources: Resources<'_>,
    on_event: OnEvent<'_, R>,
) -> Result<PreparedScene, ImagesError> {
    let detected = !dir.join(HAWP_DIR).is_dir();
    let options = LoadOptions {
        require_wireframes: !detected,
        ..load_options(data, resources.cache, resources.memory_limit)
    };
    let loaded = timed(on_event, Stage::Load, |_| load_scene(dir, &options))?;
    let warn = |text: String| Event::Warning(Warning::new(WarningKind::Scene, text));
    for warning in &loaded.warnings {
        on_event(warn(warning.to_string()));
    }
    let mut scene = loaded.scene;
    tell_of_images(&scene, on_event);
    if detected {
        timed(on_event, Stage::Detect, |on_event| {
            let min_score = data.min_segment_score;
            detect_wireframes(&mut scene, dir, detector, min_score, resources, on_event)
        })?;
    }
    if let Some(sphere) = placed {
        scene = placed_at(scene, sphere, data);
    }
    let scene = scaled_for(data, scene);
    // What is modelled: the configuration may have a radius of its own.
    let sphere = SceneSphere {
        center: scene.original_from_world.translation,
        radius: scene.original_from_world.length_factor() * scene.sphere_radius,
        source: placed.map_or(loaded.sphere.source, |sphere| sphere.source),
    };
    on_event(Event::Decided(place(&sphere)));
    if let (SphereChoice::Given { .. }, Some(radius)) = (data.scene_sphere, data.scene_radius) {
        on_event(warn(format!(
            "data.scene_radius = {radius} takes the place of the radius of the given scene sphere: --set data.scene_radius=none uses that one"
        )));
    }
    Ok(PreparedScene {
        scene,
        sphere,
        files: loaded.files,
        detected,
        file_axes: loaded.file_axes,
    })
}

/// Where the sphere lies, and by what.
fn place(sphere: &SceneSphere) -> Decision {
    let [x, y, z] = sphere.center.into();
    Decision {
        setting: "scene sphere".to_owned(),
        value: format!(
            "centre ({x:.4}, {y:.4}, {z:.4}), radius {:.4}",
            sphere.radius
        ),
        reason: format!("from {}", sphere.source),
    }
}

/// Tells where the images are, if they are not in memory.
fn tell_of_images<R>(scene: &Scene, on_event: OnEvent<'_, R>) {
    let in_file = scene.views.iter().filter(|view| view.image.is_in_file());
    let sizes: Vec<u64> = in_file.map(|view| view.image.byte_len()).collect();
    if !sizes.is_empty() {
        let mib = sizes.iter().sum::<u64>().div_ceil(1 << 20);
        let views = sizes.len();
        on_event(Event::Note(format!(
            "{views} images of {mib} MiB together are kept in a temporary file, for the sake of memory"
        )));
    }
}

/// The scene around the sphere of the run that it belongs to, which it may not have by
/// itself any more: other views may be left out, or files be gone.
fn placed_at(scene: Scene, sphere: &SceneSphere, config: &DataConfig) -> Scene {
    /// Rounding, of the sphere's radius. Below it nothing moves, so that a resumed
    /// run stays the same to the bit.
    const SAME: f64 = 1e-9;
    let world_from_original = scene.original_from_world.inverse();
    let center = world_from_original.apply(&sphere.center);
    let radius = world_from_original.length_factor() * sphere.radius;
    let same_center = center.norm() <= SAME * radius;
    let same_radius = (scene.sphere_radius - radius).abs() <= SAME * radius;
    match (same_center, same_radius || config.scene_radius.is_some()) {
        (true, true) => scene,
        _ => Scene {
            sphere_radius: radius,
            ..scene.centered_at(&center)
        },
    }
}

/// Examines a scene for a second or two, and tells warnings.
///
/// # Errors
/// If a run would be lost time.
pub fn examine_quickly<R>(
    prepared: &PreparedScene,
    config: &DataConfig,
    memory_limit: MemoryLimit,
    on_event: OnEvent<'_, R>,
) -> Result<(), ImagesError> {
    let examination = neat_doctor::examine(
        &prepared.scene,
        &ExamineOptions {
            depth: Depth::Quick,
            read_with: Repair::of(&load_options(config, None, memory_limit)),
            file_axes: prepared.file_axes,
            memory_limit,
        },
    );
    let lines = |level: Level| -> Vec<String> {
        let sentence = |finding: &Finding| match &finding.remedy {
            Some(remedy) => format!("{}: {remedy}", finding.message),
            None => finding.message.clone(),
        };
        examination.at(level).map(sentence).collect()
    };
    for warning in lines(Level::Warning) {
        on_event(Event::Warning(Warning::new(
            WarningKind::Examination,
            warning,
        )));
    }
    match examination.verdict {
        Verdict::NotReady => Err(ImagesError::NotReady(lines(Level::Problem).join("\n"))),
        Verdict::Ready | Verdict::ReadyWithWarnings => Ok(()),
    }
}

/// How a configuration wants a scene to be read.
pub fn load_options(
    config: &DataConfig,
    cache: Option<&FileCache>,
    memory_limit: MemoryLimit,
) -> LoadOptions {
    LoadOptions {
        pixel_center: config.pixel_center,
        min_segment_score: config.min_segment_score,
        sphere: config.scene_sphere,
        pose_convention: config.pose_convention,
        focal_scale: config.focal_scale,
        intrinsics_scale: config.intrinsics_scale,
        max_views: config.max_views,
        max_image_size: config.max_image_size,
        cache_dir: cache.map(|cache| cache.dir().into()),
        memory_limit,
        ..LoadOptions::default()
    }
}

/// `scene` in the unit that the configuration wants.
pub fn scaled_for(config: &DataConfig, scene: Scene) -> Scene {
    match config.scene_radius {
        None => {
            let radius = scene.sphere_radius;
            scene.scaled(1.0 / radius)
        }
        Some(radius) => Scene {
            sphere_radius: radius,
            ..scene
        },
    }
}

/// Indices of at most `count` views whose cameras stand far from each other, in
/// ascending order: the first view, then always the one that is farthest from
/// those already chosen.
pub fn spread_views(views: &[View], count: usize) -> Vec<usize> {
    let mut distances = vec![f64::INFINITY; views.len()];
    let mut chosen = Vec::new();
    while chosen.len() < count.min(views.len()) {
        // Of equal distances the first wins.
        let next = (0..views.len())
            .rev()
            .max_by(|a, b| distances[*a].total_cmp(&distances[*b]))
            .unwrap_or(0);
        chosen.push(next);
        let center = views[next].camera.center_in_world;
        for (view, distance) in views.iter().zip(&mut distances) {
            *distance = distance.min((view.camera.center_in_world - center).norm());
        }
        // Views at one place must not be chosen twice.
        distances[next] = f64::NEG_INFINITY;
    }
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::layout::abc::write_scene;
    use neat_core::synthetic::{SyntheticScene, generate};

    #[test]
    fn units_of_the_files_do_not_reach_the_networks() {
        let small = SyntheticScene {
            views: 3,
            image_size: 64,
            min_visible_length: 2.0,
            ..SyntheticScene::default()
        };
        let in_millimetres = generate(&small).unwrap().scene.scaled(1000.0);
        // `scaled` remembers the unit it came from; these files are the original.
        let in_millimetres = neat_core::Scene {
            original_from_world: neat_core::Similarity::identity(),
            ..in_millimetres
        };
        let dir = tempfile::tempdir().unwrap();
        write_scene(&in_millimetres, dir.path()).unwrap();

        let mut config = DataConfig::default();
        let read = |config: &DataConfig| {
            let resources = Resources::default();
            let detector = DetectorConfig::default();
            let on_event: OnEvent<'_, ()> = &mut |_| {};
            let prepared = prepare_scene(dir.path(), config, &detector, None, resources, on_event);
            prepared.unwrap().scene
        };
        let scaled = read(&config);
        assert!((scaled.sphere_radius - 1.0).abs() < 1e-12);
        let camera = |scene: &neat_core::Scene| scene.views[1].camera.center_in_world;
        let back = scaled.original_from_world.apply(&camera(&scaled));
        assert!((back - camera(&in_millimetres)).norm() < 1e-9);

        config.scene_radius = Some(1500.0);
        let kept = read(&config);
        assert!((camera(&kept) - camera(&in_millimetres)).norm() < 1e-9);
        assert_eq!(kept.sphere_radius, 1500.0);
    }

    #[test]
    fn the_sphere_of_a_run_stays() {
        let small = SyntheticScene {
            views: 6,
            image_size: 64,
            min_visible_length: 2.0,
            ..SyntheticScene::default()
        };
        let scene = generate(&small).unwrap().scene;
        let dir = tempfile::tempdir().unwrap();
        write_scene(&scene, dir.path()).unwrap();
        let config = DataConfig::default();
        let read = |config: &DataConfig, placed: Option<&SceneSphere>| {
            let resources = Resources::default();
            let mut warnings = Vec::new();
            let detector = DetectorConfig::default();
            let on_event: OnEvent<'_, ()> = &mut |event| {
                if let Event::Warning(warning) = event {
                    warnings.push(warning.message);
                }
            };
            let dir = dir.path();
            let prepared = prepare_scene(dir, config, &detector, placed, resources, on_event);
            (prepared.unwrap(), warnings)
        };
        let (first, _) = read(&config, None);
        // The same sphere changes nothing, to the bit.
        let (again, _) = read(&config, Some(&first.sphere));
        assert_eq!(again.sphere, first.sphere);
        let cameras =
            |scene: &Scene| -> Vec<_> { scene.views.iter().map(|view| view.camera).collect() };
        assert_eq!(cameras(&again.scene), cameras(&first.scene));

        // Another choice does not move a run that has begun.
        let mut other = config.clone();
        other.scene_sphere = "0.3,0.1,-0.2,2.5".parse().unwrap();
        let (kept, _) = read(&other, Some(&first.sphere));
        for (a, b) in cameras(&kept.scene).iter().zip(cameras(&first.scene)) {
            assert!((a.center_in_world - b.center_in_world).norm() < 1e-9);
        }
        let (moved, _) = read(&other, None);
        assert!((moved.sphere.center - nalgebra::Vector3::new(0.3, 0.1, -0.2)).norm() < 1e-12);
        assert!((moved.sphere.radius - 2.5).abs() < 1e-12);

        // What is told is what is modelled.
        other.scene_radius = Some(3.0);
        let (radius, warnings) = read(&other, None);
        assert!((radius.sphere.radius - 3.0).abs() < 1e-12);
        assert!(warnings[0].contains("scene_radius"));
    }

    #[test]
    fn spread_views_are_distinct_and_far_apart() {
        let twelve = SyntheticScene {
            views: 12,
            image_size: 64,
            ..SyntheticScene::default()
        };
        let mut views = generate(&twelve).unwrap().scene.views;
        let chosen = spread_views(&views, 6);
        assert_eq!(chosen.len(), 6);
        assert!(chosen.contains(&0) && chosen.windows(2).all(|w| w[0] < w[1]));
        assert_eq!(spread_views(&views, 99), (0..12).collect::<Vec<_>>());
        assert!(spread_views(&[], 6).is_empty());
        // Two of the places are the same: one of them is enough.
        views.truncate(3);
        views[1].camera = views[0].camera;
        assert_eq!(spread_views(&views, 2), [0, 2]);
    }
}
