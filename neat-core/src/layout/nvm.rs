//! The layout of a VisualSfM reconstruction: an N-View Match file, version 3.
//!
//! - the first file by name that ends with `.nvm`, in the folder itself
//! - images as the file names them, below the folder or below `images/`; `"` in a
//!   name stands for a space
//! - `hawp/NAME.json`, see [`crate::hawp_json`]
//!
//! The first line is `NVM_V3`, or `NVM_V3 FixedK fx cx fy cy [r]` where all
//! images share a known calibration. A camera is `name f qw qx qy qz X Y Z r 0`:
//! focal length, rotation camera-from-world and centre of projection, in OpenCV
//! axes. In files that start with `NVM_V3_R9T` the rotation is a matrix, row by
//! row, and the translation camera-from-world follows instead of the centre.
//! `r` is the lens, as [`Distortion::ReverseRadial`]. Images of focal length 0 have no
//! pose and are skipped.
//!
//! Measurements are relative to the principal point, which without `FixedK` is
//! the middle of the image, x to the right and y down. The corner of the image is
//! the origin: the first pixel has its centre at (0.5, 0.5).
//!
//! A file can hold several models, of which nothing relates the frames. The one
//! of most cameras is read, of several the first.

use super::images::{self, ReadSize};
use super::poses::{PosedImage, Poses, pose_of, rotation_of};
use super::reconstruction::Reconstruction;
use super::text_lines::{Line, Records, expected_records};
use crate::hawp_json::file_stem;
use crate::{Distortion, Intrinsics, Observation, SceneError, SparsePoint, file};
use nalgebra::{Matrix3, Vector2, Vector3};
use std::path::{Path, PathBuf};

const PIXEL_CENTER: f64 = 0.5;
const REMEDY: &str = "save the reconstruction with VisualSfM as NView Match (.nvm)";

/// The file of this layout in the folder `dir`, where there is one.
pub(super) fn find(dir: &Path) -> Option<PathBuf> {
    images::first_with_ending(dir, "nvm")
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let path = find(dir).unwrap_or_else(|| dir.join("reconstruction.nvm"));
    let bytes = file::read(&path, REMEDY)?;
    let dirs = [dir.into(), dir.join("images")];
    parse(&bytes, &path, &dirs, images::size_of_posed)
}

/// How a camera's pose is written.
#[derive(Clone, Copy, PartialEq)]
enum PoseFormat {
    QuaternionAndCenter,
    MatrixAndTranslation,
}

struct Header {
    pose_format: PoseFormat,
    /// The calibration that all images share, if the first line gives one.
    fixed: Option<Intrinsics>,
}

/// A model as the file has it.
struct Model<'a> {
    cameras: Vec<Camera<'a>>,
    points: Vec<Point>,
}

struct Camera<'a> {
    name: &'a str,
    focal_length: f64,
    /// What [`PoseFormat`] says.
    pose: Vec<f64>,
    radial: f64,
}

struct Point {
    position: [f64; 3],
    /// Index of the camera, and where it sees the point.
    measurements: Vec<(usize, [f64; 2])>,
}

