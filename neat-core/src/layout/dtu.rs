//! The layout of DTU and BlendedMVS scenes as IDR, VolSDF and NeuS store them.
//!
//! - `image/NAME.png` (or `images/`)
//! - `hawp/NAME.json`, see [`crate::hawp_json`]
//! - `cameras_sphere.npz`, else `cameras.npz`: for the i-th image by sorted name, `world_mat_i` [4, 4], the
//!   projection of the original frame, and `scale_mat_i` [4, 4], which leads from
//!   the normalised world to the original frame. Where both files are there, the
//!   first is read, as NeuS does: its world is normalised to a sphere around the
//!   object. `pixel_center` [] is read as in [`super::abc`]; other arrays, such as
//!   `camera_mat_i`, are ignored.

use super::images;
use super::poses::{
    CAMERAS_NPZ, NPZ_REMEDY, PosedImage, Poses, check_counts, matrix4, read_pixel_center,
    similarity_of, upper_left,
};
use crate::hawp_json::file_stem;
use crate::npz::NpzReader;
use crate::{CameraError, Distortion, Intrinsics, SceneError};
use nalgebra::{Matrix3, Matrix4};
use std::path::{Path, PathBuf};

/// `scale_mat` is made so that the unit ball holds the object.
const DECLARED_RADIUS: f64 = 1.0;
/// In the order in which they are looked for.
const FILE_NAMES: [&str; 2] = ["cameras_sphere.npz", CAMERAS_NPZ];
const IMAGES_DIRS: [&str; 2] = ["image", "images"];

pub(crate) fn world_mat(index: usize) -> String {
    format!("world_mat_{index}")
}

pub(crate) fn scale_mat(index: usize) -> String {
    format!("scale_mat_{index}")
}

/// The files of this layout that the folder `dir` may hold.
pub(super) fn candidates(dir: &Path) -> [PathBuf; 2] {
    FILE_NAMES.map(|name| dir.join(name))
}

/// Whether the arrays are those of this layout.
pub(super) fn is_in(npz: &NpzReader) -> bool {
    npz.contains(&world_mat(0)) && npz.contains(&scale_mat(0))
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let [sphere, plain] = candidates(dir);
    let path = if sphere.is_file() { sphere } else { plain };
    let npz = NpzReader::open(&path, NPZ_REMEDY)?;
    let dirs = IMAGES_DIRS.map(|name| dir.join(name));
    let images_dir = dirs.iter().find(|dir| dir.is_dir()).unwrap_or(&dirs[0]);
    let images = images::list(images_dir)?;
    parse(npz, path, images_dir, images)
}

/// The poses of `images`, which are those of the folder `images_dir`.
fn parse(
    mut npz: NpzReader,
    path: PathBuf,
    images_dir: &Path,
    images: Vec<PathBuf>,
) -> Result<Poses, SceneError> {
    let poses = (0..)
        .take_while(|&index| npz.contains(&world_mat(index)))
        .count();
    check_counts(&path, poses, images_dir, images.len())?;

    let mut matrix = |name: String| matrix4(&path, &name, &npz.array(&name)?);
    let mut views = Vec::with_capacity(images.len());
    let mut original_from_world: Option<Matrix4<f64>> = None;
    for (index, image) in images.into_iter().enumerate() {
        let scale = matrix(scale_mat(index))?;
        if *original_from_world.get_or_insert(scale) != scale {
            let reason = format!(
                "`scale_mat_{index}` differs from `scale_mat_0`, but views of one scene share their world"
            );
            return Err(SceneError::malformed(&path, reason));
        }
        let name = file_stem(&image);
        let (intrinsics, world_from_camera) =
            decompose_projection(&(matrix(world_mat(index))? * scale))
                .map_err(|problem| SceneError::view(&path, &name, problem))?;
        views.push(PosedImage {
            name,
            image,
            intrinsics,
            distortion: Distortion::None,
            world_from_camera,
            size: None,
        });
    }
    let original_from_world = original_from_world.unwrap_or_else(Matrix4::identity);
    Ok(Poses {
        pixel_center: read_pixel_center(&mut npz, &path)?,
        original_from_world: similarity_of(&path, &original_from_world)?,
        declared_radius: Some(DECLARED_RADIUS),
        ..Poses::new(&path, views)?
    })
}

