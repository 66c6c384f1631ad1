//! nerfstudio's `transforms.json`: a pinhole per frame, poses in OpenGL axes. The
//! reader of it is [`crate::layout::transforms_json`].

use super::{
    CORNER_ORIGIN, POINTS_FILE, check_no_skew, image_name, in_original_frame, points, write_images,
};
use crate::{Scene, SceneError, View, file};
use serde_json::{Value, json};
use std::path::Path;

const FILE_NAME: &str = "transforms.json";
const IMAGES_DIR: &str = "images";

pub(super) fn write(scene: &Scene, dir: &Path) -> Result<(), SceneError> {
    let path = dir.join(FILE_NAME);
    check_no_skew(scene, &path)?;
    let frames: Vec<_> = scene.views.iter().map(|view| frame(scene, view)).collect();
    let mut transforms = json!({
        "camera_model": "OPENCV",
        // Other programs take this for granted.
        "pixel_center": CORNER_ORIGIN,
        "frames": frames,
    });
    if !scene.sparse_points.is_empty() {
        transforms["ply_file_path"] = POINTS_FILE.into();
    }
    file::write_atomically(&path, format!("{transforms:#}\n").as_bytes())?;
    points::write_if_any(scene, &dir.join(POINTS_FILE))?;
    write_images(scene, &dir.join(IMAGES_DIR))
}

fn frame(scene: &Scene, view: &View) -> Value {
    let camera = in_original_frame(&view.camera, scene);
    let k = camera.intrinsics;
    let shift = CORNER_ORIGIN - scene.pixel_center;
    // OpenGL's camera has y up and z backward.
    let mut pose = camera.matrix_world_from_camera();
    for column in [1, 2] {
        pose.column_mut(column).rows_mut(0, 3).neg_mut();
    }
    let rows: Vec<Vec<f64>> = (pose.row_iter())
        .map(|row| row.iter().copied().collect())
        .collect();
    json!({
        "file_path": format!("{IMAGES_DIR}/{}", image_name(&view.name)),
        "w": camera.width,
        "h": camera.height,
        "fl_x": k.fx,
        "fl_y": k.fy,
        "cx": k.cx + shift,
        "cy": k.cy + shift,
        "transform_matrix": rows,
    })
}
