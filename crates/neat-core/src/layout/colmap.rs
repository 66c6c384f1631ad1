//! The layout of a COLMAP reconstruction.
//!
//! - `images/NAME.png`; names may have subfolders
//! - `hawp/NAME.json`, see [`crate::hawp_json`]
//! - `sparse/0/`, else `sparse/`, else the folder itself: `cameras`, `images`
//!   and, where they are, `points3D`, all `.bin` or all `.txt`.
//!
//! Poses in these files are camera-from-world in OpenCV axes, and the centre of
//! the first pixel has the image coordinates (0.5, 0.5). A reconstruction has its
//! origin anywhere, but a scene has it in the object: the world is the frame of
//! the files moved so that the median of the points is the origin. Without points
//! it is the frame of the files.
//!
//! A scene has pinhole cameras only, so images must be undistorted.

mod binary;
mod camera_model;
mod text;

use super::images;
use super::poses::{PosedImage, Poses, view_error};
use crate::hawp_json::file_stem;
use crate::scene::check_names;
use crate::{CameraError, Distortion, Intrinsics, SceneError, Similarity, file};
use camera_model::CameraModel;
use nalgebra::{Matrix4, Quaternion, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Where a model may lie in the folder of a scene, the likeliest first.
const MODEL_DIRS: [&str; 3] = ["sparse/0", "sparse", ""];
const IMAGES_DIR: &str = "images";
/// COLMAP counts image coordinates from the corner of the image.
const PIXEL_CENTER: f64 = 0.5;
const REMEDY: &str = "provide the COLMAP model, cameras and images with the ending .bin or .txt";

/// A record of `cameras`.
#[derive(Clone, Debug, PartialEq)]
struct ColmapCamera {
    id: u32,
    model: &'static CameraModel,
    width: u64,
    height: u64,
    /// As many as the model has.
    parameters: Vec<f64>,
}

/// A record of `images`, without its 2D points.
#[derive(Clone, Debug, PartialEq)]
struct ColmapImage {
    /// Path below the folder of images, as the file has it: not yet checked.
    name: String,
    camera: u32,
    /// Quaternion of the rotation camera-from-world: w, x, y, z.
    quaternion: [f64; 4],
    /// Translation camera-from-world.
    translation: [f64; 3],
}

/// The two forms in which COLMAP writes its files.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Format {
    Binary,
    Text,
}

impl Format {
    fn ending(self) -> &'static str {
        match self {
            Self::Binary => "bin",
            Self::Text => "txt",
        }
    }

    fn cameras(self, path: &Path, bytes: &[u8]) -> Result<Vec<ColmapCamera>, SceneError> {
        match self {
            Self::Binary => binary::cameras(path, bytes),
            Self::Text => text::cameras(path, bytes),
        }
    }

    fn images(self, path: &Path, bytes: &[u8]) -> Result<Vec<ColmapImage>, SceneError> {
        match self {
            Self::Binary => binary::images(path, bytes),
            Self::Text => text::images(path, bytes),
        }
    }

    fn points(self, path: &Path, bytes: &[u8]) -> Result<Vec<[f64; 3]>, SceneError> {
        match self {
            Self::Binary => binary::points(path, bytes),
            Self::Text => text::points(path, bytes),
        }
    }
}

/// The files of a model.
struct Model {
    dir: PathBuf,
    format: Format,
}

impl Model {
    /// The model of the scene in `dir`: where there are several, the first of
    /// [`MODEL_DIRS`], and binary files before text, as COLMAP prefers them.
    fn find(dir: &Path) -> Option<Self> {
        let models = MODEL_DIRS.iter().flat_map(|below| {
            [Format::Binary, Format::Text].map(|format| Self {
                dir: dir.join(below),
                format,
            })
        });
        models
            .into_iter()
            .find(|model| model.file("cameras").is_file() && model.file("images").is_file())
    }

    fn file(&self, name: &str) -> PathBuf {
        self.dir.join(format!("{name}.{}", self.format.ending()))
    }
}

/// Whether the folder of a scene holds a model.
pub(super) fn is_in(dir: &Path) -> bool {
    Model::find(dir).is_some()
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let Some(model) = Model::find(dir) else {
        return Err(SceneError::Missing {
            path: dir.join(MODEL_DIRS[0]),
            remedy: REMEDY.into(),
        });
    };
    let (cameras_path, path) = (model.file("cameras"), model.file("images"));
    let cameras = model
        .format
        .cameras(&cameras_path, &file::read(&cameras_path, REMEDY)?)?;
    let cameras = by_id(cameras, &cameras_path)?;
    let images = model.format.images(&path, &file::read(&path, REMEDY)?)?;
    let origin = median(&read_points(&model)?);

    let images_dir = dir.join(IMAGES_DIR);
    let mut views = Vec::with_capacity(images.len());
    for image in images {
        let relative = relative_path(&path, &image.name)?;
        let name = file_stem(relative);
        let Some(camera) = cameras.get(&image.camera) else {
            let reason = format!(
                "view `{name}` has the camera {}, which is not in {}",
                image.camera,
                cameras_path.display()
            );
            return Err(malformed(&path, reason));
        };
        views.push(PosedImage {
            image: images::with_existing_ending(images_dir.join(relative)),
            intrinsics: intrinsics_of(camera, &cameras_path, &name)?,
            distortion: Distortion::None,
            world_from_camera: world_from_camera(&image, &origin, &path, &name)?,
            size: Some(size_of(camera, &cameras_path)?),
            name,
        });
    }
    views.sort_by(|a, b| a.name.cmp(&b.name));
    check_names(views.iter().map(|view| view.name.as_str()), &path)?;
    Ok(Poses {
        path,
        views,
        original_from_world: Similarity {
            scale: 1.0,
            translation: origin,
        },
        pixel_center: Some(PIXEL_CENTER),
        points: Vec::new(),
        declared_radius: None,
    })
}

