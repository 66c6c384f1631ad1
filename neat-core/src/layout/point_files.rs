//! Sparse points in a file beside the poses, for layouts that hold none.

use super::images;
use crate::ply::read_points;
use crate::{Camera, SceneError, Similarity, SparsePoint};
use nalgebra::Vector3;
use std::path::Path;

/// In the order in which they are looked for; the second is nerfstudio's.
const FILES: [&str; 3] = ["sparse_points.ply", "sparse_pc.ply", "points3D.ply"];

/// The points of the first of [`FILES`] in the folder `dir`, in the world of
/// `cameras`; none without a file. The file may be in that world or in the frame
/// to which `original_from_world` leads: in the one where more cameras see points.
/// `is_mirrored` if the poses were mirrored when they were read.
pub(super) fn read(
    dir: &Path,
    cameras: &[Camera],
    original_from_world: &Similarity,
    is_mirrored: bool,
) -> Result<Vec<SparsePoint>, SceneError> {
    let Some(path) = images::first_of(dir, &FILES) else {
        return Ok(Vec::new());
    };
    let mut as_written = read_points(&path)?;
    if is_mirrored {
        for point in &mut as_written {
            *point = -*point;
        }
    }
    let world_from_original = original_from_world.inverse();
    let from_original = |point: &Vector3<f64>| world_from_original.apply(point);
    let moved: Vec<_> = as_written.iter().map(from_original).collect();
    let positions = if times_seen(cameras, &moved) >= times_seen(cameras, &as_written) {
        moved
    } else {
        as_written
    };
    Ok(positions.into_iter().map(SparsePoint::unseen).collect())
}

/// How often the cameras see one of some thousand points.
fn times_seen(cameras: &[Camera], points: &[Vector3<f64>]) -> usize {
    let some = points.iter().step_by(1 + points.len() / 1000);
    some.flat_map(|point| cameras.iter().map(move |camera| camera.sees(point)))
        .filter(|&seen| seen)
        .count()
}
