//! Scenes on disk: which files hold images, poses and 2D wireframes.
//!
//! Several layouts are known ([`Layout`]); each has a file here that reads its
//! poses. Images and wireframes are read alike for all of them, by this file.

pub mod abc;
mod binary_reader;
pub mod bundler;
pub mod cameras_json;
pub mod colmap;
pub mod dtu;
mod images;
pub mod meta_data_json;
pub mod nvm;
pub mod openmvg;
pub mod openmvs;
mod pixel_center;
mod poses;
mod reconstruction;
pub mod strecha;
mod text_lines;
pub mod transforms_json;

pub use pixel_center::PixelCenter;

use crate::npz::NpzReader;
use crate::scene::{check_image_size, check_names};
use crate::{
    Camera, Observation, Scene, SceneError, SparsePoint, View, ViewError, Wireframe2d, hawp_json,
};
use image::RgbImage;
use poses::{PosedImage, Poses};
use rayon::prelude::*;
use std::fmt;
use std::path::Path;

/// How the files of a scene are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// `images/`, `hawp/`, and `cameras.npz` with stacked `intrinsics` and
    /// `extrinsics`: the ABC objects of the published code. See [`abc`].
    Abc,
    /// `image/`, `hawp/`, and `cameras_sphere.npz` or `cameras.npz` with
    /// `world_mat_i` and `scale_mat_i`: DTU and BlendedMVS, as IDR, VolSDF and
    /// NeuS store them. See [`dtu`].
    Dtu,
    /// `cameras.json` that names every image with its intrinsics and pose, and
    /// `hawp/`. See [`cameras_json`].
    CamerasJson,
    /// `transforms.json` or `transforms_train.json` that names every image with
    /// its pose, and `hawp/`: Blender's NeRF scenes, instant-ngp, nerfstudio. See
    /// [`transforms_json`].
    TransformsJson,
    /// `images/`, `hawp/`, and a COLMAP model in `sparse/0/`, `sparse/` or the
    /// folder itself, binary or text. See [`colmap`].
    Colmap,
    /// `meta_data.json` that names every image with its pose, and `hawp/`:
    /// sdfstudio and EMAP. See [`meta_data_json`].
    MetaDataJson,
    /// `sfm_data.json` of OpenMVG, and `hawp/`. See [`openmvg`].
    OpenMvg,
    /// A `.mvs` scene in OpenMVS's interface format, and `hawp/`. See [`openmvs`].
    OpenMvs,
    /// A `.nvm` file of VisualSfM, and `hawp/`. See [`nvm`].
    VisualSfm,
    /// `bundle.out` and `list.txt` of Bundler, and `hawp/`. See [`bundler`].
    Bundler,
    /// One `NAME.jpg.camera` per image, and `hawp/`: the benchmark of Strecha and
    /// others. See [`strecha`].
    Strecha,
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Abc => "ABC (cameras.npz with intrinsics and extrinsics)",
            Self::Dtu => "DTU (cameras.npz or cameras_sphere.npz with world_mat and scale_mat)",
            Self::CamerasJson => "cameras.json",
            Self::TransformsJson => "transforms.json (OpenGL axes)",
            Self::Colmap => "COLMAP (cameras and images of a sparse model)",
            Self::MetaDataJson => "meta_data.json (sdfstudio, EMAP)",
            Self::OpenMvg => "OpenMVG (sfm_data.json)",
            Self::OpenMvs => "OpenMVS (scene.mvs)",
            Self::VisualSfm => "VisualSfM (N-View Match file, .nvm)",
            Self::Bundler => "Bundler (bundle.out and list.txt)",
            Self::Strecha => "Strecha (one .camera file per image)",
        })
    }
}

