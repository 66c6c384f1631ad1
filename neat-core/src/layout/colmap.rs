//! The layout of a COLMAP reconstruction.
//!
//! - `images/NAME.png`; names may have subfolders
//! - `hawp/NAME.json`, see [`crate::hawp_json`]
//! - `sparse/0/`, else `sparse/`, else the folder itself: `cameras`, `images`
//!   and, where they are, `points3D`, all `.bin` or all `.txt`. Else, as
//!   nerfstudio puts it, the model in `colmap/sparse/0/`, or, as COLMAP's
//!   undistorter puts them, the model in `dense/sparse/` or `dense/0/sparse/`
//!   with the images in `dense/images/` or `dense/0/images/`.
//!
//! Poses in these files are camera-from-world in OpenCV axes, and the centre of
//! the first pixel has the image coordinates (0.5, 0.5). The world is the frame
//! of the files. Other files of a model, such as `rigs` and `frames`, are ignored:
//! `images` holds the pose of every image also in models with rigs.
//!
//! Points are read with their tracks. Elements of a track that name an image or a
//! 2D point that is not there are left out: models of known poses, and models made
//! smaller, are without 2D points.

mod binary;
mod camera_model;
mod text;

use super::images;
use super::poses::{PosedImage, Poses, pose_of, rotation_of};
use super::reconstruction::Reconstruction;
use crate::hawp_json::file_stem;
use crate::{CameraError, Distortion, Intrinsics, Observation, SceneError, SparsePoint, file};
use camera_model::CameraModel;
use nalgebra::{Matrix4, Vector2, Vector3};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Where a model and its images may lie in the folder of a scene, the likeliest
/// first.
const MODEL_AND_IMAGES_DIRS: [[&str; 2]; 6] = [
    ["sparse/0", "images"],
    ["sparse", "images"],
    ["", "images"],
    ["colmap/sparse/0", "images"],
    ["dense/sparse", "dense/images"],
    ["dense/0/sparse", "dense/0/images"],
];
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

/// A record of `images`.
#[derive(Clone, Debug, PartialEq)]
struct ColmapImage {
    id: u32,
    /// Path below the folder of images, as the file has it: not yet checked.
    name: String,
    camera: u32,
    /// Quaternion of the rotation camera-from-world: w, x, y, z.
    quaternion: [f64; 4],
    /// Translation camera-from-world.
    translation: [f64; 3],
    /// Pixels of its 2D points.
    points: Vec<[f64; 2]>,
}

/// A record of `points3D`.
#[derive(Clone, Debug, PartialEq)]
struct ColmapPoint {
    position: [f64; 3],
    /// Numbers of images, each with the index of one of their 2D points.
    track: Vec<[u32; 2]>,
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

    fn points(self, path: &Path, bytes: &[u8]) -> Result<Vec<ColmapPoint>, SceneError> {
        match self {
            Self::Binary => binary::points(path, bytes),
            Self::Text => text::points(path, bytes),
        }
    }
}

/// The files of a model.
struct Model {
    dir: PathBuf,
    images_dir: PathBuf,
    format: Format,
}

