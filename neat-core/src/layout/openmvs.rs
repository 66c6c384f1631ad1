//! The layout of OpenMVS: a scene in its interface format, `MVSI`.
//!
//! - `scene.mvs`, else the first file by name that ends with `.mvs`
//! - images as the file names them, below the folder or below `images/`
//! - `hawp/NAME.json`, see [`crate::hawp_json`]
//!
//! Versions 1 to 7 are read up to the points; what follows (normals, colours,
//! lines, bounds) is not. A camera is mounted on a platform, which has poses;
//! both are rotations and centres, camera-from-platform and platform-from-world,
//! in OpenCV axes. Images are undistorted. Where a camera gives no resolution, its
//! K is divided by the larger side of the image. Images without a pose are
//! skipped.
//!
//! Integer coordinates are the centres of pixels. A point has the images that see
//! it, but not where: its observations are at its projections, which says which
//! views see it and nothing about the error of the reconstruction.

use super::binary_reader::BinaryReader;
use super::images::{self, ReadSize};
use super::poses::{PosedImage, Poses, pose_of};
use super::reconstruction::Reconstruction;
use crate::hawp_json::file_stem;
use crate::{Camera, Distortion, Intrinsics, Observation, SceneError, SparsePoint, file};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const FILE_NAME: &str = "scene.mvs";
const MAGIC: &[u8; 4] = b"MVSI";
const VERSIONS: std::ops::RangeInclusive<u32> = 1..=7;
const PIXEL_CENTER: f64 = 0.0;
const REMEDY: &str = "provide the scene in the interface format of OpenMVS (.mvs)";
/// The pose of an image that has none.
const NO_ID: u32 = u32::MAX;
/// How another image relates to one: two integers and four floats.
const VIEW_SCORE_BYTES: u64 = 24;
/// Number of an image and a confidence.
const VERTEX_VIEW_BYTES: u64 = 8;

/// The file of this layout in the folder `dir`, where there is one.
pub(super) fn find(dir: &Path) -> Option<PathBuf> {
    let usual = dir.join(FILE_NAME);
    if usual.is_file() {
        Some(usual)
    } else {
        images::first_with_ending(dir, "mvs")
    }
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let path = find(dir).unwrap_or_else(|| dir.join(FILE_NAME));
    let bytes = file::read(&path, REMEDY)?;
    let dirs = [dir.into(), dir.join("images")];
    parse(&bytes, &path, &dirs, images::size_of_posed)
}

struct Platform {
    cameras: Vec<MountedCamera>,
    poses: Vec<Pose>,
}

struct MountedCamera {
    /// Width and height; K is in pixels where they are given.
    size: Option<(u32, u32)>,
    k: Matrix3<f64>,
    mount: Pose,
}

/// A rotation into a frame, and the frame's origin in the frame before.
struct Pose {
    rotation: Matrix3<f64>,
    center: Vector3<f64>,
}

struct Image {
    name: String,
    platform: u32,
    camera: u32,
    pose: u32,
}

fn parse(
    bytes: &[u8],
    path: &Path,
    dirs: &[PathBuf],
    size_of: ReadSize,
) -> Result<Poses, SceneError> {
    let mut reader = BinaryReader::new(path, bytes);
    let version = version(&mut reader, path)?;
    let platforms = list(&mut reader, "a platform", |reader| {
        platform(reader, version)
    })?;
    let images = list(&mut reader, "an image", |reader| image(reader, version))?;
    let vertices = list(&mut reader, "a point", vertex)?;

    let mut views = Vec::new();
    let mut cameras = BTreeMap::new();
    for (index, image) in images.iter().enumerate() {
        if image.pose == NO_ID {
            continue;
        }
        let view = posed_image(image, &platforms, path, dirs, size_of)?;
        // The size does not matter where points project to.
        let camera = Camera::from_matrices(view.intrinsics, &view.world_from_camera, 0, 0);
        cameras.insert(index, camera);
        views.push((index, view));
    }
    let points = (vertices.into_iter())
        .map(|(position, seen_by)| {
            let observation = |image: u32| {
                let view = image as usize;
                let seen = cameras.get(&view)?.project(&position);
                let pixel = seen.pixel;
                (seen.depth > 0.0).then_some(Observation { view, pixel })
            };
            SparsePoint {
                position_in_world: position,
                observations: seen_by.into_iter().filter_map(observation).collect(),
            }
        })
        .collect();
    let reconstruction = Reconstruction {
        path: path.into(),
        views,
        points,
        pixel_center: PIXEL_CENTER,
    };
    reconstruction.into_poses()
}

