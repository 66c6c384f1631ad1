//! The layout of the published code's ABC objects.
//!
//! - `images/NAME.png`
//! - `hawp/NAME.json`, see [`crate::hawp_json`]
//! - `cameras.npz`: `intrinsics` [N, 3, 3] or [N, 4, 4], `extrinsics` [N, 4, 4]
//!   camera-to-world in OpenCV axes, in the order of the sorted image names.
//!
//! Three more arrays are written and, where they are, read: `scale_mat` [4, 4]
//! leads from the world to the original frame, `pixel_center` [] says which image
//! coordinates the centre of the first pixel has, and `sphere_radius` [] how large
//! the scene sphere around the origin is. Other programs ignore them.

use super::images;
use super::poses::{
    CAMERAS_NPZ, NPZ_REMEDY, PIXEL_CENTER, PosedImage, Poses, SPHERE_RADIUS, check_counts,
    intrinsics_of, matrix4, number_array, read_pixel_center, read_sphere_radius, similarity_of,
    wrong_shape,
};
use crate::npz::{NpyArray, NpzReader, write_npz};
use crate::{Distortion, Scene, SceneError, Similarity, View, file, hawp_json};
use nalgebra::{Matrix3, Matrix4, SMatrix};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const INTRINSICS: &str = "intrinsics";
const EXTRINSICS: &str = "extrinsics";
const SCALE_MAT: &str = "scale_mat";
const IMAGES_DIR: &str = "images";
/// The folder of 2D wireframes, in every layout.
pub const HAWP_DIR: &str = "hawp";

/// Whether the arrays are those of this layout.
pub(super) fn is_in(npz: &NpzReader) -> bool {
    npz.contains(INTRINSICS) && npz.contains(EXTRINSICS)
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let path = dir.join(CAMERAS_NPZ);
    let npz = NpzReader::open(&path, NPZ_REMEDY)?;
    let images_dir = dir.join(IMAGES_DIR);
    let images = images::list(&images_dir)?;
    parse(npz, path, &images_dir, images)
}

/// The poses of `images`, which are those of the folder `images_dir`.
fn parse(
    mut npz: NpzReader,
    path: PathBuf,
    images_dir: &Path,
    images: Vec<PathBuf>,
) -> Result<Poses, SceneError> {
    let intrinsics = stack(&path, INTRINSICS, &npz.array(INTRINSICS)?)?;
    let extrinsics = stack(&path, EXTRINSICS, &npz.array(EXTRINSICS)?)?;
    for poses in [&intrinsics, &extrinsics] {
        check_counts(&path, poses.len(), images_dir, images.len())?;
    }

    let mut views = Vec::with_capacity(images.len());
    for ((image, intrinsics), world_from_camera) in
        images.into_iter().zip(&intrinsics).zip(extrinsics)
    {
        let name = hawp_json::file_stem(&image);
        let intrinsics =
            intrinsics_of(intrinsics).map_err(|problem| SceneError::view(&path, &name, problem))?;
        views.push(PosedImage {
            name,
            image,
            intrinsics,
            distortion: Distortion::None,
            world_from_camera,
            size: None,
        });
    }
    Ok(Poses {
        original_from_world: read_scale_mat(&mut npz, &path)?,
        pixel_center: read_pixel_center(&mut npz, &path)?,
        declared_radius: read_sphere_radius(&mut npz, &path)?,
        ..Poses::new(&path, views)?
    })
}

/// Matrices of an array [N, 3, 3] or [N, 4, 4]; 3×3 ones are completed.
fn stack(path: &Path, name: &str, array: &NpyArray) -> Result<Vec<Matrix4<f64>>, SceneError> {
    let matrix: fn(&[f64]) -> Matrix4<f64> = match (name, array.shape.as_slice()) {
        (INTRINSICS, [_, 3, 3]) => |values| Matrix3::from_row_slice(values).to_homogeneous(),
        (_, [_, 4, 4]) => Matrix4::from_row_slice,
        (INTRINSICS, _) => return Err(wrong_shape(path, name, array, "[N, 3, 3] or [N, 4, 4]")),
        _ => return Err(wrong_shape(path, name, array, "[N, 4, 4]")),
    };
    let len: usize = array.shape[1..].iter().product();
    Ok(array.values.chunks_exact(len).map(matrix).collect())
}

