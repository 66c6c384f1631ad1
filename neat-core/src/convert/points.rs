//! Sparse points as other programs want them: with colours.

use super::points_in_original_frame;
use crate::{Scene, SceneError, SparsePoint, ply};
use std::path::Path;

/// Where no view says which colour a point has.
const GRAY: [u8; 3] = [128; 3];

/// The colour of every point.
///
/// # Errors
/// If an image that lies in a file cannot be read.
pub(super) fn colors(scene: &Scene) -> Result<Vec<[u8; 3]>, SceneError> {
    let points = scene.sparse_points.iter();
    points.map(|point| color(scene, point)).collect()
}

/// The colour of the pixel in which the first view saw the point.
fn color(scene: &Scene, point: &SparsePoint) -> Result<[u8; 3], SceneError> {
    let Some(seen) = point.observations.first() else {
        return Ok(GRAY);
    };
    let Some(view) = scene.views.get(seen.view) else {
        return Ok(GRAY);
    };
    let index = seen.pixel.add_scalar(0.5 - scene.pixel_center);
    // Coordinates below zero become 0, beyond the image they find no pixel.
    let (column, row) = (index.x as u32, index.y as u32);
    let (width, height) = view.image.dimensions();
    if column < width && row < height {
        Ok(view.image.pixel(column, row)?.0)
    } else {
        Ok(GRAY)
    }
}

/// Writes the points as a PLY file in the user's frame, if there are any.
pub(super) fn write_if_any(scene: &Scene, path: &Path) -> Result<(), SceneError> {
    if scene.sparse_points.is_empty() {
        return Ok(());
    }
    let points = points_in_original_frame(scene).into_iter();
    ply::write_points(path, &points.zip(colors(scene)?).collect::<Vec<_>>())
}