fn version(reader: &mut BinaryReader, path: &Path) -> Result<u32, SceneError> {
    let what = "the header";
    let magic: [u8; 4] = reader.take(what)?;
    if &magic != MAGIC {
        let reason = "it does not start with MVSI: it is a project of OpenMVS and not in its \
                      interface format, or no scene; export the cameras again with an \
                      `Interface…` program of OpenMVS";
        return Err(SceneError::malformed(path, reason));
    }
    let version = reader.u32(what)?;
    if !VERSIONS.contains(&version) {
        let reason = format!("it is of version {version}, but only 1 to 7 are known");
        return Err(SceneError::malformed(path, reason));
    }
    let _reserved = reader.u32(what)?;
    Ok(version)
}

/// As many records as a number before them says; it is not trusted.
fn list<'a, T>(
    reader: &mut BinaryReader<'a>,
    what: &str,
    mut read: impl FnMut(&mut BinaryReader<'a>) -> Result<T, SceneError>,
) -> Result<Vec<T>, SceneError> {
    let count = reader.u64(what)?;
    let mut records = Vec::new();
    for _ in 0..count {
        records.push(read(reader)?);
    }
    Ok(records)
}

fn platform(reader: &mut BinaryReader, version: u32) -> Result<Platform, SceneError> {
    let what = "a platform";
    let _name = reader.counted_text(what)?;
    let cameras = list(reader, what, |reader| {
        let what = "a camera";
        let _name = reader.counted_text(what)?;
        if version > 3 {
            let _band = reader.counted_text(what)?;
        }
        let (width, height) = (reader.u32(what)?, reader.u32(what)?);
        Ok(MountedCamera {
            size: (width > 0 && height > 0).then_some((width, height)),
            k: matrix(reader, what)?,
            mount: pose(reader)?,
        })
    })?;
    let poses = list(reader, what, pose)?;
    Ok(Platform { cameras, poses })
}

fn matrix(reader: &mut BinaryReader, what: &str) -> Result<Matrix3<f64>, SceneError> {
    let rows: [f64; 9] = reader.numbers(what)?;
    Ok(Matrix3::from_row_slice(&rows))
}

fn pose(reader: &mut BinaryReader) -> Result<Pose, SceneError> {
    let what = "a pose";
    Ok(Pose {
        rotation: matrix(reader, what)?,
        center: Vector3::from(reader.numbers(what)?),
    })
}

fn image(reader: &mut BinaryReader, version: u32) -> Result<Image, SceneError> {
    let what = "an image";
    let name = reader.counted_text(what)?;
    if version > 4 {
        let _mask = reader.counted_text(what)?;
    }
    let (platform, camera, pose) = (reader.u32(what)?, reader.u32(what)?, reader.u32(what)?);
    if version > 2 {
        let _global_id = reader.u32(what)?;
    }
    if version > 6 {
        for _depth in ["smallest", "average", "largest"] {
            let _ = reader.f32(what)?;
        }
        let scores = reader.u64(what)?;
        reader.records(scores, VIEW_SCORE_BYTES, what)?;
    }
    Ok(Image {
        name,
        platform,
        camera,
        pose,
    })
}

/// Where a point is, and the images that see it.
fn vertex(reader: &mut BinaryReader) -> Result<(Vector3<f64>, Vec<u32>), SceneError> {
    let what = "a point";
    let mut position = Vector3::zeros();
    for coordinate in &mut position {
        *coordinate = f64::from(reader.f32(what)?);
    }
    let views = reader.u64(what)?;
    let views = reader.records(views, VERTEX_VIEW_BYTES, what)?;
    let (numbers, _) = views.as_chunks();
    let images = numbers
        .iter()
        .step_by(2)
        .map(|&number| u32::from_le_bytes(number));
    Ok((position, images.collect()))
}

