//! The layout of the multi-view benchmark of Strecha and others (EPFL, 2008).
//!
//! - `NAME.jpg.camera`, one per image, in `gt_dense_cameras/`, else beside the
//!   images, else in the folder itself
//! - `images/NAME.jpg`, or beside its camera, or in the folder itself
//! - `hawp/NAME.json`, see [`crate::hawp_json`]
//!
//! A file holds, in this order, the three rows of K, three coefficients of
//! distortion, which are zero because images are undistorted, the three rows of
//! the rotation camera-to-world in OpenCV axes, the centre of projection, and the
//! width and height of the image. Where the centre of a pixel lies is not
//! documented.

use super::images;
use super::poses::{PosedImage, Poses, pose_of};
use super::text_lines::expected_records;
use crate::hawp_json::file_stem;
use crate::{Distortion, Intrinsics, SceneError, file};
use nalgebra::{Matrix3, Vector3};
use std::fs;
use std::path::{Path, PathBuf};

/// Where the cameras may lie, in the order in which they are looked for.
const CAMERAS_DIRS: [&str; 3] = ["gt_dense_cameras", "images", ""];
const ENDING: &str = "camera";
const REMEDY: &str = "provide one file NAME.jpg.camera per image";

/// The folder of cameras of the scene in `dir`, where there is one.
pub(super) fn find(dir: &Path) -> Option<PathBuf> {
    let mut dirs = CAMERAS_DIRS.iter().map(|below| dir.join(below));
    dirs.find(|dir| !camera_files(dir).is_empty())
}

/// The files of cameras in a folder, sorted.
fn camera_files(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten();
    let of_image = |path: &PathBuf| {
        path.extension().is_some_and(|ending| ending == ENDING)
            && images::has_known_ending(&path.with_extension(""))
            && path.is_file()
    };
    let mut files: Vec<_> = entries.map(|entry| entry.path()).filter(of_image).collect();
    files.sort();
    files
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let Some(cameras_dir) = find(dir) else {
        return Err(SceneError::missing(&dir.join(CAMERAS_DIRS[0]), REMEDY));
    };
    let dirs = [dir.join("images"), cameras_dir.clone(), dir.into()];
    let mut views = Vec::new();
    for path in camera_files(&cameras_dir) {
        views.push(parse(&file::read(&path, REMEDY)?, &path, &dirs)?);
    }
    Poses::new(&cameras_dir, views)
}

fn parse(bytes: &[u8], path: &Path, dirs: &[PathBuf]) -> Result<PosedImage, SceneError> {
    let mut records = expected_records(path, bytes)?;
    let mut row = |what| records.expect(what)?.numbers::<3>(what);
    // `From` takes the inner arrays for columns.
    let what = "the rows of K";
    let k = Matrix3::from([row(what)?, row(what)?, row(what)?]).transpose();
    let distortion = row("the distortion")?;
    let what = "the rows of the rotation";
    let world_from_camera = Matrix3::from([row(what)?, row(what)?, row(what)?]).transpose();
    let center = row("the centre")?;
    let mut line = records.expect("the size")?;
    let size = (line.parse("the width")?, line.parse("the height")?);

    // `NAME.jpg.camera` without its ending.
    let image = path.with_extension("");
    let image = image.file_name().unwrap_or_default().to_string_lossy();
    let image = images::locate(path, dirs, &image)?;
    let name = file_stem(&image);
    if distortion != [0.0; 3] {
        let reason = format!("view `{name}` has lens distortion: undistort the images first");
        return Err(SceneError::malformed(path, reason));
    }
    let intrinsics = Intrinsics::try_from_matrix(&k)
        .map_err(|problem| SceneError::view(path, &name, problem))?;
    Ok(PosedImage {
        name,
        image,
        intrinsics,
        distortion: Distortion::None,
        world_from_camera: pose_of(&world_from_camera.transpose(), &Vector3::from(center)),
        size: Some(size),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use nalgebra::Matrix4;
    use proptest::prelude::*;

    const CAMERA: &str = "20 0.5 6.5 \n0 21 4 \n0 0 1 \n0 0 0\n\
        0 1 0 \n-1 0 0 \n0 0 1 \n7 8 9 \n12 8\n";

    fn parse_text(bytes: &[u8]) -> Result<PosedImage, SceneError> {
        let path = Path::new("scene/gt_dense_cameras/a.b.jpg.camera");
        parse(bytes, path, &["scene/images".into()])
    }

    #[test]
    fn rows_are_read_in_their_order() {
        let view = parse_text(CAMERA.as_bytes()).unwrap();
        assert_eq!(view.name, "a.b");
        assert_eq!(view.image, Path::new("scene/images/a.b.jpg"));
        let k = view.intrinsics;
        assert_eq!(
            [k.fx, k.skew, k.cx, k.fy, k.cy],
            [20.0, 0.5, 6.5, 21.0, 4.0]
        );
        let pose = Matrix4::new(
            0.0, 1.0, 0.0, 7.0, -1.0, 0.0, 0.0, 8.0, 0.0, 0.0, 1.0, 9.0, 0.0, 0.0, 0.0, 1.0,
        );
        assert_eq!(view.world_from_camera, pose);
        assert_eq!(view.size, Some((12, 8)));
    }

    #[test]
    fn messages_name_the_file() {
        for (from, to, expected) in [
            ("0 21 4", "0 21", "line 2: it ends before the rows of K"),
            ("0 21 4", "0 21 x", "line 2: `x` cannot be the rows of K"),
            ("0 21 4", "0 -21 4", "view `a.b`"),
            ("0 0 0", "0 0.1 0", "lens distortion"),
            ("12 8", "12 -8", "`-8` cannot be the height"),
            ("12 8", "", "it ends before the size"),
        ] {
            let text = CAMERA.replacen(from, to, 1);
            let message = parse_text(text.as_bytes()).err().unwrap().to_string();
            assert!(message.contains("a.b.jpg.camera"), "{message}");
            assert!(message.contains(expected), "{message}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn damaged_files_never_panic(bytes in damaged(CAMERA)) {
            if let Ok(view) = parse_text(&bytes) {
                prop_assert!(view.intrinsics.validate().is_ok());
            }
        }
    }
}
