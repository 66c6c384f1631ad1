//! The layout of Blender's NeRF scenes, instant-ngp and nerfstudio.
//!
//! `transforms.json`, else `transforms_train.json`: `{"camera_angle_x": angle,
//! "frames": [{"file_path": "./train/r_0", "transform_matrix": 4×4}, …]}`, or with
//! `fl_x`, `fl_y`, `cx`, `cy`, `w`, `h`. Poses are camera-to-world in OpenGL axes
//! (x right, y up, looking along −z) and are turned into OpenCV axes here. The
//! world of the file is kept: nerfstudio's `applied_transform` and
//! `applied_scale` have been applied to the poses already. `pixel_center`, which
//! [`crate::convert`] writes, says which image coordinates the centre of the first
//! pixel has. Other keys are ignored.
//!
//! Lenses are perspective (`k1 k2 k3 p1 p2`, [`crate::Distortion::Brown`]) unless
//! `camera_model` is `OPENCV_FISHEYE` or `is_fisheye` is set (`k1 … k4`,
//! [`crate::Distortion::Fisheye`]). `distortion_params` lists `k1 k2 k3 k4 p1 p2`. Points
//! are those of nerfstudio's `ply_file_path`, where that file is there; they have
//! no observations.

mod lens;

use super::CameraAxes;
use super::images::{self, ENDINGS, has_known_ending, read_size, with_existing_ending};
use super::poses::{PosedImage, Poses, upper_left};
use crate::hawp_json::file_stem;
use crate::ply::read_points;
use crate::{SceneError, SparsePoint, file};
use nalgebra::Matrix4;
use serde::Deserialize;
use std::path::{Component, Path, PathBuf};

/// In the order in which they are looked for. The second is Blender's.
const FILE_NAMES: [&str; 2] = ["transforms.json", "transforms_train.json"];

/// The middle of an image at W/2: its corner is the origin.
const PIXEL_CENTER_OF_MIDDLE: f64 = 0.5;

#[derive(Deserialize)]
struct TransformsJson {
    #[serde(flatten)]
    lens: Lens,
    /// Ours, as in `cameras.npz`: other programs ignore it.
    pixel_center: Option<f64>,
    frames: Vec<Frame>,
    ply_file_path: Option<String>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: String,
    /// Checked by hand, so that a wrong shape is reported with its frame. `null`
    /// is what some writers make of NaN.
    transform_matrix: Vec<Vec<Option<f64>>>,
    #[serde(flatten)]
    lens: Lens,
}

/// What may stand for all frames or for one.
#[derive(Deserialize)]
struct Lens {
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    /// Written as `800` or `800.0`.
    w: Option<f64>,
    h: Option<f64>,
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    distortion_params: Option<Vec<f64>>,
}

/// The file of this layout in the folder `dir`, where there is one.
pub(super) fn find(dir: &Path) -> Option<PathBuf> {
    images::first_of(dir, &FILE_NAMES)
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let path = find(dir).unwrap_or_else(|| dir.join(FILE_NAMES[0]));
    let bytes = file::read(&path, "provide the poses of the images")?;
    parse(&bytes, path, dir)
}

fn parse(bytes: &[u8], path: PathBuf, dir: &Path) -> Result<Poses, SceneError> {
    let json: TransformsJson = file::parse_json(bytes, &path, "list of transforms")?;
    if json.frames.is_empty() {
        return Err(SceneError::NoView { path });
    }
    let mut views = Vec::with_capacity(json.frames.len());
    let mut middle_for_all = true;
    for frame in &json.frames {
        let context = FrameContext {
            path: &path,
            frame,
            all: &json.lens,
        };
        let given = |number: fn(&Lens) -> Option<f64>| context.first(number).is_some();
        middle_for_all &= !given(|lens| lens.cx) && !given(|lens| lens.cy);
        views.push(context.posed_image(dir)?);
    }
    let pixel_center = match json.pixel_center {
        None => middle_for_all.then_some(PIXEL_CENTER_OF_MIDDLE),
        Some(value) if [0.0, 0.5].contains(&value) => Some(value),
        Some(value) => {
            let reason = format!("`pixel_center` is {value}, not 0 or 0.5");
            return Err(SceneError::malformed(&path, reason));
        }
    };
    Ok(Poses {
        points: sparse_points(&path, dir, json.ply_file_path.as_deref())?,
        pixel_center,
        file_axes: CameraAxes::OPENGL,
        ..Poses::new(&path, views)?
    })
}