impl Layout {
    /// Tells the layout of the folder `dir` by its files, looked for in the order
    /// `cameras_sphere.npz`, `cameras.npz`, `cameras.json`, `transforms.json`, a
    /// COLMAP model, `meta_data.json`, `sfm_data.json`, `.mvs`, `.nvm`,
    /// `bundle.out`, `.camera`.
    ///
    /// # Errors
    /// If the folder does not exist or follows no known layout.
    pub fn detect(dir: &Path) -> Result<Self, SceneError> {
        if !dir.is_dir() {
            return Err(SceneError::Missing {
                path: dir.into(),
                remedy: "give the folder of a scene".into(),
            });
        }
        for npz_path in dtu::candidates(dir) {
            if npz_path.exists() {
                let npz = NpzReader::open(&npz_path, poses::NPZ_REMEDY)?;
                if abc::is_in(&npz) && npz_path.ends_with(poses::CAMERAS_NPZ) {
                    return Ok(Self::Abc);
                }
                if dtu::is_in(&npz) {
                    return Ok(Self::Dtu);
                }
            }
        }
        type IsIn = fn(&Path) -> bool;
        let checks: [(Self, IsIn); 9] = [
            (Self::CamerasJson, |dir| {
                dir.join(cameras_json::FILE_NAME).exists()
            }),
            (Self::TransformsJson, |dir| {
                transforms_json::find(dir).is_some()
            }),
            (Self::Colmap, colmap::is_in),
            (Self::MetaDataJson, |dir| {
                dir.join(meta_data_json::FILE_NAME).exists()
            }),
            (Self::OpenMvg, |dir| openmvg::find(dir).is_some()),
            (Self::OpenMvs, |dir| openmvs::find(dir).is_some()),
            (Self::VisualSfm, |dir| nvm::find(dir).is_some()),
            (Self::Bundler, |dir| bundler::find(dir).is_some()),
            (Self::Strecha, |dir| strecha::find(dir).is_some()),
        ];
        let found = checks.into_iter().find(|(_, is_in)| is_in(dir));
        found
            .map(|(layout, _)| layout)
            .ok_or_else(|| SceneError::UnknownLayout { path: dir.into() })
    }

    fn read_poses(self, dir: &Path) -> Result<Poses, SceneError> {
        match self {
            Self::Abc => abc::read_poses(dir),
            Self::Dtu => dtu::read_poses(dir),
            Self::CamerasJson => cameras_json::read_poses(dir),
            Self::TransformsJson => transforms_json::read_poses(dir),
            Self::Colmap => colmap::read_poses(dir),
            Self::MetaDataJson => meta_data_json::read_poses(dir),
            Self::OpenMvg => openmvg::read_poses(dir),
            Self::OpenMvs => openmvs::read_poses(dir),
            Self::VisualSfm => nvm::read_poses(dir),
            Self::Bundler => bundler::read_poses(dir),
            Self::Strecha => strecha::read_poses(dir),
        }
    }
}

/// How [`load_scene`] reads a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// The layout; `None` tells it by the files.
    pub layout: Option<Layout>,
    /// Where the centre of a pixel lies in the coordinates of the intrinsics.
    pub pixel_center: PixelCenter,
    /// A view is usable if a segment has a score above this. The published code
    /// uses 0.05 for training.
    pub min_segment_score: f64,
    /// Whether views need 2D wireframes: if so, a missing wireframe is an error
    /// and views without a usable segment are dropped. If not, every view is
    /// kept, and one without a file has an empty wireframe.
    pub require_wireframes: bool,
    /// The colour behind transparent pixels.
    pub background: [u8; 3],
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            layout: None,
            pixel_center: PixelCenter::Auto,
            min_segment_score: 0.05,
            require_wireframes: true,
            background: [0; 3],
        }
    }
}

/// A scene with what a person should know about how it was read.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// The scene: validated, its views sorted by name.
    pub scene: Scene,
    /// The layout that it was read by.
    pub layout: Layout,
    /// In the order of the views.
    pub warnings: Vec<SceneWarning>,
}

/// Something that does not stop a scene from being read.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SceneWarning {
    /// The principal point does not tell where pixel centres are.
    PixelCenterAssumed {
        /// The value taken.
        pixel_center: f64,
    },
    /// A view was dropped because nothing was detected in it.
    ViewWithoutSegments {
        /// Name of the view.
        view: String,
        /// No segment's score is above this.
        min_segment_score: f64,
    },
}

impl fmt::Display for SceneWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PixelCenterAssumed { pixel_center } => write!(
                f,
                "the intrinsics do not tell where pixel centres are: {pixel_center} is assumed"
            ),
            Self::ViewWithoutSegments {
                view,
                min_segment_score,
            } => write!(
                f,
                "view `{view}` is left out: no segment has a score above {min_segment_score}"
            ),
        }
    }
}