/// Splits a projection P ~ K (Rᵀ | −Rᵀ c), of any scale and sign, into intrinsics
/// with positive focal lengths and a camera-to-world pose (R | c) with det R = 1.
///
/// Only the first three rows of `projection` are used. The rotation is the
/// Gram–Schmidt basis of the rows of P's left 3×3 block, taken from the last to
/// the first: the RQ decomposition with positive diagonal.
///
/// # Errors
/// If the left 3×3 block is singular or a number is not finite.
fn decompose_projection(
    projection: &Matrix4<f64>,
) -> Result<(Intrinsics, Matrix4<f64>), CameraError> {
    if projection.iter().any(|x| !x.is_finite()) {
        return Err(CameraError::NotFinite);
    }
    let block = upper_left(projection);
    let determinant = block.determinant();
    let Some(inverse) = block.try_inverse() else {
        return Err(CameraError::Singular { determinant });
    };
    let center = -inverse * projection.fixed_view::<3, 1>(0, 3);

    // P and −P are the same projection; one of them has a right-handed block.
    let block = block * determinant.signum();
    let [a, b, c] = [0, 1, 2].map(|row| block.row(row).transpose());
    let scale = c.norm();
    let z = c / scale;
    let (b_on_z, b_off_z) = (b.dot(&z), b - z * b.dot(&z));
    let fy = b_off_z.norm();
    let y = b_off_z / fy;
    let x = y.cross(&z);
    let k = Matrix3::new(
        a.dot(&x),
        a.dot(&y),
        a.dot(&z), //
        0.0,
        fy,
        b_on_z, //
        0.0,
        0.0,
        scale,
    );
    let intrinsics = Intrinsics::try_from_matrix(&k)?;
    let mut world_from_camera = Matrix3::from_columns(&[x, y, z]).to_homogeneous();
    world_from_camera
        .fixed_view_mut::<3, 1>(0, 3)
        .copy_from(&center);
    Ok((intrinsics, world_from_camera))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::awkward_array::awkward_array;
    use crate::mutation::CASES;
    use crate::npz::npz_bytes;
    use nalgebra::{Rotation3, Vector3};
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn arrays_of_any_shape_and_value_never_panic(
            world_mat in awkward_array(vec![4, 4]), scale_mat in awkward_array(vec![4, 4]),
        ) {
            let arrays = BTreeMap::from([("world_mat_0", world_mat), ("scale_mat_0", scale_mat)]);
            let path = Path::new("scene/cameras.npz");
            let npz = NpzReader::from_bytes(npz_bytes(&arrays).unwrap(), path).unwrap();
            let poses = parse(npz, path.into(), Path::new("image"), vec!["a.png".into()]);
            if let Ok(poses) = poses {
                prop_assert!(poses.views.iter().all(|view| view.intrinsics.validate().is_ok()));
            }
        }
    }

    proptest! {
        #[test]
        fn decomposition_undoes_the_product(
            fx in 100.0..5e3, fy in 100.0..5e3, cx in 0.0..2e3, cy in 0.0..2e3,
            skew in -5.0..5.0, angles in prop::array::uniform3(-3.0..3.0),
            center in prop::array::uniform3(-900.0..900.0),
            scale in prop::sample::select(vec![1.0, -1.0, 250.0, -0.01]),
        ) {
            let intrinsics = Intrinsics { fx, fy, cx, cy, skew };
            let [roll, pitch, yaw] = angles;
            let rotation = Rotation3::from_euler_angles(roll, pitch, yaw);
            let mut pose = rotation.to_homogeneous();
            pose.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::from(center));
            let world_to_camera = pose.try_inverse().unwrap();
            let projection = intrinsics.matrix().to_homogeneous() * world_to_camera * scale;

            let (found, found_pose) = decompose_projection(&projection).unwrap();
            prop_assert!((found.matrix() - intrinsics.matrix()).amax() < 1e-6);
            prop_assert!((found_pose - pose).amax() < 1e-6);
        }
    }

    #[test]
    fn a_singular_projection_is_refused() {
        assert!(matches!(
            decompose_projection(&Matrix4::zeros()),
            Err(CameraError::Singular { .. })
        ));
        let nan = Matrix4::from_element(f64::NAN);
        assert_eq!(decompose_projection(&nan), Err(CameraError::NotFinite));
    }
}