fn parse(
    bytes: &[u8],
    path: &Path,
    dirs: &[PathBuf],
    size_of: ReadSize,
) -> Result<Poses, SceneError> {
    let mut records = expected_records(path, bytes)?;
    let header = header(records.expect("its first line, NVM_V3")?)?;
    let mut largest: Option<Model> = None;
    while let Some(mut line) = records.next() {
        let cameras = line.parse("the number of cameras")?;
        // Ends the list of models; references to PLY files follow.
        if cameras == 0 {
            break;
        }
        let model = model(&mut records, cameras, &header)?;
        let size = |model: &Model| model.cameras.len();
        if largest
            .as_ref()
            .is_none_or(|other| size(&model) > size(other))
        {
            largest = Some(model);
        }
    }
    let Some(model) = largest else {
        return Err(SceneError::NoView { path: path.into() });
    };

    let mut views = Vec::with_capacity(model.cameras.len());
    let mut principal_points = Vec::with_capacity(model.cameras.len());
    for (index, camera) in model.cameras.iter().enumerate() {
        if camera.focal_length == 0.0 {
            principal_points.push(Vector2::zeros());
            continue;
        }
        let view = posed_image(camera, &header, path, dirs, size_of)?;
        principal_points.push(Vector2::new(view.intrinsics.cx, view.intrinsics.cy));
        views.push((index, view));
    }
    let mut points = Vec::with_capacity(model.points.len());
    for point in model.points {
        let mut observations = Vec::with_capacity(point.measurements.len());
        for (view, measurement) in point.measurements {
            let Some(principal_point) = principal_points.get(view) else {
                let reason = format!(
                    "a point was measured in image {view}, but its model has {} images",
                    principal_points.len()
                );
                return Err(SceneError::malformed(path, reason));
            };
            let pixel = principal_point + Vector2::from(measurement);
            observations.push(Observation { view, pixel });
        }
        points.push(SparsePoint {
            position_in_world: Vector3::from(point.position),
            observations,
        });
    }
    let reconstruction = Reconstruction {
        path: path.into(),
        views,
        points,
        pixel_center: PIXEL_CENTER,
    };
    reconstruction.into_poses()
}

fn header(mut line: Line) -> Result<Header, SceneError> {
    let pose_format = match line.field("NVM_V3")? {
        "NVM_V3" => PoseFormat::QuaternionAndCenter,
        "NVM_V3_R9T" => PoseFormat::MatrixAndTranslation,
        other => {
            let reason = format!("it starts with `{other}`, but only NVM_V3 is read");
            return Err(line.error(&reason));
        }
    };
    if line.is_at_end() {
        let fixed = None;
        return Ok(Header { pose_format, fixed });
    }
    match line.field("FixedK")? {
        "FixedK" => {}
        other => return Err(line.error(&format!("`{other}` is no calibration, such as FixedK"))),
    }
    let [fx, cx, fy, cy] = line.numbers("FixedK fx cx fy cy")?;
    Ok(Header {
        pose_format,
        fixed: Some(Intrinsics::new(fx, fy, cx, cy)),
    })
}

fn model<'a, I: Iterator<Item = Line<'a>>>(
    records: &mut Records<'a, I>,
    camera_count: u64,
    header: &Header,
) -> Result<Model<'a>, SceneError> {
    let mut cameras = Vec::new();
    for _ in 0..camera_count {
        let line = records.expect("the last camera of a model")?;
        cameras.push(camera(&line, header.pose_format)?);
    }
    let mut line = records.expect("the number of points of a model")?;
    let point_count: u64 = line.parse("the number of points")?;
    let mut points = Vec::new();
    for _ in 0..point_count {
        points.push(point(records.expect("the last point of a model")?)?);
    }
    Ok(Model { cameras, points })
}

/// The name is what the numbers at the end leave: some programs write names with
/// spaces.
fn camera<'a>(line: &Line<'a>, pose_format: PoseFormat) -> Result<Camera<'a>, SceneError> {
    let numbers_of_pose = match pose_format {
        PoseFormat::QuaternionAndCenter => 7,
        PoseFormat::MatrixAndTranslation => 12,
    };
    let mut rest = line.rest.trim();
    let mut numbers = Vec::new();
    for _ in 0..numbers_of_pose + 3 {
        let Some((before, field)) = rest.rsplit_once(char::is_whitespace) else {
            let reason = "expected a camera: name, focal length, rotation, centre, distortion, 0";
            return Err(line.error(reason));
        };
        let Ok(number) = field.parse::<f64>() else {
            return Err(line.error(&format!("`{field}` cannot be a number of a camera")));
        };
        numbers.push(number);
        rest = before.trim_end();
    }
    numbers.reverse();
    Ok(Camera {
        name: rest,
        focal_length: numbers[0],
        pose: numbers[1..=numbers_of_pose].to_vec(),
        radial: numbers[numbers_of_pose + 1],
    })
}

