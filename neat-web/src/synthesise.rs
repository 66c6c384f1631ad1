//! The scene that the page brings along.

use neat_core::convert::{SceneFormat, convert};
use neat_core::file;
use neat_core::layout::HAWP_DIR;
use neat_core::synthetic::{SyntheticScene, generate_on_demand};
use std::error::Error;
use std::fs;
use std::path::Path;

/// Few and small enough images for seconds in a browser.
pub fn bundled_scene() -> SyntheticScene {
    SyntheticScene {
        views: 48,
        image_size: 400,
        ..SyntheticScene::default()
    }
}

/// Writes it into the new or empty folder `dir`, as images with poses: 2D wireframes are for
/// the detector to find.
///
/// # Errors
/// If the folder cannot be written.
pub fn synthesise(dir: &Path) -> Result<(), Box<dyn Error>> {
    let data = generate_on_demand(&bundled_scene())?;
    if let Some(parent) = dir.parent() {
        file::create_dir(parent)?;
    }
    convert(&data.scene, SceneFormat::Colmap, dir)?;
    fs::remove_dir_all(dir.join(HAWP_DIR))?;
    Ok(())
}
