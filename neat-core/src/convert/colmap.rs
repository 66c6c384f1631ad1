//! COLMAP's text files: a pinhole camera for each set of intrinsics, poses, and
//! sparse points with their tracks. The reader of them is
//! [`crate::layout::colmap`].

use super::{
    CORNER_ORIGIN, check_no_skew, image_name, in_original_frame, points, points_in_original_frame,
    write_images,
};
use crate::{Camera, Intrinsics, Observation, Scene, SceneError, file};
use nalgebra::{Rotation3, UnitQuaternion, Vector2};
use std::fmt::Write;
use std::path::Path;

const MODEL_DIR: &str = "sparse/0";
const IMAGES_DIR: &str = "images";

pub(super) fn write(scene: &Scene, dir: &Path) -> Result<(), SceneError> {
    let model_dir = dir.join(MODEL_DIR);
    file::create_dir(&model_dir)?;
    let path = model_dir.join("cameras.txt");
    check_no_skew(scene, &path)?;
    let cameras = distinct_cameras(scene);
    file::write_atomically(&path, cameras_text(scene, &cameras).as_bytes())?;

    let path = model_dir.join("images.txt");
    check_names(scene, &path)?;
    let observed = observations_by_view(scene);
    file::write_atomically(&path, images_text(scene, &cameras, &observed).as_bytes())?;

    let points = points_text(scene, &observed, &points::colors(scene)?);
    file::write_atomically(&model_dir.join("points3D.txt"), points.as_bytes())?;
    write_images(scene, &dir.join(IMAGES_DIR))
}

/// Intrinsics and size.
type Lens = (Intrinsics, u32, u32);

fn lens(camera: &Camera) -> Lens {
    (camera.intrinsics, camera.width, camera.height)
}

/// The cameras of the file, in the order in which views use them first.
fn distinct_cameras(scene: &Scene) -> Vec<Lens> {
    let mut cameras = Vec::new();
    for view in &scene.views {
        let lens = lens(&view.camera);
        if !cameras.contains(&lens) {
            cameras.push(lens);
        }
    }
    cameras
}

/// Records are numbered from 1.
fn id(index: usize) -> usize {
    index + 1
}

/// What is added to image coordinates to count them from the corner.
fn to_corner(scene: &Scene) -> f64 {
    CORNER_ORIGIN - scene.pixel_center
}

// Writing to a string cannot fail, and `{}` of a float is the shortest text that
// reads back as the same number.

fn cameras_text(scene: &Scene, cameras: &[Lens]) -> String {
    let mut text = String::from("# CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy\n");
    let shift = to_corner(scene);
    for (index, (k, width, height)) in cameras.iter().enumerate() {
        let (id, cx, cy) = (id(index), k.cx + shift, k.cy + shift);
        let _ = writeln!(
            text,
            "{id} PINHOLE {width} {height} {} {} {cx} {cy}",
            k.fx, k.fy
        );
    }
    text
}

/// COLMAP ends a name at its first space.
fn check_names(scene: &Scene, path: &Path) -> Result<(), SceneError> {
    match scene
        .views
        .iter()
        .find(|view| view.name.contains(char::is_whitespace))
    {
        None => Ok(()),
        Some(view) => Err(SceneError::ViewName {
            path: path.into(),
            view: view.name.clone(),
            reason: "has a space, which COLMAP cannot read: rename the image",
        }),
    }
}

/// The observations of every view, with the index of their point, in its order.
fn observations_by_view(scene: &Scene) -> Vec<Vec<(usize, Vector2<f64>)>> {
    let mut observed = vec![Vec::new(); scene.views.len()];
    for (point, sparse_point) in scene.sparse_points.iter().enumerate() {
        for &Observation { view, pixel } in &sparse_point.observations {
            if let Some(observed) = observed.get_mut(view) {
                observed.push((point, pixel));
            }
        }
    }
    observed
}

fn images_text(scene: &Scene, cameras: &[Lens], observed: &[Vec<(usize, Vector2<f64>)>]) -> String {
    let mut text = String::from(
        "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[] as X Y POINT3D_ID\n",
    );
    let shift = to_corner(scene);
    for (index, (view, observed)) in scene.views.iter().zip(observed).enumerate() {
        let camera = in_original_frame(&view.camera, scene);
        let camera_from_original =
            Rotation3::from_matrix_unchecked(camera.world_from_camera).inverse();
        let t = -(camera_from_original * camera.center_in_world);
        let q = UnitQuaternion::from_rotation_matrix(&camera_from_original);
        let lens = lens(&view.camera);
        let camera = cameras
            .iter()
            .position(|other| *other == lens)
            .map_or(0, id);
        let _ = writeln!(
            text,
            "{} {} {} {} {} {} {} {} {camera} {}",
            id(index),
            q.w,
            q.i,
            q.j,
            q.k,
            t.x,
            t.y,
            t.z,
            image_name(&view.name)
        );
        let points = observed.iter().map(|(point, pixel)| {
            format!("{} {} {}", pixel.x + shift, pixel.y + shift, id(*point))
        });
        let _ = writeln!(text, "{}", points.collect::<Vec<_>>().join(" "));
    }
    text
}

fn points_text(
    scene: &Scene,
    observed: &[Vec<(usize, Vector2<f64>)>],
    colors: &[[u8; 3]],
) -> String {
    // The places of a point in the lists of the views.
    let mut tracks = vec![Vec::new(); scene.sparse_points.len()];
    for (view, observed) in observed.iter().enumerate() {
        for (place, (point, _)) in observed.iter().enumerate() {
            tracks[*point].push(format!("{} {place}", id(view)));
        }
    }
    let mut text = String::from("# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX\n");
    let positions = points_in_original_frame(scene);
    for (index, track) in tracks.into_iter().enumerate() {
        let (p, [r, g, b]) = (positions[index], colors[index]);
        let error = reprojection_error(scene, index);
        let _ = write!(
            text,
            "{} {} {} {} {r} {g} {b} {error}",
            id(index),
            p.x,
            p.y,
            p.z
        );
        for element in track {
            let _ = write!(text, " {element}");
        }
        text.push('\n');
    }
    text
}

/// Mean distance in pixels between where a point was seen and where it is; −1 is
/// COLMAP's word for "not known".
fn reprojection_error(scene: &Scene, point: usize) -> f64 {
    let point = &scene.sparse_points[point];
    let distances: Vec<f64> = (point.observations.iter())
        .filter_map(|seen| {
            let camera = &scene.views.get(seen.view)?.camera;
            Some((camera.project(&point.position_in_world).pixel - seen.pixel).norm())
        })
        .collect();
    match distances.len() {
        0 => -1.0,
        count => distances.iter().sum::<f64>() / count as f64,
    }
}
