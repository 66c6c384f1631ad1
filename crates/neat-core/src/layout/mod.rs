//! Scenes on disk: which files hold images, poses and 2D wireframes.
//!
//! Several layouts are known ([`Layout`]); each has a file here that reads its
//! poses. Images and wireframes are read alike for all of them, by this file.

pub mod abc;
pub mod cameras_json;
pub mod colmap;
pub mod dtu;
mod images;
mod photograph;
mod pixel_center;
pub(crate) mod poses;
mod rectify;
pub mod transforms_json;
mod warning;

pub use pixel_center::PixelCenter;
pub use warning::SceneWarning;

use crate::file_cache::FileCache;
use crate::npz::NpzReader;
use crate::scene::{check_image_size, check_names};
use crate::{
    Camera, Observation, Scene, SceneError, SparsePoint, View, ViewError, Wireframe2d, hawp_json,
};
use photograph::Photograph;
use poses::{PosedImage, Poses};
use rayon::prelude::*;
use rectify::Rectification;
use std::path::{Path, PathBuf};

/// How the files of a scene are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// `images/`, `hawp/`, and `cameras.npz` with stacked `intrinsics` and
    /// `extrinsics`: the ABC objects of the published code.
    Abc,
    /// `image/`, `hawp/`, and `cameras.npz` with `world_mat_i` and
    /// `scale_mat_i`: DTU and BlendedMVS, as IDR, VolSDF and NeuS store them.
    Dtu,
    /// `cameras.json` that names every image with its intrinsics and pose, and
    /// `hawp/`.
    CamerasJson,
    /// `transforms.json` or `transforms_train.json` that names every image with
    /// its pose, and `hawp/`: Blender's NeRF scenes, instant-ngp, nerfstudio.
    TransformsJson,
    /// `images/`, `hawp/`, and a COLMAP model of undistorted images in
    /// `sparse/0/`, `sparse/` or the folder itself, binary or text.
    Colmap,
}

impl Layout {
    /// Tells the layout of the folder `dir` by its files. `cameras.npz` is
    /// looked at first, then `cameras.json`, then `transforms.json`, then a COLMAP
    /// model.
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
        let npz_path = dir.join(poses::CAMERAS_NPZ);
        if npz_path.exists() {
            let npz = NpzReader::open(&npz_path, poses::NPZ_REMEDY)?;
            if npz.contains(abc::INTRINSICS) && npz.contains(abc::EXTRINSICS) {
                return Ok(Self::Abc);
            }
            if npz.contains(&dtu::world_mat(0)) && npz.contains(&dtu::scale_mat(0)) {
                return Ok(Self::Dtu);
            }
        }
        if dir.join(cameras_json::FILE_NAME).exists() {
            return Ok(Self::CamerasJson);
        }
        if transforms_json::find(dir).is_some() {
            return Ok(Self::TransformsJson);
        }
        if colmap::is_in(dir) {
            return Ok(Self::Colmap);
        }
        Err(SceneError::UnknownLayout { path: dir.into() })
    }

    fn read_poses(self, dir: &Path) -> Result<Poses, SceneError> {
        match self {
            Self::Abc => abc::read_poses(dir),
            Self::Dtu => dtu::read_poses(dir),
            Self::CamerasJson => cameras_json::read_poses(dir),
            Self::TransformsJson => transforms_json::read_poses(dir),
            Self::Colmap => colmap::read_poses(dir),
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
    /// The longest side of images, in pixels: larger ones are scaled down.
    /// `None` keeps all as they are.
    pub max_image_size: Option<u32>,
    /// A folder that keeps undistorted images for the next time; it is created
    /// where needed, and can be deleted at any time. `None` keeps nothing.
    pub cache_dir: Option<PathBuf>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            layout: None,
            pixel_center: PixelCenter::Auto,
            min_segment_score: 0.05,
            require_wireframes: true,
            background: [0; 3],
            max_image_size: None,
            cache_dir: None,
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

/// Reads the scene in the folder `dir`.
///
/// Images and poses belong together by the order of the sorted file names, as in
/// the published code, or by name where the layout gives names. Wireframes
/// belong to images by name. Images are decoded in parallel; the result does not
/// depend on the number of threads.
///
/// Photographs with lens distortion are undistorted, and those larger than
/// [`LoadOptions::max_image_size`] scaled down; their cameras, wireframes and the
/// observations of points follow. A wireframe of the photograph's size was
/// detected in the photograph as it is on disk, one of the smaller size in the
/// smaller image.
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
    load_posed(dir, layout, layout.read_poses(dir)?, options)
}

/// [`load_scene`] once the poses are known.
fn load_posed(
    dir: &Path,
    layout: Layout,
    poses: Poses,
    options: &LoadOptions,
) -> Result<LoadedScene, SceneError> {
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

    let cameras = try_par_map(&poses.views, |posed| {
        camera_of(posed, images::read_size(&posed.image)?, &poses.path)
    })?;
    let mut warnings = Vec::new();
    let told = match options.pixel_center {
        PixelCenter::Integer => Some(0.0),
        PixelCenter::Half => Some(0.5),
        PixelCenter::Auto => poses
            .pixel_center
            .or_else(|| pixel_center::infer(cameras.iter())),
    };
    let pixel_center = told.unwrap_or(pixel_center::PUBLISHED);
    if told.is_none() {
        warnings.push(SceneWarning::PixelCenterAssumed { pixel_center });
    }
    let posed_cameras: Vec<_> = poses.views.iter().zip(cameras).collect();
    let rectifications = try_par_map(&posed_cameras, |&(posed, camera)| {
        Rectification::new(posed, camera, pixel_center, options.max_image_size)
            .map_err(|problem| poses::view_error(&poses.path, &posed.name, problem))
    })?;
    let rectified: Vec<_> = poses.views.iter().zip(&rectifications).collect();
    let wireframes = try_par_map(&rectified, |(posed, rectification)| {
        let path = hawp_dir.join(format!("{}.json", posed.name));
        if !options.require_wireframes && !path.exists() {
            let (width, height) = rectification.size();
            return Ok(Wireframe2d::empty(width, height));
        }
        rectification
            .wireframe(hawp_json::read(&path, pixel_center)?)
            .map_err(|problem| poses::view_error(&hawp_dir, &posed.name, problem))
    })?;
    let cache = options.cache_dir.as_ref().map(FileCache::new);
    let photographs = try_par_map(&rectified, |(posed, rectification)| {
        photograph::read(posed, rectification, options.background, cache.as_ref())
    })?;
    warnings.extend(rectification_warnings(&rectifications, options));
    warnings.extend(cache_warning(&photographs, options));

    let mut views = Vec::new();
    // Where each view of the files is in `views`, if it is kept.
    let mut kept = Vec::new();
    for (((posed, rectification), photograph), wireframe) in
        rectified.into_iter().zip(photographs).zip(wireframes)
    {
        let view = View {
            name: posed.name.clone(),
            camera: rectification.camera(),
            wireframe,
            image: photograph.image,
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
            sparse_points: observed_by(poses.points, &rectifications, &kept),
        },
        layout,
        warnings,
    })
}