/// The points that a file names, if they are there: they are often not passed on.
fn sparse_points(
    path: &Path,
    dir: &Path,
    ply_file_path: Option<&str>,
) -> Result<Vec<SparsePoint>, SceneError> {
    let Some(name) = ply_file_path.filter(|name| !name.is_empty()) else {
        return Ok(Vec::new());
    };
    let points_path = images::locate(path, &[dir.into()], name)?;
    if !points_path.is_file() {
        return Ok(Vec::new());
    }
    let positions = read_points(&points_path)?.into_iter();
    Ok(positions.map(SparsePoint::unseen).collect())
}

/// A frame with what its file says about all frames.
struct FrameContext<'a> {
    path: &'a Path,
    frame: &'a Frame,
    all: &'a Lens,
}

impl FrameContext<'_> {
    fn posed_image(&self, dir: &Path) -> Result<PosedImage, SceneError> {
        let distortion = self.distortion()?;
        let world_from_camera = self.world_from_camera()?;
        let relative = self.relative_path()?;
        let name = view_name(&relative);
        let image = existing_image(dir.join(relative));
        let size = self.size(&image)?;
        let intrinsics = self.intrinsics(size, &image)?;
        intrinsics
            .validate()
            .and_then(|()| distortion.validate())
            .map_err(|problem| SceneError::view(self.path, &name, problem))?;
        Ok(PosedImage {
            name,
            image,
            intrinsics,
            distortion: distortion.simplest(),
            world_from_camera,
            size,
        })
    }

    /// What the frame says itself, else what the file says for all.
    fn first<T>(&self, number: impl Fn(&Lens) -> Option<T>) -> Option<T> {
        number(&self.frame.lens).or_else(|| number(self.all))
    }

    fn error(&self, reason: impl std::fmt::Display) -> SceneError {
        let reason = format!("frame `{}` {reason}", self.frame.file_path);
        SceneError::malformed(self.path, reason)
    }

    /// The pose in OpenCV axes: y and z of the camera change their signs. What
    /// else makes a pose rigid is checked with the image, as in every layout.
    fn world_from_camera(&self) -> Result<Matrix4<f64>, SceneError> {
        let rows = &self.frame.transform_matrix;
        if rows.len() != 4 || rows.iter().any(|row| row.len() != 4) {
            let lengths: Vec<_> = rows.iter().map(Vec::len).collect();
            return Err(self.error(format_args!(
                "has a `transform_matrix` with rows of {lengths:?} numbers, expected 4×4"
            )));
        }
        let numbers = rows.iter().flatten().map(|x| x.unwrap_or(f64::NAN));
        let mut pose = Matrix4::from_row_iterator(numbers);
        // Said here, because the general message asks for OpenCV axes. Poses
        // that are nearly singular are told so later.
        let determinant = upper_left(&pose).determinant();
        if determinant < -1e-3 {
            return Err(self.error(format_args!(
                "has a mirrored pose (determinant {determinant:.3}): \
                 this layout needs OpenGL axes, x right, y up, z backward"
            )));
        }
        for column in [1, 2] {
            for row in 0..3 {
                pose[(row, column)] = -pose[(row, column)];
            }
        }
        Ok(pose)
    }

    /// The path of the image below the scene's folder. Scenes come from
    /// strangers: no file outside is opened.
    fn relative_path(&self) -> Result<PathBuf, SceneError> {
        let mut relative = PathBuf::new();
        for component in Path::new(&self.frame.file_path).components() {
            match component {
                Component::CurDir => {}
                Component::Normal(part) => relative.push(part),
                Component::ParentDir | Component::RootDir | Component::Prefix(_) => {
                    return Err(self.error(
                        "is outside the scene: put the image into its folder \
                         and name it without `..` and relative to the folder",
                    ));
                }
            }
        }
        if relative.as_os_str().is_empty() {
            return Err(self.error("names no image"));
        }
        Ok(relative)
    }

    /// Width and height, if the file gives them; one alone is completed by the
    /// image.
    fn size(&self, image: &Path) -> Result<Option<(u32, u32)>, SceneError> {
        let width = self.pixels("w", self.first(|lens| lens.w))?;
        let height = self.pixels("h", self.first(|lens| lens.h))?;
        Ok(match (width, height) {
            (None, None) => None,
            (Some(width), Some(height)) => Some((width, height)),
            _ => {
                let (image_width, image_height) = read_size(image)?;
                Some((width.unwrap_or(image_width), height.unwrap_or(image_height)))
            }
        })
    }

    fn pixels(&self, key: &str, value: Option<f64>) -> Result<Option<u32>, SceneError> {
        let Some(value) = value else {
            return Ok(None);
        };
        if value.fract() != 0.0 || !(1.0..=f64::from(u32::MAX)).contains(&value) {
            return Err(self.error(format_args!(
                "has `{key}` = {value}, which is no number of pixels"
            )));
        }
        // A whole number within the range, as just checked.
        Ok(Some(value as u32))
    }
}