fn point(mut line: Line) -> Result<Point, SceneError> {
    let position = line.numbers("a point's X, Y, Z")?;
    let _colour: [f64; 3] = line.numbers("a point's colour")?;
    let count: u64 = line.parse("the number of measurements")?;
    let mut measurements = Vec::new();
    for _ in 0..count {
        let view = line.parse("the index of an image")?;
        let _feature = line.field("the index of a feature")?;
        measurements.push((view, line.numbers("a measurement's x, y")?));
    }
    Ok(Point {
        position,
        measurements,
    })
}

fn posed_image(
    camera: &Camera,
    header: &Header,
    path: &Path,
    dirs: &[PathBuf],
    size_of: ReadSize,
) -> Result<PosedImage, SceneError> {
    let image = camera.name.trim_matches('"').replace('"', " ");
    let image = images::locate(path, dirs, &image)?;
    let name = file_stem(&image);
    let (intrinsics, size) = match header.fixed {
        Some(intrinsics) => (intrinsics, None),
        None => {
            let size = size_of(&image)?;
            (Intrinsics::centered(camera.focal_length, size), Some(size))
        }
    };
    let (rotation, center) = match header.pose_format {
        PoseFormat::QuaternionAndCenter => {
            let quaternion = [0, 1, 2, 3].map(|i| camera.pose[i]);
            let rotation = rotation_of(quaternion, path, &name)?.to_rotation_matrix();
            let center = Vector3::from_row_slice(&camera.pose[4..7]);
            (rotation.into_inner(), center)
        }
        PoseFormat::MatrixAndTranslation => {
            let rotation = Matrix3::from_row_slice(&camera.pose[..9]);
            let translation = Vector3::from_row_slice(&camera.pose[9..12]);
            (rotation, -rotation.tr_mul(&translation))
        }
    };
    Ok(PosedImage {
        name,
        image,
        intrinsics,
        distortion: Distortion::ReverseRadial { k: camera.radial },
        world_from_camera: pose_of(&rotation, &center),
        size,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use nalgebra::Matrix4;
    use proptest::prelude::*;

    /// Two models, the second of more cameras: one at the origin, one turned by 90°
    /// about z at (1, 2, 3), and one without pose.
    const NVM: &str = "NVM_V3 \n\n1\nlone.jpg 5 1 0 0 0 0 0 0 0 0\n\n0\n\n\
        3\nb.jpg\t20 2 0 0 2 1 2 3 0.25 0\nleft/a\"b.jpg 10 1 0 0 0 0 0 0 0 0\n\
        *.jpg 0 0 0 0 0 0 0 0 0 0\n\n\
        2\n1 2 8 255 0 0 2 1 17 -1.5 2 0 18 3.5 0.5\n4 5 6 0 0 0 0\n\n0\n\n#the last part\n1 0\n";

    fn parse_text(bytes: &[u8]) -> Result<Poses, SceneError> {
        let dirs = ["scene".into()];
        parse(bytes, Path::new("scene/a.nvm"), &dirs, |_| Ok((12, 8)))
    }

    #[test]
    fn the_model_of_most_cameras_is_read() {
        let poses = parse_text(NVM.as_bytes()).unwrap();
        let [a, b] = poses.views.as_slice() else {
            panic!("two views with a pose");
        };
        assert_eq!((a.name.as_str(), b.name.as_str()), ("a b", "b"));
        assert_eq!(a.image, Path::new("scene/left/a b.jpg"));
        assert_eq!(a.intrinsics, Intrinsics::centered(10.0, (12, 8)));
        assert_eq!((b.intrinsics.cx, b.intrinsics.cy), (6.0, 4.0));
        assert_eq!(a.distortion, Distortion::None);
        assert_eq!(b.distortion, Distortion::ReverseRadial { k: 0.25 });
        assert_eq!(a.world_from_camera, Matrix4::identity());
        // Camera x is world −y: the rotation camera-from-world takes x to y.
        let turned = Matrix4::new(
            0.0, 1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 1.0,
        );
        assert!((b.world_from_camera - turned).amax() < 1e-15);
        assert_eq!(poses.pixel_center, Some(0.5));
        let [first, second] = poses.points.as_slice() else {
            panic!("two points");
        };
        assert_eq!(first.position_in_world, Vector3::new(1.0, 2.0, 8.0));
        let seen = |view, x, y| Observation {
            view,
            pixel: Vector2::new(x, y),
        };
        assert_eq!(first.observations, [seen(0, 4.5, 6.0), seen(1, 9.5, 4.5)]);
        assert_eq!(second.observations, []);
    }

    #[test]
    fn a_fixed_calibration_and_matrices_are_read() {
        let fixed = NVM.replacen("NVM_V3", "NVM_V3 FixedK 20 6.5 21 4.25 0.25", 1);
        let poses = parse_text(fixed.as_bytes()).unwrap();
        let k = poses.views[0].intrinsics;
        assert_eq!([k.fx, k.fy, k.cx, k.cy], [20.0, 21.0, 6.5, 4.25]);
        assert_eq!(poses.points[0].observations[0].pixel.x, 6.5 - 1.5);

        let matrix = "NVM_V3_R9T\n1\na.jpg 5 0 -1 0 1 0 0 0 0 1 4 5 6 0 0\n0\n0\n";
        let pose = parse_text(matrix.as_bytes()).unwrap().views[0].world_from_camera;
        // −Rᵀ t with R: x to y, y to −x.
        let center = pose.fixed_view::<3, 1>(0, 3).into_owned();
        assert_eq!(center, Vector3::new(-5.0, 4.0, -6.0));
        assert_eq!((pose[(0, 1)], pose[(1, 0)]), (1.0, -1.0));
    }

    #[test]
    fn messages_name_the_line() {
        for (from, to, expected) in [
            ("NVM_V3", "NVM_V2", "starts with `NVM_V2`"),
            ("NVM_V3", "NVM_V3 Fixed", "`Fixed` is no calibration"),
            ("NVM_V3", "NVM_V3 FixedK 1 2 x", "`x` cannot be FixedK"),
            (
                "20 2 0 0 2",
                "20 2 0 zero 2",
                "line 9: `zero` cannot be a number",
            ),
            ("b.jpg\t20 ", "", "line 9: expected a camera"),
            ("20 2 0 0 2", "20 0 0 0 0", "view `b` is not a rotation"),
            ("20 2 0 0 2", "20 2 0 inf 2", "not finite"),
            ("0.25", "NaN", "not finite"),
            ("b.jpg\t20", "b.jpg\t-20", "not both positive"),
            (
                "1 17 -1.5",
                "9 17 -1.5",
                "measured in image 9, but its model has 3",
            ),
            (
                "3.5 0.5",
                "3.5",
                "line 14: it ends before a measurement's x, y",
            ),
            (
                "\n4 5 6 0 0 0 0\n\n0\n\n#the last part\n1 0\n",
                "",
                "ends before the last point",
            ),
        ] {
            assert!(NVM.contains(from), "{from}");
            let message = parse_text(NVM.replacen(from, to, 1).as_bytes())
                .err()
                .unwrap()
                .to_string();
            assert!(message.contains("a.nvm"), "{message}");
            assert!(message.contains(expected), "{message}");
        }
        let none = parse_text(b"NVM_V3\n\n0\n").err().unwrap();
        assert!(matches!(none, SceneError::NoView { .. }));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn damaged_files_never_panic(bytes in damaged(NVM)) {
            if let Ok(poses) = parse_text(&bytes) {
                prop_assert!(poses.views.iter().all(|view| view.intrinsics.validate().is_ok()));
            }
        }
    }
}
