//! The layout of sdfstudio and EMAP.
//!
//! - `meta_data.json`: `{"camera_model": "OPENCV", "width": w, "height": h,
//!   "worldtogt": 4×4, "frames": [{"rgb_path": "0_colors.png", "camtoworld": 4×4,
//!   "intrinsics": 3×3 or 4×4}, …]}`
//! - images as the frames name them, below the folder, below `images/` or below
//!   EMAP's `color/`
//! - `hawp/NAME.json`, see [`crate::hawp_json`]
//!
//! Poses are camera-to-world in OpenCV axes. `worldtogt`, which may be missing,
//! leads from the world to the original frame: a scale and a translation. Images
//! are undistorted. Other keys, such as `scene_box`, are ignored.

use super::images;
use super::poses::{PosedImage, Poses, similarity_of};
use crate::hawp_json::file_stem;
use crate::{Distortion, Intrinsics, SceneError, Similarity, file};
use nalgebra::Matrix4;
use serde::Deserialize;
use std::path::{Path, PathBuf};

pub(super) const FILE_NAME: &str = "meta_data.json";

/// Camera models that sdfstudio takes for pinholes; the files have no place for
/// coefficients.
const PINHOLES: [&str; 5] = [
    "OPENCV",
    "PINHOLE",
    "SIMPLE_PINHOLE",
    "RADIAL",
    "SIMPLE_RADIAL",
];

#[derive(Deserialize)]
struct MetaData {
    camera_model: Option<String>,
    width: Option<u32>,
    height: Option<u32>,
    worldtogt: Option<[[f64; 4]; 4]>,
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    rgb_path: String,
    camtoworld: [[f64; 4]; 4],
    /// Checked by hand: 3×3 or 4×4.
    intrinsics: Vec<Vec<f64>>,
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let path = dir.join(FILE_NAME);
    let bytes = file::read(&path, "provide the poses of the images")?;
    let dirs = [dir.into(), dir.join("images"), dir.join("color")];
    parse(&bytes, &path, &dirs)
}

fn parse(bytes: &[u8], path: &Path, dirs: &[PathBuf]) -> Result<Poses, SceneError> {
    let json: MetaData = file::parse_json(bytes, path, "sdfstudio scene")?;
    if let Some(model) = &json.camera_model
        && !PINHOLES.contains(&model.to_uppercase().as_str())
    {
        let reason = format!("its camera model `{model}` is not read: undistort the images first");
        return Err(SceneError::malformed(path, reason));
    }
    // `From` takes the inner arrays for columns.
    let original_from_world = json.worldtogt.map_or(Ok(Similarity::identity()), |rows| {
        similarity_of(path, &Matrix4::from(rows).transpose())
    })?;
    let mut views = Vec::with_capacity(json.frames.len());
    for frame in &json.frames {
        let image = images::locate(path, dirs, &frame.rgb_path)?;
        let name = file_stem(&image);
        views.push(PosedImage {
            image,
            intrinsics: intrinsics(frame, path, &name)?,
            distortion: Distortion::None,
            world_from_camera: Matrix4::from(frame.camtoworld).transpose(),
            size: json.width.zip(json.height),
            name,
        });
    }
    Ok(Poses {
        original_from_world,
        ..Poses::new(path, views)?
    })
}

fn intrinsics(frame: &Frame, path: &Path, name: &str) -> Result<Intrinsics, SceneError> {
    let rows = &frame.intrinsics;
    let side = rows.len();
    if !(3..=4).contains(&side) || rows.iter().any(|row| row.len() != side) {
        let reason = format!("the `intrinsics` of view `{name}` are not 3×3 or 4×4 numbers");
        return Err(SceneError::malformed(path, reason));
    }
    let k = nalgebra::Matrix3::from_fn(|row, column| rows[row][column]);
    Intrinsics::try_from_matrix(&k).map_err(|problem| SceneError::view(path, name, problem))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use proptest::prelude::*;

    const TWO_FRAMES: &str = r#"{"camera_model": "OPENCV", "height": 8, "width": 12,
        "worldtogt": [[2, 0, 0, 10], [0, 2, 0, 20], [0, 0, 2, 30], [0, 0, 0, 1]],
        "scene_box": {"aabb": [[-1, -1, -1], [1, 1, 1]], "near": 0.5}, "has_mono_prior": false,
        "frames": [{"rgb_path": "b.png", "intrinsics": [[20, 0.5, 6], [0, 21, 4], [0, 0, 1]],
            "camtoworld": [[0, 1, 0, 7], [-1, 0, 0, 8], [0, 0, 1, 9], [0, 0, 0, 1]]},
        {"rgb_path": "a.png", "sensor_depth_path": null,
            "intrinsics": [[10, 0, 5.5, 0], [0, 10, 3.5, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
            "camtoworld": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]}]}"#;

    fn parse_text(text: &[u8]) -> Result<Poses, SceneError> {
        parse(text, Path::new("scene/meta_data.json"), &["scene".into()])
    }

    #[test]
    fn poses_are_read_as_they_are() {
        let poses = parse_text(TWO_FRAMES.as_bytes()).unwrap();
        let [a, b] = poses.views.as_slice() else {
            panic!("two views");
        };
        assert_eq!((a.name.as_str(), b.name.as_str()), ("a", "b"));
        assert_eq!(b.image, Path::new("scene/b.png"));
        assert_eq!((a.size, a.intrinsics.cx), (Some((12, 8)), 5.5));
        let k = b.intrinsics;
        assert_eq!(
            [k.fx, k.skew, k.cx, k.fy, k.cy],
            [20.0, 0.5, 6.0, 21.0, 4.0]
        );
        assert_eq!(
            (b.world_from_camera[(0, 1)], b.world_from_camera[(1, 3)]),
            (1.0, 8.0)
        );
        assert_eq!(poses.original_from_world.scale, 2.0);
        assert_eq!(poses.original_from_world.translation.y, 20.0);
        assert_eq!(poses.pixel_center, None);
    }

    #[test]
    fn messages_name_the_view() {
        for (from, to, expected) in [
            ("OPENCV", "OPENCV_FISHEYE", "`OPENCV_FISHEYE` is not read"),
            (
                "[0, 21, 4]",
                "[0, 21]",
                "`intrinsics` of view `b` are not 3×3",
            ),
            ("[0, 21, 4]", "[0, -21, 4]", "view `b`"),
            ("[0, 0, 2, 30]", "[0, 0, 3, 30]", "scale matrix"),
            ("a.png", "b.png", "`b` appears twice"),
            ("a.png", "/", "names no image"),
            ("9]", "]", "not a valid sdfstudio scene"),
        ] {
            assert!(TWO_FRAMES.contains(from), "{from}");
            let text = TWO_FRAMES.replacen(from, to, 1);
            let message = parse_text(text.as_bytes()).err().unwrap().to_string();
            assert!(message.contains("meta_data.json"), "{message}");
            assert!(message.contains(expected), "{message}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn damaged_files_never_panic(bytes in damaged(TWO_FRAMES)) {
            if let Ok(poses) = parse_text(&bytes) {
                prop_assert!(poses.views.iter().all(|view| view.intrinsics.validate().is_ok()));
            }
        }
    }
}
