//! The layout in which one JSON file names every image and its camera.
//!
//! `cameras.json`: `{"frames": [{"file": "images/a.png", "width": w, "height": h,
//! "K": 3×3, "c2w": 4×4}, …], "scale_mat": 4×4}`. Poses are camera-to-world in
//! OpenCV axes; the optional `scale_mat` leads from the world, whose unit ball holds
//! the object, to the original frame. Other keys are ignored.

use super::images;
use super::poses::{PosedImage, Poses, similarity_of};
use crate::hawp_json::file_stem;
use crate::{Distortion, Intrinsics, SceneError, Similarity, file};
use nalgebra::{Matrix3, Matrix4};
use serde::Deserialize;
use std::path::Path;

pub(super) const FILE_NAME: &str = "cameras.json";

#[derive(Deserialize)]
struct CamerasJson {
    frames: Vec<Frame>,
    scale_mat: Option<[[f64; 4]; 4]>,
}

#[derive(Deserialize)]
struct Frame {
    file: String,
    width: u32,
    height: u32,
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    c2w: [[f64; 4]; 4],
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let path = dir.join(FILE_NAME);
    parse(&file::read(&path, "provide the poses of the images")?, dir)
}

fn parse(bytes: &[u8], dir: &Path) -> Result<Poses, SceneError> {
    let path = dir.join(FILE_NAME);
    let json: CamerasJson = file::parse_json(bytes, &path, "list of cameras")?;
    // Who normalised the world did so for the unit ball.
    let declared_radius = json.scale_mat.is_some().then_some(1.0);
    let original_from_world = json.scale_mat.map_or(Ok(Similarity::identity()), |rows| {
        similarity_of(&path, &Matrix4::from(rows).transpose())
    })?;
    let mut views = Vec::with_capacity(json.frames.len());
    for frame in json.frames {
        let name = file_stem(Path::new(&frame.file));
        // `From` takes the inner arrays for columns.
        let k = Matrix3::from(frame.k).transpose();
        let intrinsics = Intrinsics::try_from_matrix(&k)
            .map_err(|problem| SceneError::view(&path, &name, problem))?;
        views.push(PosedImage {
            image: images::locate(&path, &[dir.into()], &frame.file)?,
            name,
            intrinsics,
            distortion: Distortion::None,
            world_from_camera: Matrix4::from(frame.c2w).transpose(),
            size: Some((frame.width, frame.height)),
        });
    }
    Ok(Poses {
        original_from_world,
        declared_radius,
        ..Poses::new(&path, views)?
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use proptest::prelude::*;

    const ONE_FRAME: &str = r#"{"frames": [{"file": "images/a.png", "width": 4, "height": 3,
        "K": [[5, 0, 2], [0, 6, 1.5], [0, 0, 1]],
        "c2w": [[1, 0, 0, 7], [0, 1, 0, 8], [0, 0, 1, 9], [0, 0, 0, 1]]}],
        "scale_mat": [[2, 0, 0, 10], [0, 2, 0, 20], [0, 0, 2, 30], [0, 0, 0, 1]],
        "convention": "ignored"}"#;

    #[test]
    fn matrices_are_read_row_by_row() {
        let poses = parse(ONE_FRAME.as_bytes(), Path::new("scene")).unwrap();
        let view = &poses.views[0];
        assert_eq!(view.name, "a");
        assert_eq!((view.intrinsics.fy, view.intrinsics.cx), (6.0, 2.0));
        assert_eq!(view.world_from_camera[(1, 3)], 8.0);
        assert_eq!(poses.original_from_world.scale, 2.0);
        assert_eq!(poses.original_from_world.translation.z, 30.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn truncated_and_damaged_files_are_errors_not_panics(
            end in 0..ONE_FRAME.len(), bytes in damaged(ONE_FRAME),
        ) {
            prop_assert!(parse(&ONE_FRAME.as_bytes()[..end], Path::new("scene")).is_err());
            if let Ok(poses) = parse(&bytes, Path::new("scene")) {
                prop_assert!(poses.views.iter().all(|view| view.intrinsics.validate().is_ok()));
            }
        }
    }
}