/// Reads the scene in the folder `dir`.
///
/// Images and poses belong together by the order of the sorted file names, as in
/// the published code, or by name where the layout gives names. Wireframes
/// belong to images by name. Images are decoded in parallel; the result does not
/// depend on the number of threads.
///
/// # Errors
/// Everything that [`SceneError`] lists; the first view in order decides.
///
/// # Example
/// ```no_run
/// use neat_core::{LoadOptions, load_scene};
/// let loaded = load_scene("data/abc-00075213", &LoadOptions::default())?;
/// for warning in &loaded.warnings {
///     eprintln!("{warning}");
/// }
/// assert!(!loaded.scene.views.is_empty());
/// # Ok::<(), neat_core::SceneError>(())
/// ```
pub fn load_scene(dir: impl AsRef<Path>, options: &LoadOptions) -> Result<LoadedScene, SceneError> {
    let dir = dir.as_ref();
    let layout = options.layout.map_or_else(|| Layout::detect(dir), Ok)?;
    let poses = layout.read_poses(dir)?;
    if poses.views.is_empty() {
        return Err(SceneError::NoView { path: dir.into() });
    }
    check_names(poses.views.iter().map(|view| view.name.as_str()), dir)?;
    let hawp_dir = dir.join(abc::HAWP_DIR);
    // Before the images, which take seconds to decode.
    if options.require_wireframes && !hawp_dir.is_dir() {
        return Err(SceneError::Missing {
            path: hawp_dir,
            remedy: hawp_json::REMEDY.into(),
        });
    }

    let photos = try_par_map(&poses.views, |posed| {
        let image = images::read_rgb(&posed.image, options.background)?;
        Ok((camera_of(posed, &image, &poses.path)?, image))
    })?;
    let mut warnings = Vec::new();
    let told = match options.pixel_center {
        PixelCenter::Integer => Some(0.0),
        PixelCenter::Half => Some(0.5),
        PixelCenter::Auto => poses
            .pixel_center
            .or_else(|| pixel_center::infer(photos.iter().map(|(camera, _)| camera))),
    };
    let pixel_center = told.unwrap_or(pixel_center::PUBLISHED);
    if told.is_none() {
        warnings.push(SceneWarning::PixelCenterAssumed { pixel_center });
    }
    let wireframes = try_par_map(&poses.views, |posed| {
        let path = hawp_dir.join(format!("{}.json", posed.name));
        let absent = !options.require_wireframes && !path.exists();
        (!absent)
            .then(|| hawp_json::read(&path, pixel_center))
            .transpose()
    })?;

    let mut views = Vec::new();
    // Where each view of the files is in `views`, if it is kept.
    let mut kept = Vec::new();
    for ((posed, (camera, image)), wireframe) in poses.views.iter().zip(photos).zip(wireframes) {
        let view = View {
            name: posed.name.clone(),
            camera,
            wireframe: wireframe.unwrap_or_else(|| Wireframe2d::empty(camera.width, camera.height)),
            image,
        };
        view.validate()
            .map_err(|problem| poses::view_error(&hawp_dir, &view.name, problem))?;
        let segments = view.wireframe.segments(options.min_segment_score);
        if options.require_wireframes && segments.is_empty() {
            warnings.push(SceneWarning::ViewWithoutSegments {
                view: view.name,
                min_segment_score: options.min_segment_score,
            });
            kept.push(None);
        } else {
            kept.push(Some(views.len()));
            views.push(view);
        }
    }
    if views.is_empty() {
        return Err(SceneError::NoUsableView {
            path: dir.into(),
            views: poses.views.len(),
            min_segment_score: options.min_segment_score,
        });
    }
    Ok(LoadedScene {
        scene: Scene {
            name: scene_name(dir),
            views,
            original_from_world: poses.original_from_world,
            pixel_center,
            sparse_points: observed_by(poses.points, &kept),
        },
        layout,
        warnings,
    })
}

/// `points` with the observations of the views that are kept, under their new
/// indices.
fn observed_by(mut points: Vec<SparsePoint>, kept: &[Option<usize>]) -> Vec<SparsePoint> {
    for point in &mut points {
        point.observations = (point.observations.iter())
            .filter_map(|&Observation { view, pixel }| {
                let view = *kept.get(view)?;
                view.map(|view| Observation { view, pixel })
            })
            .collect();
    }
    points
}

/// The camera of `posed`, for its decoded `image`. `path` is that of the poses.
fn camera_of(posed: &PosedImage, image: &RgbImage, path: &Path) -> Result<Camera, SceneError> {
    let (width, height) = image.dimensions();
    let size = posed.size.unwrap_or((width, height));
    check_image_size("camera", size, (width, height))
        .and_then(|()| {
            Camera::try_from_matrices(posed.intrinsics, &posed.world_from_camera, width, height)
                .map_err(ViewError::Camera)
        })
        .map_err(|problem| poses::view_error(path, &posed.name, problem))
}

/// The folder's name, also for `.` and `scene/..`.
fn scene_name(dir: &Path) -> String {
    let canonical = dir.canonicalize().unwrap_or_else(|_| dir.into());
    let name = canonical.file_name().unwrap_or(canonical.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Maps in parallel; of several errors the first in order is returned.
fn try_par_map<T: Sync, U: Send>(
    items: &[T],
    f: impl Fn(&T) -> Result<U, SceneError> + Sync + Send,
) -> Result<Vec<U>, SceneError> {
    let results: Vec<_> = items.par_iter().map(f).collect();
    results.into_iter().collect()
}
