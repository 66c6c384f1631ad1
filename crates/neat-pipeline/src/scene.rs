//! Reading a scene as a configuration wants it.

use crate::config::DataConfig;
use neat_core::{LoadOptions, LoadedScene, Scene, SceneError, load_scene};
use std::path::Path;

/// Reads the scene in the folder `dir`.
///
/// Without a configured radius the world is scaled so that the scene sphere has
/// radius 1: every length of a configuration (β, grid, encoding) then means the
/// same in a scene of millimetres and in one of metres.
///
/// # Errors
/// If the scene cannot be read.
pub fn read_scene(dir: &Path, config: &DataConfig) -> Result<LoadedScene, SceneError> {
    let options = LoadOptions {
        pixel_center: config.pixel_center,
        min_segment_score: config.min_segment_score,
        sphere: config.scene_sphere,
        ..LoadOptions::default()
    };
    let mut loaded = load_scene(dir, &options)?;
    loaded.scene = scaled_for(config, loaded.scene);
    Ok(loaded)
}

/// `scene` in the unit that the configuration wants.
pub(crate) fn scaled_for(config: &DataConfig, scene: Scene) -> Scene {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;
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

        let mut config = Preset::Fast.config().data;
        let scaled = read_scene(dir.path(), &config).unwrap().scene;
        assert!((scaled.sphere_radius - 1.0).abs() < 1e-12);
        let camera = |scene: &neat_core::Scene| scene.views[1].camera.center_in_world;
        let back = scaled.original_from_world.apply(&camera(&scaled));
        assert!((back - camera(&in_millimetres)).norm() < 1e-9);

        config.scene_radius = Some(1500.0);
        let kept = read_scene(dir.path(), &config).unwrap().scene;
        assert!((camera(&kept) - camera(&in_millimetres)).norm() < 1e-9);
        assert_eq!(kept.sphere_radius, 1500.0);
    }
}
