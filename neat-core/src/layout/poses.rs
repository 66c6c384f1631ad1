//! What every layout says about its images: file, intrinsics and pose.

use super::CameraAxes;
use crate::npz::{NpyArray, NpzReader};
use crate::scene::{check_names, keep_observations};
use crate::{CameraError, Distortion, Intrinsics, SceneError, Similarity, SparsePoint};
use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

/// The poses of a whole scene.
pub(super) struct Poses {
    /// The file that holds them, for messages.
    pub path: PathBuf,
    /// The images, sorted by name.
    pub views: Vec<PosedImage>,
    /// Leads to the frame of the user's files.
    pub original_from_world: Similarity,
    /// The axes of cameras in files of this layout, out of which the reader has turned them.
    pub file_axes: CameraAxes,
    /// Where the layout says where pixel centres are, in pixels.
    pub pixel_center: Option<f64>,
    /// Sparse points of the reconstruction, in the world of the poses, observed
    /// in the photographs as they are on disk; empty where there are none.
    pub points: Vec<SparsePoint>,
    /// Radius of the ball around the origin that holds the object, where the
    /// layout's world is made so.
    pub declared_radius: Option<f64>,
}

impl Poses {
    /// What the file at `path` says about its images alone. They are sorted by name,
    /// and the world is the frame of the file.
    ///
    /// # Errors
    /// If a name appears twice or is no file name.
    pub fn new(path: &Path, mut views: Vec<PosedImage>) -> Result<Self, SceneError> {
        views.sort_by(|a, b| a.name.cmp(&b.name));
        check_names(views.iter().map(|view| view.name.as_str()), path)?;
        Ok(Self {
            path: path.into(),
            views,
            original_from_world: Similarity::identity(),
            file_axes: CameraAxes::OPENCV,
            pixel_center: None,
            points: Vec::new(),
            declared_radius: None,
        })
    }

    /// Leaves the views that are `kept`; points lose what the others observed.
    pub fn retain_views(&mut self, kept: &[bool]) {
        keep_observations(&mut self.points, kept);
        let mut kept = kept.iter();
        self.views.retain(|_| kept.next() == Some(&true));
    }
}

/// An image on disk with its camera.
pub(super) struct PosedImage {
    /// File name without ending.
    pub name: String,
    /// The image.
    pub image: PathBuf,
    /// Its intrinsics, for the image as it is on disk.
    pub intrinsics: Intrinsics,
    /// Its lens.
    pub distortion: Distortion,
    /// Its 4×4 camera-to-world matrix.
    pub world_from_camera: Matrix4<f64>,
    /// Width and height, where the layout gives them.
    pub size: Option<(u32, u32)>,
}

/// The archive of poses in the layouts of the published code.
pub(crate) const CAMERAS_NPZ: &str = "cameras.npz";

/// What to do about a missing [`CAMERAS_NPZ`].
pub(super) const NPZ_REMEDY: &str = "provide the poses of the images";

/// The array of [`CAMERAS_NPZ`] that says which image coordinates the centre of the
/// first pixel has. It is ours: other programs ignore it.
pub(crate) const PIXEL_CENTER: &str = "pixel_center";
/// Likewise, the radius of the scene sphere around the origin.
pub(crate) const SPHERE_RADIUS: &str = "sphere_radius";

/// An array of one number.
pub(crate) fn number_array(value: f64) -> NpyArray {
    NpyArray {
        shape: vec![],
        values: vec![value],
    }
}

/// The pixel centre that the archive at `path` names, if it does.
pub(super) fn read_pixel_center(
    npz: &mut NpzReader,
    path: &Path,
) -> Result<Option<f64>, SceneError> {
    read_number(npz, path, PIXEL_CENTER, "0 or 0.5", |x| {
        [0.0, 0.5].contains(&x)
    })
}

/// The radius of the scene sphere that the archive at `path` names, if it does.
pub(super) fn read_sphere_radius(
    npz: &mut NpzReader,
    path: &Path,
) -> Result<Option<f64>, SceneError> {
    read_number(npz, path, SPHERE_RADIUS, "a number above 0", |x| {
        x.is_finite() && x > 0.0
    })
}

