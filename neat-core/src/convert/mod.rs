//! Any scene written for other programs: COLMAP, IDR and NeuS, nerfstudio, or in
//! the layout of the published code.
//!
//! Everything is written in the frame of the user's files
//! ([`Scene::original_from_world`]), so that what other programs find in the
//! converted scene lies where the user's own data are. These formats have no left-handed worlds:
//! of one that was read as such the mirror image is written. Images are those of the
//! scene: undistorted, and scaled down where the scene is.

mod cameras_npz;
mod colmap;
mod points;
mod transforms_json;

use crate::layout::abc;
use crate::{Camera, Scene, SceneError, file, hawp_json};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;
use tracing::info_span;

/// For which programs a scene is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SceneFormat {
    /// The published code: `images/` and `cameras.npz` with `intrinsics` and
    /// `extrinsics`. Cameras stay in the scene's world, and `scale_mat` leads to
    /// the user's frame.
    Abc,
    /// COLMAP: `images/`, and `cameras.txt`, `images.txt` and `points3D.txt` in
    /// `sparse/0/`, with the tracks of the sparse points.
    Colmap,
    /// IDR, VolSDF and NeuS: `image/`, and `cameras.npz` with `world_mat_i` and
    /// `scale_mat_i`.
    CamerasNpz,
    /// nerfstudio and instant-ngp: `images/`, and `transforms.json` in OpenGL
    /// axes.
    TransformsJson,
}

/// The file of sparse points of the formats that have no place for them.
pub const POINTS_FILE: &str = "sparse_points.ply";

/// Writes `scene` into the folder `dir`, which must not exist or be empty. The
/// 2D wireframes, if there are any, go along in `hawp/`, one file per view; sparse points
/// in the format's own file, or in [`POINTS_FILE`] in the user's frame.
///
/// The folder appears once it is complete.
///
/// # Errors
/// If [`Scene::validate`] does not pass, the folder has files, a camera cannot be
/// expressed in the format, or a file cannot be written.
///
/// # Example
/// ```no_run
/// use neat_core::convert::{SceneFormat, convert};
/// use neat_core::{LoadOptions, load_scene};
/// let scene = load_scene("photos", &LoadOptions::default())?.scene;
/// convert(&scene, SceneFormat::Colmap, "photos-colmap".as_ref())?;
/// # Ok::<(), neat_core::SceneError>(())
/// ```
pub fn convert(scene: &Scene, format: SceneFormat, dir: &Path) -> Result<(), SceneError> {
    let _span = info_span!("convert", ?format, dir = %dir.display()).entered();
    scene.validate()?;
    file::write_dir_atomically(dir, |dir| {
        // What can be refused comes before the images, which take long.
        match format {
            SceneFormat::Abc => return abc_scene(scene, dir),
            SceneFormat::Colmap => colmap::write(scene, dir)?,
            SceneFormat::CamerasNpz => cameras_npz::write(scene, dir)?,
            SceneFormat::TransformsJson => transforms_json::write(scene, dir)?,
        }
        write_wireframes(scene, dir)
    })
}

fn abc_scene(scene: &Scene, dir: &Path) -> Result<(), SceneError> {
    abc::write_scene(scene, dir)?;
    points::write_if_any(scene, &dir.join(POINTS_FILE))
}

fn write_images(scene: &Scene, dir: &Path) -> Result<(), SceneError> {
    file::create_dir(dir)?;
    // No more than this at once: some images are read only now.
    let mut chunks = scene.views.chunks(rayon::current_num_threads());
    chunks.try_for_each(|views| {
        (views.par_iter()).try_for_each(|view| {
            file::write_png(&dir.join(image_name(&view.name)), &*view.image.read()?)
        })
    })
}

fn write_wireframes(scene: &Scene, dir: &Path) -> Result<(), SceneError> {
    // An empty folder would say that nothing was to be found.
    if !scene.has_wireframes() {
        return Ok(());
    }
    let hawp_dir = dir.join(abc::HAWP_DIR);
    file::create_dir(&hawp_dir)?;
    scene.views.iter().try_for_each(|view| {
        let path = hawp_dir.join(format!("{}.json", view.name));
        hawp_json::write(&path, &view.wireframe, scene.pixel_center)
    })
}

/// The file of a view's image.
fn image_name(view: &str) -> String {
    format!("{view}.png")
}

/// COLMAP and nerfstudio count image coordinates from the corner of the image.
const CORNER_ORIGIN: f64 = 0.5;

/// `camera` in the frame of the user's files.
fn in_original_frame(camera: &Camera, scene: &Scene) -> Camera {
    Camera {
        center_in_world: (scene.original_from_world.without_mirroring())
            .apply(&camera.center_in_world),
        ..*camera
    }
}

/// Positions of the sparse points in the frame of the user's files.
fn points_in_original_frame(scene: &Scene) -> Vec<Vector3<f64>> {
    let original_from_world = scene.original_from_world.without_mirroring();
    let original = |position: &Vector3<f64>| original_from_world.apply(position);
    (scene.sparse_points.iter())
        .map(|point| original(&point.position_in_world))
        .collect()
}

/// Skew up to this moves no point of the image by more than 1/20 pixel, and can
/// be left out: decompositions of projections leave such traces.
const MAX_SHIFT_BY_SKEW: f64 = 0.05;

/// Errs unless the camera of every view is described by focal lengths and
/// principal point; `path` is the file to be written.
fn check_no_skew(scene: &Scene, path: &Path) -> Result<(), SceneError> {
    for view in &scene.views {
        let camera = &view.camera;
        let k = &camera.intrinsics;
        let farthest = k.cy.abs().max((f64::from(camera.height) - k.cy).abs()) / k.fy;
        if (k.skew * farthest).abs() > MAX_SHIFT_BY_SKEW {
            return Err(SceneError::Inexpressible {
                path: path.into(),
                view: view.name.clone(),
                reason: format!(
                    "its pixels are not rectangles (skew {}): write cameras.npz instead",
                    k.skew
                ),
            });
        }
    }
    Ok(())
}