/// How many views were undistorted, and how many scaled down.
fn rectification_warnings(
    rectifications: &[Rectification],
    options: &LoadOptions,
) -> Vec<SceneWarning> {
    let mut warnings = Vec::new();
    let mut lenses: Vec<_> = rectifications
        .iter()
        .filter_map(Rectification::lens)
        .collect();
    let views = lenses.len();
    lenses.sort_unstable();
    lenses.dedup();
    if views > 0 {
        warnings.push(SceneWarning::Undistorted { lenses, views });
    }
    let views = rectifications
        .iter()
        .filter(|view| view.scales_down())
        .count();
    if let (Some(max_image_size), 1..) = (options.max_image_size, views) {
        warnings.push(SceneWarning::ScaledDown {
            max_image_size,
            views,
        });
    }
    warnings
}

/// The first reason why an image is not in the cache.
fn cache_warning(photographs: &[Photograph], options: &LoadOptions) -> Option<SceneWarning> {
    let error = photographs
        .iter()
        .find_map(|view| view.not_cached.as_ref())?;
    let reason = match std::error::Error::source(error) {
        Some(source) => source.to_string(),
        None => error.to_string(),
    };
    let dir = options.cache_dir.clone()?;
    Some(SceneWarning::NotCached { dir, reason })
}

/// `points` with the observations that the images of the kept views show, under
/// their new indices.
fn observed_by(
    mut points: Vec<SparsePoint>,
    rectifications: &[Rectification],
    kept: &[Option<usize>],
) -> Vec<SparsePoint> {
    points.par_iter_mut().for_each(|point| {
        point.observations = (point.observations.iter())
            .filter_map(|observation| {
                let pixel = rectifications
                    .get(observation.view)?
                    .point(&observation.pixel)?;
                let view = (*kept.get(observation.view)?)?;
                Some(Observation { view, pixel })
            })
            .collect();
    });
    points
}

/// The camera of `posed`, whose photograph has `width` and `height`. `path` is that
/// of the poses.
fn camera_of(
    posed: &PosedImage,
    (width, height): (u32, u32),
    path: &Path,
) -> Result<Camera, SceneError> {
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