fn read_scale_mat(npz: &mut NpzReader, path: &Path) -> Result<Similarity, SceneError> {
    if !npz.contains(SCALE_MAT) {
        return Ok(Similarity::identity());
    }
    similarity_of(path, &matrix4(path, SCALE_MAT, &npz.array(SCALE_MAT)?)?)
}

/// Writes a scene into the folder `dir`, which is created where needed. Reading
/// it gives the same views, to the rounding that [`hawp_json::write`] names.
///
/// Poses are written last: a folder that an interrupt left without them is no
/// scene. Other images in the folder stay, and the reader refuses them.
///
/// # Errors
/// If [`Scene::validate`] does not pass, or a file cannot be written.
pub fn write_scene(scene: &Scene, dir: &Path) -> Result<(), SceneError> {
    scene.validate()?;
    let images_dir = dir.join(IMAGES_DIR);
    let hawp_dir = dir.join(HAWP_DIR);
    file::create_dir(&images_dir)?;
    // An empty folder would say that nothing was to be found.
    let has_wireframes = scene.has_wireframes();
    if has_wireframes {
        file::create_dir(&hawp_dir)?;
    }
    let write = |view: &View| {
        let image = images_dir.join(format!("{}.png", view.name));
        file::write_png(&image, &*view.image.read()?)?;
        if !has_wireframes {
            return Ok(());
        }
        let hawp = hawp_dir.join(format!("{}.json", view.name));
        hawp_json::write(&hawp, &view.wireframe, scene.pixel_center)
    };
    // No more than this at once: some images are read or made only now.
    for views in scene.views.chunks(rayon::current_num_threads()) {
        views.par_iter().try_for_each(write)?;
    }
    write_cameras(scene, &dir.join(CAMERAS_NPZ))
}

fn write_cameras(scene: &Scene, path: &Path) -> Result<(), SceneError> {
    // In the order of the files: `a-b.png` is before `a.png`.
    let mut views: Vec<_> = scene.views.iter().collect();
    views.sort_by_key(|view| format!("{}.png", view.name));
    let cameras = || views.iter().map(|view| &view.camera);
    let arrays = BTreeMap::from([
        (
            INTRINSICS,
            NpyArray {
                shape: vec![scene.views.len(), 3, 3],
                values: cameras()
                    .flat_map(|camera| row_major(&camera.intrinsics.matrix()))
                    .collect(),
            },
        ),
        (
            EXTRINSICS,
            NpyArray {
                shape: vec![scene.views.len(), 4, 4],
                values: cameras()
                    .flat_map(|camera| row_major(&camera.matrix_world_from_camera()))
                    .collect(),
            },
        ),
        (
            SCALE_MAT,
            NpyArray {
                shape: vec![4, 4],
                values: row_major(&scene.original_from_world.without_mirroring().matrix()),
            },
        ),
        (PIXEL_CENTER, number_array(scene.pixel_center)),
        (SPHERE_RADIUS, number_array(scene.sphere_radius)),
    ]);
    write_npz(path, &arrays)
}

/// The elements of a matrix, row by row.
fn row_major<const N: usize>(matrix: &SMatrix<f64, N, N>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::awkward_array::awkward_array;
    use crate::mutation::CASES;
    use crate::npz::npz_bytes;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn arrays_of_any_shape_and_value_never_panic(
            intrinsics in awkward_array(vec![1, 3, 3]), extrinsics in awkward_array(vec![1, 4, 4]),
            scale_mat in awkward_array(vec![4, 4]), pixel_center in awkward_array(vec![]),
        ) {
            let arrays = BTreeMap::from([
                (INTRINSICS, intrinsics),
                (EXTRINSICS, extrinsics),
                (SCALE_MAT, scale_mat),
                (PIXEL_CENTER, pixel_center),
            ]);
            let path = Path::new("scene/cameras.npz");
            let npz = NpzReader::from_bytes(npz_bytes(&arrays).unwrap(), path).unwrap();
            let poses = parse(npz, path.into(), Path::new("images"), vec!["a.png".into()]);
            if let Ok(poses) = poses {
                prop_assert!(poses.views.iter().all(|view| view.intrinsics.validate().is_ok()));
            }
        }
    }
}