/// The array `name` of one number, where there is one, which must be `expected`.
fn read_number(
    npz: &mut NpzReader,
    path: &Path,
    name: &str,
    expected: &str,
    is_good: impl Fn(f64) -> bool,
) -> Result<Option<f64>, SceneError> {
    if !npz.contains(name) {
        return Ok(None);
    }
    match npz.array(name)?.values.as_slice() {
        [value] if is_good(*value) => Ok(Some(*value)),
        other => Err(SceneError::malformed(
            path,
            format!("`{name}` holds {other:?}, not {expected}"),
        )),
    }
}

/// Errs unless there is one pose per image.
pub(super) fn check_counts(
    path: &Path,
    poses: usize,
    images_dir: &Path,
    images: usize,
) -> Result<(), SceneError> {
    if poses == images {
        return Ok(());
    }
    Err(SceneError::CountMismatch {
        path: path.into(),
        poses,
        images_dir: images_dir.into(),
        images,
    })
}

/// The rotation of a quaternion w, x, y, z of any length, as file and view have it.
pub(super) fn rotation_of(
    quaternion: [f64; 4],
    path: &Path,
    view: &str,
) -> Result<UnitQuaternion<f64>, SceneError> {
    let [w, x, y, z] = quaternion;
    if quaternion.iter().any(|x| !x.is_finite()) {
        return Err(SceneError::view(path, view, CameraError::NotFinite));
    }
    let quaternion = Quaternion::new(w, x, y, z);
    // Not zero, and neither so small nor so large that it cannot be divided by.
    if !quaternion.norm().is_normal() {
        let reason =
            format!("the quaternion ({w}, {x}, {y}, {z}) of view `{view}` is not a rotation");
        return Err(SceneError::malformed(path, reason));
    }
    Ok(UnitQuaternion::from_quaternion(quaternion))
}

/// The 4×4 camera-to-world pose of a rotation camera-from-world and a centre.
pub(super) fn pose_of(camera_from_world: &Matrix3<f64>, center: &Vector3<f64>) -> Matrix4<f64> {
    let rotation = camera_from_world.transpose().to_homogeneous();
    rotation.append_translation(center)
}

/// The upper left 3×3 of a matrix.
pub(super) fn upper_left(matrix: &Matrix4<f64>) -> Matrix3<f64> {
    matrix.fixed_view::<3, 3>(0, 0).into_owned()
}

/// Intrinsics from the upper left 3×3 of `matrix`, checked.
pub(super) fn intrinsics_of(matrix: &Matrix4<f64>) -> Result<Intrinsics, CameraError> {
    Intrinsics::try_from_matrix(&upper_left(matrix))
}

/// An array of shape [4, 4] as a matrix.
pub(super) fn matrix4(
    path: &Path,
    name: &str,
    array: &NpyArray,
) -> Result<Matrix4<f64>, SceneError> {
    if array.shape != [4, 4] {
        return Err(wrong_shape(path, name, array, "[4, 4]"));
    }
    Ok(Matrix4::from_row_slice(&array.values))
}

/// An array with a shape that its layout does not allow.
pub(super) fn wrong_shape(
    path: &Path,
    name: &str,
    array: &NpyArray,
    expected: &'static str,
) -> SceneError {
    SceneError::WrongShape {
        path: path.into(),
        array: name.into(),
        found: array.shape.clone(),
        expected,
    }
}

/// The transform of a `scale_mat`: one positive scale and a translation.
pub(super) fn similarity_of(path: &Path, matrix: &Matrix4<f64>) -> Result<Similarity, SceneError> {
    let similarity = Similarity {
        scale: matrix[(0, 0)],
        translation: matrix.fixed_view::<3, 1>(0, 3).into_owned(),
    };
    let deviation = (similarity.matrix() - matrix).amax();
    if similarity.scale <= 0.0 || deviation > 1e-5 * similarity.scale {
        let reason =
            "its scale matrix is not a positive scale, the same for all axes, and a translation";
        return Err(SceneError::malformed(path, reason));
    }
    Ok(similarity)
}