fn by_id(
    cameras: Vec<ColmapCamera>,
    path: &Path,
) -> Result<BTreeMap<u32, ColmapCamera>, SceneError> {
    let mut found = BTreeMap::new();
    for camera in cameras {
        let id = camera.id;
        if found.insert(id, camera).is_some() {
            return Err(malformed(path, format!("camera {id} appears twice")));
        }
    }
    Ok(found)
}

/// The points of a model; none where it has no file of them, or an empty one, as
/// models of known poses have.
fn read_points(model: &Model) -> Result<Vec<[f64; 3]>, SceneError> {
    let path = model.file("points3D");
    let points = match file::read(&path, REMEDY) {
        Ok(bytes) => model.format.points(&path, &bytes)?,
        Err(SceneError::Missing { .. } | SceneError::Empty { .. }) => return Ok(Vec::new()),
        Err(error) => return Err(error),
    };
    match points.iter().flatten().all(|x| x.is_finite()) {
        true => Ok(points),
        false => Err(malformed(&path, "a point is not finite".into())),
    }
}

/// The median of each coordinate (of an even number of points the upper one),
/// which stray points hardly move. The origin where there are no points.
fn median(points: &[[f64; 3]]) -> Vector3<f64> {
    if points.is_empty() {
        return Vector3::zeros();
    }
    Vector3::from_fn(|axis, _| {
        let mut values: Vec<f64> = points.iter().map(|point| point[axis]).collect();
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f64::total_cmp).1
    })
}

/// A name from `images` as a path that stays below the folder of images.
fn relative_path<'a>(path: &Path, name: &'a str) -> Result<&'a Path, SceneError> {
    let relative = Path::new(name);
    let stays = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    // A backslash leads out of the folder on some systems only: refused on all.
    if relative.components().all(stays) && !name.contains('\\') {
        return Ok(relative);
    }
    Err(SceneError::ViewName {
        path: path.into(),
        view: name.into(),
        reason: "is not a path below the folder of images, with `/` between folders: rename it",
    })
}

fn intrinsics_of(camera: &ColmapCamera, path: &Path, view: &str) -> Result<Intrinsics, SceneError> {
    if camera.parameters.iter().any(|x| !x.is_finite()) {
        return Err(view_error(path, view, CameraError::NotFinite));
    }
    let Some(intrinsics) = camera.model.pinhole(&camera.parameters) else {
        return Err(SceneError::NotPinhole {
            path: path.into(),
            camera: camera.id,
            model: camera.model.name.into(),
        });
    };
    match intrinsics.validate() {
        Ok(()) => Ok(intrinsics),
        Err(problem) => Err(view_error(path, view, problem)),
    }
}

fn size_of(camera: &ColmapCamera, path: &Path) -> Result<(u32, u32), SceneError> {
    let ColmapCamera {
        id, width, height, ..
    } = *camera;
    match (u32::try_from(width), u32::try_from(height)) {
        (Ok(width), Ok(height)) => Ok((width, height)),
        _ => Err(malformed(
            path,
            format!("camera {id} has images of {width}×{height} pixels"),
        )),
    }
}

/// The pose of `image` in the world whose origin is `origin` in the file's frame.
fn world_from_camera(
    image: &ColmapImage,
    origin: &Vector3<f64>,
    path: &Path,
    view: &str,
) -> Result<Matrix4<f64>, SceneError> {
    let [w, x, y, z] = image.quaternion;
    let quaternion = Quaternion::new(w, x, y, z);
    let translation = Vector3::from(image.translation);
    let mut numbers = quaternion.coords.iter().chain(&translation);
    if numbers.any(|x| !x.is_finite()) {
        return Err(view_error(path, view, CameraError::NotFinite));
    }
    // Not zero, and neither so small nor so large that it cannot be divided by.
    if !quaternion.norm().is_normal() {
        let reason =
            format!("the quaternion ({w}, {x}, {y}, {z}) of view `{view}` is not a rotation");
        return Err(malformed(path, reason));
    }
    // camera = R · world + t, so the centre of the camera is −Rᵀ t.
    let world_from_camera = UnitQuaternion::from_quaternion(quaternion).inverse();
    let center = -(world_from_camera * translation) - origin;
    Ok(world_from_camera
        .to_homogeneous()
        .append_translation(&center))
}

fn malformed(path: &Path, reason: String) -> SceneError {
    SceneError::Malformed {
        path: path.into(),
        reason,
    }
}

/// A camera of a model that is not known.
fn unknown_model(path: &Path, camera: u32, model: String) -> SceneError {
    SceneError::NotPinhole {
        path: path.into(),
        camera,
        model,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stray_points_do_not_move_the_origin() {
        let mut points = vec![[1.0, 2.0, 3.0]; 5];
        points.push([1e9, -1e9, 1e9]);
        assert_eq!(median(&points), Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(median(&[]), Vector3::zeros());
    }

    #[test]
    fn names_stay_below_the_folder_of_images() {
        let path = Path::new("images.txt");
        for good in ["a.png", "left/a.png", "./a.png", "a b..png"] {
            assert_eq!(relative_path(path, good).unwrap(), Path::new(good));
        }
        for bad in ["../a.png", "left/../../a.png", "/etc/a.png", "..\\a.png"] {
            assert!(matches!(
                relative_path(path, bad),
                Err(SceneError::ViewName { .. })
            ));
        }
    }
}