/// The file name without its ending, if that is one of an image: `r_0.5` is a
/// name without ending.
fn view_name(relative: &Path) -> String {
    if has_known_ending(relative) {
        return file_stem(relative);
    }
    let name = relative.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// The image of a name: Blender leaves endings out, and data sets are passed on
/// with their images converted.
fn existing_image(image: PathBuf) -> PathBuf {
    if image.is_file() {
        return image;
    }
    if has_known_ending(&image) {
        return with_existing_ending(image);
    }
    let with_ending = |ending: &str| {
        let mut path = image.clone().into_os_string();
        path.push(".");
        path.push(ending);
        PathBuf::from(path)
    };
    ENDINGS
        .iter()
        .map(|ending| with_ending(ending))
        .find(|path| path.is_file())
        .unwrap_or_else(|| with_ending(ENDINGS[0]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Similarity;
    use crate::mutation::{CASES, damaged};
    use proptest::prelude::*;

    pub(super) const ONE_FRAME: &str = r#"{"fl_x": 5, "fl_y": 6.0, "cx": 2, "cy": 1.5, "w": 4.0, "h": 3,
        "k1": 0, "camera_model": "OPENCV", "aabb_scale": 16, "frames": [{"file_path": "./images/a.png",
        "transform_matrix": [[1, 0, 0, 7], [0, 1, 0, 8], [0, 0, 1, 9], [0, 0, 0, 1]]}]}"#;

    pub(super) fn parse_text(bytes: &[u8]) -> Result<Poses, SceneError> {
        parse(bytes, "scene/transforms.json".into(), Path::new("scene"))
    }

    #[test]
    fn axes_are_opencv_and_the_center_stays() {
        let poses = parse_text(ONE_FRAME.as_bytes()).unwrap();
        let view = &poses.views[0];
        assert_eq!(view.name, "a");
        assert_eq!(view.image, Path::new("scene/images/a.png"));
        assert_eq!(view.size, Some((4, 3)));
        let expected = Matrix4::new(
            1.0, 0.0, 0.0, 7.0, 0.0, -1.0, 0.0, 8.0, 0.0, 0.0, -1.0, 9.0, 0.0, 0.0, 0.0, 1.0,
        );
        assert_eq!(view.world_from_camera, expected);
        assert_eq!(poses.original_from_world, Similarity::identity());
    }

    #[test]
    fn only_endings_of_images_are_cut_off_names() {
        let names = ["train/r_0", "r_0.PNG", "r_0.5", "a/b.c/d.jpeg"];
        let names = names.map(|name| view_name(Path::new(name)));
        assert_eq!(names, ["r_0", "r_0", "r_0.5", "d"]);
    }

    #[test]
    fn points_are_those_of_the_named_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("transforms.json");
        let text = ONE_FRAME.replacen('{', r#"{"ply_file_path": "sparse_pc.ply","#, 1);
        let points = || {
            parse(text.as_bytes(), path.clone(), dir.path())
                .unwrap()
                .points
        };
        assert_eq!(points(), []);
        let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n\
            property float y\nproperty float z\nend_header\n1 2 3\n";
        std::fs::write(dir.path().join("sparse_pc.ply"), ply).unwrap();
        let expected = SparsePoint {
            position_in_world: nalgebra::Vector3::new(1.0, 2.0, 3.0),
            observations: Vec::new(),
        };
        assert_eq!(points(), [expected]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn truncated_and_damaged_files_are_errors_not_panics(
            end in 0..ONE_FRAME.len(), bytes in damaged(ONE_FRAME),
        ) {
            prop_assert!(parse_text(&ONE_FRAME.as_bytes()[..end]).is_err());
            if let Ok(poses) = parse_text(&bytes) {
                prop_assert!(poses.views.iter().all(|view| view.intrinsics.validate().is_ok()));
            }
        }

        #[test]
        fn numbers_of_any_kind_are_errors_not_panics(
            key in prop::sample::select(vec!["fl_x", "fl_y", "cx", "w", "h", "k1"]),
            value: f64,
            cells in prop::collection::vec(prop::collection::vec(any::<f64>(), 0..6), 0..6),
        ) {
            let mut json: serde_json::Value = serde_json::from_str(ONE_FRAME).unwrap();
            json[key] = value.into();
            if let Ok(poses) = parse_text(json.to_string().as_bytes()) {
                prop_assert!(poses.views[0].intrinsics.validate().is_ok());
            }
            json["frames"][0]["transform_matrix"] = cells.into();
            let _ = parse_text(json.to_string().as_bytes());
        }
    }
}
