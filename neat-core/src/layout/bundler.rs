//! The layout of a Bundler reconstruction, version 0.3.
//!
//! - `bundle.out`, else `bundle/bundle.out`
//! - `list.txt` in the folder itself, else beside the other file: one image per
//!   line, in the order of the cameras, `name` or `name 0 focal_length`
//! - images as the list names them, below the folder or below `images/`
//! - `hawp/NAME.json`, see [`crate::hawp_json`]
//!
//! A camera is `f k1 k2`, the rotation camera-from-world, row by row, and the
//! translation. Its axes are OpenGL's (x right, y up, looking along −z) and are
//! turned into OpenCV's here; `k1 k2` are [`Distortion::Brown`]. Cameras with
//! f = 0 have no pose and are skipped.
//!
//! Measurements are relative to the middle of the image, y up. The corner of the
//! image is taken for the origin: the principal point is (W/2, H/2) and the first
//! pixel has its centre at (0.5, 0.5).

use super::CameraAxes;
use super::images::{self, ReadSize};
use super::poses::{PosedImage, Poses, pose_of};
use super::reconstruction::Reconstruction;
use super::text_lines::{Line, Records, expected_records, records};
use crate::hawp_json::file_stem;
use crate::{Distortion, Intrinsics, Observation, SceneError, SparsePoint, file};
use nalgebra::{Matrix3, Vector2, Vector3};
use std::path::{Path, PathBuf};

/// In the order in which they are looked for.
const FILE_NAMES: [&str; 2] = ["bundle.out", "bundle/bundle.out"];
const LIST_NAME: &str = "list.txt";
const PIXEL_CENTER: f64 = 0.5;
const REMEDY: &str = "provide the `bundle.out` of the reconstruction";
const LIST_REMEDY: &str = "provide the list of images that Bundler was run with";

/// The file of this layout in the folder `dir`, where there is one.
pub(super) fn find(dir: &Path) -> Option<PathBuf> {
    images::first_of(dir, &FILE_NAMES)
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let path = find(dir).unwrap_or_else(|| dir.join(FILE_NAMES[0]));
    let bytes = file::read(&path, REMEDY)?;
    let lists = [dir.join(LIST_NAME), path.with_file_name(LIST_NAME)];
    let list_path = lists
        .iter()
        .find(|list| list.is_file())
        .unwrap_or(&lists[0]);
    let list = file::read(list_path, LIST_REMEDY)?;
    let images = image_names(list_path, &list)?;
    let dirs = [dir.into(), dir.join("images")];
    parse(&bytes, &path, &images, &dirs, images::size_of_posed)
}

/// The names of a list, without `0 focal_length`.
fn image_names(path: &Path, bytes: &[u8]) -> Result<Vec<String>, SceneError> {
    let name = |line: Line| {
        let whole = line.rest.trim();
        let name = whole
            .rsplit_once(char::is_whitespace)
            .filter(|(_, focal_length)| focal_length.parse::<f64>().is_ok())
            .and_then(|(before, _)| before.trim_end().strip_suffix(" 0"));
        name.unwrap_or(whole).trim_end().to_owned()
    };
    Ok(records(path, bytes)?.map(name).collect())
}

