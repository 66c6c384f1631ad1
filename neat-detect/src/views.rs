//! All views of a scene at once.

use crate::config::DetectorConfig;
use crate::detection::detect;
use crate::edgels::edgel_map;
use neat_core::{EdgelMap, Scene, SceneError, View};
use rayon::prelude::*;

/// Detects the 2D wireframes of all views and puts them into the scene, in image
/// coordinates.
///
/// # Errors
/// If an image lies in a file that cannot be read.
pub fn detect_views(scene: &mut Scene, config: &DetectorConfig) -> Result<(), SceneError> {
    let pixel_center = scene.pixel_center;
    (scene.views.par_iter_mut()).try_for_each(|view| {
        let mut wireframe = detect(&*view.image.read()?, config);
        for vertex in &mut wireframe.vertices {
            *vertex = vertex.add_scalar(pixel_center);
        }
        view.wireframe = wireframe;
        Ok(())
    })
}

/// The edgels of each of these views, whose first pixels have their centres at
/// (`pixel_center`, `pixel_center`).
///
/// # Errors
/// If an image lies in a file that cannot be read.
pub fn edgel_maps(
    views: &[View],
    config: &DetectorConfig,
    pixel_center: f64,
) -> Result<Vec<EdgelMap>, SceneError> {
    (views.par_iter())
        .map(|view| Ok(edgel_map(&*view.image.read()?, config, pixel_center)))
        .collect()
}
