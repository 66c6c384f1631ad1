//! Sparse points as other programs want them: with colours.

use super::points_in_original_frame;
use crate::{Scene, SceneError, SparsePoint, point_cloud};
use std::path::Path;

/// Where no view says which colour a point has.
const GRAY: [u8; 3] = [128; 3];

/// The colour of the pixel in which the first view saw the point.
pub(super) fn color(scene: &Scene, point: &SparsePoint) -> [u8; 3] {
    let first = point.observations.first();
    let pixel = first.and_then(|seen| {
        let index = seen.pixel.add_scalar(0.5 - scene.pixel_center);
        // Coordinates below zero become 0, beyond the image they find no pixel.
        let (column, row) = (index.x as u32, index.y as u32);
        scene
            .views
            .get(seen.view)?
            .image
            .get_pixel_checked(column, row)
    });
    pixel.map_or(GRAY, |rgb| rgb.0)
}

/// Writes the points as a PLY file in the user's frame, if there are any.
pub(super) fn write_if_any(scene: &Scene, path: &Path) -> Result<(), SceneError> {
    if scene.sparse_points.is_empty() {
        return Ok(());
    }
    let colors: Vec<_> = scene
        .sparse_points
        .iter()
        .map(|point| color(scene, point))
        .collect();
    point_cloud::write_ply(path, &points_in_original_frame(scene), &colors)
}
