//! The layout of IDR, VolSDF and NeuS. The reader of it is
//! [`crate::layout::dtu`].

use super::{POINTS_FILE, image_name, points, write_images};
use crate::layout::dtu::{scale_mat, world_mat};
use crate::layout::poses::{CAMERAS_NPZ, PIXEL_CENTER, number_array};
use crate::npz::{NpyArray, write_npz};
use crate::{Scene, SceneError, Similarity};
use nalgebra::Matrix4;
use std::collections::BTreeMap;
use std::path::Path;

const IMAGES_DIR: &str = "image";

pub(super) fn write(scene: &Scene, dir: &Path) -> Result<(), SceneError> {
    let mut arrays = BTreeMap::new();
    // Programs of this layout model the unit ball of the normalised world.
    let original_from_world = scene.original_from_world.without_mirroring();
    let original_from_unit = Similarity {
        scale: original_from_world.scale * scene.sphere_radius,
        ..original_from_world
    };
    let scale = original_from_unit.matrix();
    let world_from_original = original_from_world.inverse().matrix();
    // The i-th camera is that of the i-th file: `a-b.png` is before `a.png`.
    let mut views: Vec<_> = scene.views.iter().collect();
    views.sort_by_key(|view| image_name(&view.name));
    for (index, view) in views.into_iter().enumerate() {
        let camera = &view.camera;
        let rotation = camera.world_from_camera.transpose();
        let camera_from_world = rotation
            .to_homogeneous()
            .prepend_translation(&-camera.center_in_world);
        let k = camera.intrinsics.matrix().to_homogeneous();
        let world = k * camera_from_world * world_from_original;
        arrays.insert(world_mat(index), array(&world));
        arrays.insert(scale_mat(index), array(&scale));
    }
    arrays.insert(PIXEL_CENTER.into(), number_array(scene.pixel_center));
    let arrays = arrays
        .iter()
        .map(|(name, array)| (name.as_str(), array.clone()));
    write_npz(&dir.join(CAMERAS_NPZ), &arrays.collect())?;
    points::write_if_any(scene, &dir.join(POINTS_FILE))?;
    write_images(scene, &dir.join(IMAGES_DIR))
}

fn array(matrix: &Matrix4<f64>) -> NpyArray {
    NpyArray {
        shape: vec![4, 4],
        values: matrix.transpose().as_slice().to_vec(),
    }
}