fn posed_image(
    image: &Image,
    platforms: &[Platform],
    path: &Path,
    dirs: &[PathBuf],
    size_of: ReadSize,
) -> Result<PosedImage, SceneError> {
    let located = images::locate(path, dirs, &image.name)?;
    let name = file_stem(&located);
    let platform = platforms.get(image.platform as usize);
    let camera = platform.and_then(|platform| platform.cameras.get(image.camera as usize));
    let pose = platform.and_then(|platform| platform.poses.get(image.pose as usize));
    let (Some(camera), Some(pose)) = (camera, pose) else {
        let reason = format!("view `{name}` names a camera or a pose that is not in the file");
        return Err(SceneError::malformed(path, reason));
    };
    let size = camera.size.map_or_else(|| size_of(&located), Ok)?;
    let pixels = match camera.size {
        Some(_) => 1.0,
        None => f64::from(size.0.max(size.1)),
    };
    let scale = Matrix3::from_diagonal(&Vector3::new(pixels, pixels, 1.0));
    let intrinsics = Intrinsics::try_from_matrix(&(scale * camera.k))
        .map_err(|problem| SceneError::view(path, &name, problem))?;
    // From the world to the platform, then to the camera on it.
    let rotation = camera.mount.rotation * pose.rotation;
    let center = pose.rotation.tr_mul(&camera.mount.center) + pose.center;
    Ok(PosedImage {
        name,
        image: located,
        intrinsics,
        distortion: Distortion::None,
        world_from_camera: pose_of(&rotation, &center),
        size: Some(size),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use nalgebra::Matrix4;
    use proptest::prelude::*;

    /// Rotations about z and x by 90°, row by row: x to y, and y to z.
    const ABOUT_Z: [f64; 9] = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    const ABOUT_X: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0];

    fn text(bytes: &mut Vec<u8>, text: &str) {
        bytes.extend((text.len() as u64).to_le_bytes());
        bytes.extend(text.as_bytes());
    }

    fn numbers(bytes: &mut Vec<u8>, numbers: &[f64]) {
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    }

    /// A platform of two cameras, of which the second is normalised and mounted
    /// askew; three images, of which the last has no pose; one point.
    fn scene(version: u32) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([version, 0].map(u32::to_le_bytes).concat());
        bytes.extend(1u64.to_le_bytes());
        text(&mut bytes, "platform");
        bytes.extend(2u64.to_le_bytes());
        for (size, k, mount, center) in [
            (
                [12u32, 8],
                [20.0, 0.5, 6.5, 0.0, 21.0, 4.0, 0.0, 0.0, 1.0],
                [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
                [0.0; 3],
            ),
            (
                [0, 0],
                [1.25, 0.0, 0.5, 0.0, 1.5, 0.25, 0.0, 0.0, 1.0],
                ABOUT_X,
                [1.0, 2.0, 3.0],
            ),
        ] {
            text(&mut bytes, "camera");
            if version > 3 {
                text(&mut bytes, "RGB");
            }
            bytes.extend(size.map(u32::to_le_bytes).concat());
            numbers(&mut bytes, &k);
            numbers(&mut bytes, &mount);
            numbers(&mut bytes, &center);
        }
        bytes.extend(1u64.to_le_bytes());
        numbers(&mut bytes, &ABOUT_Z);
        numbers(&mut bytes, &[10.0, 20.0, 30.0]);

        bytes.extend(3u64.to_le_bytes());
        for (name, camera, pose) in [("images/b.jpg", 0, 0), ("a.jpg", 1, 0), ("c.jpg", 0, NO_ID)] {
            text(&mut bytes, name);
            if version > 4 {
                text(&mut bytes, "mask.png");
            }
            bytes.extend([0, camera, pose].map(u32::to_le_bytes).concat());
            if version > 2 {
                bytes.extend(7u32.to_le_bytes());
            }
            if version > 6 {
                bytes.extend([0; 12]);
                bytes.extend(1u64.to_le_bytes());
                bytes.extend([1; 24]);
            }
        }
        bytes.extend(1u64.to_le_bytes());
        bytes.extend([11.0f32, 20.0, 35.0].map(f32::to_le_bytes).concat());
        bytes.extend(3u64.to_le_bytes());
        for image in [2u32, 0, 1] {
            bytes.extend(image.to_le_bytes());
            bytes.extend(0.5f32.to_le_bytes());
        }
        // Normals and what else follows.
        bytes.extend([0; 40]);
        bytes
    }

    fn parse_bytes(bytes: &[u8]) -> Result<Poses, SceneError> {
        let dirs = ["scene".into()];
        parse(bytes, Path::new("scene/scene.mvs"), &dirs, |_| Ok((8, 16)))
    }

    #[test]
    fn platforms_cameras_and_points_of_all_versions_are_read() {
        for version in VERSIONS {
            let poses = parse_bytes(&scene(version)).unwrap();
            let [a, b] = poses.views.as_slice() else {
                panic!("two views with a pose");
            };
            assert_eq!((a.name.as_str(), b.name.as_str()), ("a", "b"));
            assert_eq!(b.image, Path::new("scene/images/b.jpg"));
            assert_eq!((a.size, b.size), (Some((8, 16)), Some((12, 8))));
            assert_eq!((b.intrinsics.fx, b.intrinsics.skew), (20.0, 0.5));
            let k = a.intrinsics;
            assert_eq!([k.fx, k.fy, k.cx, k.cy], [20.0, 24.0, 8.0, 4.0]);

            // camera = R_z (world − c): camera x is world −y, camera y world x.
            let turned = Matrix4::new(
                0.0, 1.0, 0.0, 10.0, -1.0, 0.0, 0.0, 20.0, 0.0, 0.0, 1.0, 30.0, 0.0, 0.0, 0.0, 1.0,
            );
            assert_eq!(b.world_from_camera, turned);
            // (1, 2, 3) of the platform is at (2, −1, 3) from its centre.
            let center = a.world_from_camera.fixed_view::<3, 1>(0, 3).into_owned();
            assert_eq!(center, Vector3::new(12.0, 19.0, 33.0));
            // Through both rotations, its forward direction is +z.
            let forward = a.world_from_camera.fixed_view::<3, 1>(0, 2).into_owned();
            let rotation = Matrix3::from_row_slice(&ABOUT_X) * Matrix3::from_row_slice(&ABOUT_Z);
            assert_eq!(rotation * forward, Vector3::z());

            assert_eq!(poses.pixel_center, Some(0.0));
            // (1, 0, 5) from the centre is (0, 1, 5) in the camera of b.
            let point = &poses.points[0];
            assert_eq!(point.position_in_world, Vector3::new(11.0, 20.0, 35.0));
            let seen = point.observations.iter().find(|seen| seen.view == 1);
            let pixel = seen.unwrap().pixel;
            assert!((pixel.x - 6.6).abs() < 1e-12 && (pixel.y - 8.2).abs() < 1e-12);
        }
    }

    #[test]
    fn messages_name_what_is_wrong() {
        let with = |at: usize, new: &[u8]| {
            let mut bytes = scene(3);
            bytes[at..at + new.len()].copy_from_slice(new);
            parse_bytes(&bytes).err().unwrap().to_string()
        };
        assert!(with(3, b"\0").contains("does not start with MVSI"));
        assert!(with(4, &[8]).contains("version 8, but only 1 to 7"));
        assert!(with(4, &[0]).contains("version 0"));
        assert!(with(12, &[0xff; 8]).contains("it ends within"));
        let bytes = scene(3);
        let at = bytes.windows(5).position(|name| name == b"a.jpg").unwrap() + 5;
        for (offset, what) in [(0, "platform"), (4, "camera"), (8, "pose")] {
            let message = with(at + offset, &[9]);
            assert!(
                message.contains("view `a` names a camera or a pose"),
                "{what}: {message}"
            );
        }
        let k = bytes
            .windows(8)
            .position(|x| x == 21f64.to_le_bytes())
            .unwrap();
        let message = with(k, &(-21f64).to_le_bytes());
        assert!(
            message.contains("view `b`") && message.contains("positive"),
            "{message}"
        );
        for end in 0..bytes.len() - 40 {
            let message = parse_bytes(&bytes[..end]).err().unwrap().to_string();
            assert!(message.contains("it ends within"), "{message}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn damaged_files_never_panic(bytes in VERSIONS.prop_flat_map(|version| damaged(scene(version)))) {
            if let Ok(poses) = parse_bytes(&bytes) {
                prop_assert!(poses.views.iter().all(|view| view.intrinsics.validate().is_ok()));
            }
        }
    }
}