impl Model {
    /// The model of the scene in `dir`: where there are several, the first of
    /// [`MODEL_AND_IMAGES_DIRS`], and binary files before text, as COLMAP prefers
    /// them.
    fn find(dir: &Path) -> Option<Self> {
        let models = MODEL_AND_IMAGES_DIRS.iter().flat_map(|[below, images]| {
            [Format::Binary, Format::Text].map(|format| Self {
                dir: dir.join(below),
                images_dir: dir.join(images),
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
        let usual = dir.join(MODEL_AND_IMAGES_DIRS[0][0]);
        return Err(SceneError::missing(&usual, REMEDY));
    };
    let read = |name| file::read(&model.file(name), REMEDY);
    let path = model.file("cameras");
    let cameras = by_id(model.format.cameras(&path, &read("cameras")?)?, &path)?;
    let path = model.file("images");
    let images = model.format.images(&path, &read("images")?)?;
    if let Some(first) = images.first()
        && images::most_are_missing(&model.images_dir, images.len())
    {
        let relative = relative_path(&path, &first.name)?;
        return Err(images::missing(&model.images_dir.join(relative)));
    }
    // Models of known poses have no file of points, or an empty one.
    let points = match read("points3D") {
        Err(SceneError::Missing { .. } | SceneError::Empty { .. }) => None,
        points => Some(points?),
    };
    parse(&model, &cameras, images, points.as_deref())
}

fn parse(
    model: &Model,
    cameras: &BTreeMap<u32, ColmapCamera>,
    images: Vec<ColmapImage>,
    points: Option<&[u8]>,
) -> Result<Poses, SceneError> {
    let (cameras_path, path) = (model.file("cameras"), model.file("images"));
    let points = points.map_or(Ok(Vec::new()), |bytes| {
        let path = model.file("points3D");
        sparse_points(&path, model.format.points(&path, bytes)?, &images)
    })?;
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
            return Err(SceneError::malformed(&path, reason));
        };
        let (intrinsics, distortion) = lens_of(camera, &cameras_path, &name)?;
        let posed = PosedImage {
            image: images::with_existing_ending(model.images_dir.join(relative)),
            intrinsics,
            distortion,
            world_from_camera: world_from_camera(&image, &path, &name)?,
            size: Some(size_of(camera, &cameras_path)?),
            name,
        };
        views.push((image.id as usize, posed));
    }
    let reconstruction = Reconstruction {
        path,
        views,
        points,
        pixel_center: PIXEL_CENTER,
    };
    reconstruction.into_poses()
}

fn by_id(
    cameras: Vec<ColmapCamera>,
    path: &Path,
) -> Result<BTreeMap<u32, ColmapCamera>, SceneError> {
    let mut found = BTreeMap::new();
    for camera in cameras {
        let id = camera.id;
        if found.insert(id, camera).is_some() {
            return Err(SceneError::malformed(
                path,
                format!("camera {id} appears twice"),
            ));
        }
    }
    Ok(found)
}

/// The points with the pixels of their tracks, seen by views under the numbers of
/// their images.
fn sparse_points(
    path: &Path,
    points: Vec<ColmapPoint>,
    images: &[ColmapImage],
) -> Result<Vec<SparsePoint>, SceneError> {
    let images: BTreeMap<u32, &ColmapImage> =
        images.iter().map(|image| (image.id, image)).collect();
    let mut found = Vec::with_capacity(points.len());
    for point in points {
        if point.position.iter().any(|x| !x.is_finite()) {
            return Err(SceneError::malformed(path, "a point is not finite"));
        }
        let pixel = |image: u32, index: u32| images.get(&image)?.points.get(index as usize);
        let observations = point.track.iter().filter_map(|&[image, index]| {
            pixel(image, index).map(|&pixel| Observation {
                view: image as usize,
                pixel: Vector2::from(pixel),
            })
        });
        found.push(SparsePoint {
            position_in_world: Vector3::from(point.position),
            observations: observations.collect(),
        });
    }
    Ok(found)
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

fn lens_of(
    camera: &ColmapCamera,
    path: &Path,
    view: &str,
) -> Result<(Intrinsics, Distortion), SceneError> {
    if camera.parameters.iter().any(|x| !x.is_finite()) {
        return Err(SceneError::view(path, view, CameraError::NotFinite));
    }
    let Some((intrinsics, distortion)) = camera.model.lens(&camera.parameters) else {
        return Err(unknown_model(path, camera.id, camera.model.name.into()));
    };
    match intrinsics.validate() {
        Ok(()) => Ok((intrinsics, distortion)),
        Err(problem) => Err(SceneError::view(path, view, problem)),
    }
}

fn size_of(camera: &ColmapCamera, path: &Path) -> Result<(u32, u32), SceneError> {
    let ColmapCamera {
        id, width, height, ..
    } = *camera;
    match (u32::try_from(width), u32::try_from(height)) {
        (Ok(width), Ok(height)) => Ok((width, height)),
        _ => Err(SceneError::malformed(
            path,
            format!("camera {id} has images of {width}×{height} pixels"),
        )),
    }
}

fn world_from_camera(
    image: &ColmapImage,
    path: &Path,
    view: &str,
) -> Result<Matrix4<f64>, SceneError> {
    let translation = Vector3::from(image.translation);
    if translation.iter().any(|x| !x.is_finite()) {
        return Err(SceneError::view(path, view, CameraError::NotFinite));
    }
    let camera_from_world = rotation_of(image.quaternion, path, view)?;
    // camera = R · world + t, so the centre of the camera is −Rᵀ t.
    let center = -(camera_from_world.inverse() * translation);
    let rotation = camera_from_world.to_rotation_matrix().into_inner();
    Ok(pose_of(&rotation, &center))
}

/// A camera of a model that is not read.
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
    use crate::mutation::{CASES, damaged};
    use proptest::prelude::*;

    const CAMERAS: &[u8] = b"7 PINHOLE 12 8 20 21 6.5 4\n2 OPENCV 12 8 20 21 6 4 0.1 0.2 0.3 0.4\n";
    const IMAGES: &[u8] =
        b"3 1 0 0 0 1 2 3 7 b.png\n1.5 2.5 -1 3.5 4.5 9\n1 1 0 1 0 1 2 4 2 a.png\n\n";
    const POINTS: &[u8] = b"1 10 20 30 255 0 128 0.5 1 0 3 1 3 7\n9 9 21 31 1 2 3 0.5\n";

    fn model(format: Format) -> Model {
        Model {
            dir: "scene/sparse/0".into(),
            images_dir: "scene/images".into(),
            format,
        }
    }

    fn parsed([cameras, images, points]: [&[u8]; 3]) -> Result<Poses, SceneError> {
        let path = Path::new("model");
        let cameras = by_id(text::cameras(path, cameras)?, path)?;
        let images = text::images(path, images)?;
        parse(&model(Format::Text), &cameras, images, Some(points))
    }

    #[test]
    fn lenses_and_observations_are_those_of_the_files() {
        let poses = parsed([CAMERAS, IMAGES, POINTS]).unwrap();
        let [a, b] = poses.views.as_slice() else {
            panic!("two views");
        };
        let lens = Distortion::Brown {
            radial: [0.1, 0.2, 0.0, 0.0, 0.0, 0.0],
            tangential: [0.3, 0.4],
        };
        assert_eq!((a.distortion, b.distortion), (lens, Distortion::None));
        let [first, second] = poses.points.as_slice() else {
            panic!("two points");
        };
        assert_eq!(first.position_in_world, Vector3::new(10.0, 20.0, 30.0));
        // Neither image 1 nor the eighth point of image 3 has a pixel.
        let seen = Observation {
            view: 1,
            pixel: Vector2::new(3.5, 4.5),
        };
        assert_eq!(first.observations, [seen]);
        assert_eq!(second.observations, []);
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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn damaged_text_models_never_panic(
            cameras in damaged(CAMERAS), images in damaged(IMAGES), points in damaged(POINTS),
            kind in 0..4usize,
        ) {
            let [mut files, damaged] = [[CAMERAS, IMAGES, POINTS], [&cameras, &images, &points]];
            // One file or all of them.
            match kind {
                3 => files = damaged,
                kind => files[kind] = damaged[kind],
            }
            if let Ok(poses) = parsed(files) {
                prop_assert!(poses.views.iter().all(|view| view.intrinsics.validate().is_ok()));
            }
        }
    }
}