struct Camera {
    focal_length: f64,
    k1: f64,
    k2: f64,
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

fn parse(
    bytes: &[u8],
    path: &Path,
    names: &[String],
    dirs: &[PathBuf],
    size_of: ReadSize,
) -> Result<Poses, SceneError> {
    check_version(path, bytes)?;
    let mut records = expected_records(path, bytes)?;
    let mut line = records.expect("the numbers of cameras and points")?;
    let camera_count: u64 = line.parse("the number of cameras")?;
    let point_count: u64 = line.parse("the number of points")?;
    if camera_count != names.len() as u64 {
        let reason = format!(
            "it has {camera_count} cameras, but `{LIST_NAME}` names {} images",
            names.len()
        );
        return Err(SceneError::malformed(path, reason));
    }

    let mut views = Vec::new();
    let mut sizes = Vec::new();
    for (index, name) in names.iter().enumerate() {
        let camera = camera(&mut records)?;
        if camera.focal_length == 0.0 {
            sizes.push(None);
            continue;
        }
        let image = images::locate(path, dirs, name)?;
        let size = size_of(&image)?;
        sizes.push(Some(size));
        views.push((index, posed_image(&camera, image, size)));
    }
    let mut points = Vec::new();
    for _ in 0..point_count {
        points.push(point(&mut records, &sizes)?);
    }
    let reconstruction = Reconstruction {
        path: path.into(),
        views,
        points,
        pixel_center: PIXEL_CENTER,
    };
    Ok(Poses {
        file_axes: CameraAxes::OPENGL,
        ..reconstruction.into_poses()?
    })
}

/// Errs if the first line names another version. Its points would have no
/// measurements.
fn check_version(path: &Path, bytes: &[u8]) -> Result<(), SceneError> {
    let first = bytes
        .split(|&byte| byte == b'\n')
        .next()
        .unwrap_or_default();
    let first = String::from_utf8_lossy(first);
    match first.trim_end().strip_prefix("# Bundle file ") {
        Some(version) if version != "v0.3" => Err(SceneError::malformed(
            path,
            format!("it is of the version {version}, but only v0.3 is read"),
        )),
        _ => Ok(()),
    }
}

fn camera<'a, I: Iterator<Item = Line<'a>>>(
    records: &mut Records<'a, I>,
) -> Result<Camera, SceneError> {
    const WHAT: &str = "the last camera";
    let [focal_length, k1, k2] = records.expect(WHAT)?.numbers("f, k1, k2")?;
    let mut rotation = Matrix3::zeros();
    for row in 0..3 {
        let numbers: [f64; 3] = records.expect(WHAT)?.numbers("a row of a rotation")?;
        rotation.set_row(row, &Vector3::from(numbers).transpose());
    }
    let translation: [f64; 3] = records.expect(WHAT)?.numbers("a translation")?;
    Ok(Camera {
        focal_length,
        k1,
        k2,
        rotation,
        translation: Vector3::from(translation),
    })
}

fn posed_image(camera: &Camera, image: PathBuf, size: (u32, u32)) -> PosedImage {
    // camera = R · world + t, so the centre of the camera is −Rᵀ t.
    let center = -camera.rotation.tr_mul(&camera.translation);
    // y and z of the camera change their signs from OpenGL to OpenCV.
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    PosedImage {
        name: file_stem(&image),
        image,
        intrinsics: Intrinsics::centered(camera.focal_length, size),
        distortion: Distortion::brown(&[camera.k1, camera.k2], [0.0; 2]),
        world_from_camera: pose_of(&(flip * camera.rotation), &center),
        size: Some(size),
    }
}

/// A point, seen by images of the given sizes; those without pose have none.
fn point<'a, I: Iterator<Item = Line<'a>>>(
    records: &mut Records<'a, I>,
    sizes: &[Option<(u32, u32)>],
) -> Result<SparsePoint, SceneError> {
    const WHAT: &str = "the last point";
    let position: [f64; 3] = records.expect(WHAT)?.numbers("a point")?;
    let _colour: [f64; 3] = records.expect(WHAT)?.numbers("a colour")?;
    let mut line = records.expect(WHAT)?;
    let count: u64 = line.parse("the number of views of a point")?;
    let mut observations = Vec::new();
    for _ in 0..count {
        let view: usize = line.parse("the index of a camera")?;
        let _key = line.field("the index of a key point")?;
        let [x, y] = line.numbers("a measurement's x, y")?;
        let Some(size) = sizes.get(view) else {
            let reason = format!("camera {view} sees a point, but there are {}", sizes.len());
            return Err(line.error(&reason));
        };
        if let Some((width, height)) = *size {
            let middle = Vector2::new(f64::from(width), f64::from(height)) / 2.0;
            let pixel = middle + Vector2::new(x, -y);
            observations.push(Observation { view, pixel });
        }
    }
    Ok(SparsePoint {
        position_in_world: Vector3::from(position),
        observations,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use nalgebra::Matrix4;
    use proptest::prelude::*;

    /// A camera that looks along +z from (0, 0, −4), one without pose, and one that
    /// looks along −z from (1, 2, 3).
    const BUNDLE: &str = "# Bundle file v0.3\n3 2\n\
        10 0.1 -0.2\n-1 0 0\n0 1 0\n0 0 -1\n0 0 -4\n\
        0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n\
        20 0 0\n1 0 0\n0 1 0\n0 0 1\n-1 -2 -3\n\
        1 0.5 0\n255 0 0\n3 0 7 -2.5 1.25 1 8 0 0 2 9 3 -1\n4 5 6\n0 0 0\n0\n";

    fn names() -> Vec<String> {
        ["z/b.jpg", "none.jpg", "a.jpg"].map(String::from).to_vec()
    }

    fn parse_text(bytes: &[u8]) -> Result<Poses, SceneError> {
        let dirs = ["scene".into()];
        let path = Path::new("scene/bundle.out");
        parse(bytes, path, &names(), &dirs, |_| Ok((12, 8)))
    }

    #[test]
    fn axes_are_opencv_and_y_is_down() {
        let poses = parse_text(BUNDLE.as_bytes()).unwrap();
        let [a, b] = poses.views.as_slice() else {
            panic!("two views with a pose");
        };
        assert_eq!((a.name.as_str(), b.name.as_str()), ("a", "b"));
        assert_eq!(b.image, Path::new("scene/z/b.jpg"));
        let diagonal = |x, y, z| Matrix4::from_diagonal(&nalgebra::Vector4::new(x, y, z, 1.0));
        // It looked along −z with y up: y and z change their signs.
        let expected = diagonal(1.0, -1.0, -1.0).append_translation(&Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(a.world_from_camera, expected);
        let expected = diagonal(-1.0, -1.0, 1.0).append_translation(&Vector3::new(0.0, 0.0, -4.0));
        assert_eq!(b.world_from_camera, expected);
        assert_eq!(a.distortion, Distortion::None);
        let lens = Distortion::Brown {
            radial: [0.1, -0.2, 0.0, 0.0, 0.0, 0.0],
            tangential: [0.0; 2],
        };
        assert_eq!(b.distortion, lens);
        // 1 left of the camera, 0.5 above, 4 ahead: up to distortion −2.5 and 1.25
        // from the middle with y up.
        let camera = crate::Camera::from_matrices(b.intrinsics, &b.world_from_camera, 12, 8);
        let point = &poses.points[0];
        assert_eq!(
            camera.project(&point.position_in_world).pixel,
            point.observations[0].pixel
        );
        let seen = |view, x, y| Observation {
            view,
            pixel: Vector2::new(x, y),
        };
        assert_eq!(point.observations, [seen(1, 3.5, 2.75), seen(0, 9.0, 5.0)]);
        assert_eq!(poses.pixel_center, Some(0.5));
    }

    #[test]
    fn lists_name_images_with_and_without_focal_length() {
        let list = b"./a b.jpg 0 660.8\nc.jpg\n\nd 0.jpg\ne.jpg 0 12\r\n2 3.jpg\n";
        let names = image_names(Path::new("list.txt"), list).unwrap();
        assert_eq!(names, ["./a b.jpg", "c.jpg", "d 0.jpg", "e.jpg", "2 3.jpg"]);
    }

    #[test]
    fn messages_name_what_is_wrong() {
        for (from, to, expected) in [
            ("v0.3", "v0.1", "version v0.1"),
            ("3 2", "4 2", "4 cameras, but `list.txt` names 3"),
            ("10 0.1", "x 0.1", "line 3: `x` cannot be f, k1, k2"),
            ("10 0.1", "-10 0.1", "not both positive"),
            ("10 0.1", "10 inf", "not finite"),
            (
                "2 9 3",
                "3 9 3",
                "line 20: camera 3 sees a point, but there are 3",
            ),
            (
                "9 3 -1",
                "9 3",
                "line 20: it ends before a measurement's x, y",
            ),
            ("4 5 6", "4 5 nan", "a point is not finite"),
            ("\n4 5 6\n0 0 0\n0\n", "", "it ends before the last point"),
        ] {
            assert!(BUNDLE.contains(from), "{from}");
            let text = BUNDLE.replacen(from, to, 1);
            let message = parse_text(text.as_bytes()).err().unwrap().to_string();
            assert!(message.contains("bundle.out"), "{message}");
            assert!(message.contains(expected), "{message}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn damaged_files_never_panic(bytes in damaged(BUNDLE), list in damaged("a.jpg 0 5\nb c.jpg\n")) {
            if let Ok(poses) = parse_text(&bytes) {
                prop_assert!(poses.views.iter().all(|view| view.intrinsics.validate().is_ok()));
            }
            let _ = image_names(Path::new("list.txt"), &list);
        }
    }
}
