//! From a folder to a scene: poses, images and 2D wireframes, read alike for all
//! layouts.

use super::masks::{self, MaskFiles, Room};
use super::photograph::{self, Photograph};
use super::poses::{self, PosedImage, Poses};
use super::rectify::Rectification;
use super::sphere::Evidence;
use super::{
    HAWP_DIR, Layout, LoadOptions, PixelCenter, SceneWarning, images, links, pixel_center,
    point_files,
};
use crate::file_cache::FileCache;
use crate::scene::{check_image_size, check_names, keep_observations};
use crate::scene_sphere::SphereSource;
use crate::{
    Camera, ImageStore, Observation, Scene, SceneError, SceneSphere, SparsePoint, View, ViewError,
    ViewImage, Wireframe2d, hawp_json,
};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// A scene with what a person should know about how it was read.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// The scene: validated, its views sorted by name.
    pub scene: Scene,
    /// The layout that it was read by.
    pub layout: Layout,
    /// The scene sphere, in the frame and unit of the files.
    pub sphere: SceneSphere,
    /// The files that it was read from, sorted.
    pub files: Vec<PathBuf>,
    /// In the order of the views.
    pub warnings: Vec<SceneWarning>,
}

/// Reads the scene in the folder `dir`.
///
/// Images and poses belong together by the order of the sorted file names, as in
/// the published code, or by name where the layout gives names. Wireframes
/// belong to images by name. Images are decoded in parallel; the result does not
/// depend on the number of threads, nor on the memory that they may use.
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
    let mut poses = layout.read_poses(dir)?;
    options.correct(&mut poses);
    load_posed(dir, layout, poses, options)
}

/// [`load_scene`] once the poses are known.
pub(super) fn load_posed(
    dir: &Path,
    layout: Layout,
    mut poses: Poses,
    options: &LoadOptions,
) -> Result<LoadedScene, SceneError> {
    if poses.views.is_empty() {
        return Err(SceneError::NoView { path: dir.into() });
    }
    let mut warnings = Vec::new();
    warnings.extend(drop_missing_images(&mut poses)?);
    if let Some(max_views) = options.max_views {
        thin_views(&mut poses, max_views);
    }
    check_names(poses.views.iter().map(|view| view.name.as_str()), dir)?;
    let hawp_dir = dir.join(HAWP_DIR);
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
    let sizes = rectifications.iter().map(Rectification::size);
    let store = ImageStore::for_images(sizes, options.memory_limit, options.cache_dir.as_deref())?;
    let limit = options.memory_limit;
    let bytes_each = limit.bytes_each(
        (rectifications.iter()).map(Rectification::photograph_size),
        photograph::BYTES_PER_PIXEL,
        "reading an image",
        dir,
    )?;
    let photographs = limit.try_map(&rectified, bytes_each, |(posed, rectification)| {
        let background = options.background;
        photograph::read(posed, rectification, background, cache.as_ref())?.kept_in(&store, posed)
    })?;
    warnings.extend(rectification_warnings(&rectifications, options));
    warnings.extend(cache_warning(&photographs, options));

    let mut views = Vec::new();
    // Which views of the files are in `views`.
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
            kept.push(false);
        } else {
            kept.push(true);
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
    let cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
    let points = match poses.points.is_empty() {
        true => {
            let convention = options.pose_convention.unwrap_or_default();
            let is_mirrored = convention.mirrored_world;
            point_files::read(dir, &cameras, &poses.original_from_world, is_mirrored)?
        }
        false => {
            let mut points = rectified_points(poses.points, &rectifications);
            keep_observations(&mut points, &kept);
            points
        }
    };
    let mut kept = kept.into_iter();
    poses.views.retain(|_| kept.next() == Some(true));
    let masks = masks::find(dir, &poses.views, Room { limit, bytes_each });
    let sphere = Evidence {
        dir,
        masks: masks.as_ref(),
        cameras: &cameras,
        points: &points,
        declared_radius: poses.declared_radius,
    }
    .sphere(options.sphere, &poses.original_from_world)?;
    if sphere.source == SphereSource::Unknown {
        warnings.push(SceneWarning::SphereUnknown);
    }
    let files = input_files(dir, &poses.path, &poses.views, masks);
    warnings.extend(links::outside(dir, &files));
    let scene = Scene {
        name: scene_name(dir),
        views,
        original_from_world: poses.original_from_world,
        pixel_center,
        sphere_radius: sphere.radius,
        sparse_points: points,
    }
    .centered_at(&sphere.center);
    Ok(LoadedScene {
        sphere: SceneSphere {
            center: poses.original_from_world.apply(&sphere.center),
            radius: poses.original_from_world.scale * sphere.radius,
            ..sphere
        },
        files,
        scene,
        layout,
        warnings,
    })
}

/// What is read beside the file of poses, or in the folder of the scene.
const BESIDE_POSES: [&str; 8] = [
    "cameras.txt",
    "cameras.bin",
    "points3D.txt",
    "points3D.bin",
    "list.txt",
    "sparse_points.ply",
    "sparse_pc.ply",
    "points3D.ply",
];

/// The files that a scene was read from, sorted.
fn input_files(
    dir: &Path,
    poses: &Path,
    images: &[PosedImage],
    masks: Option<MaskFiles>,
) -> Vec<PathBuf> {
    let hawp_dir = dir.join(HAWP_DIR);
    let mut files: Vec<PathBuf> = images.iter().map(|view| view.image.clone()).collect();
    files.extend(
        images
            .iter()
            .map(|view| hawp_dir.join(format!("{}.json", view.name))),
    );
    if poses.is_dir() {
        let entries = poses.read_dir().into_iter().flatten().flatten();
        files.extend(entries.map(|entry| entry.path()));
    } else {
        files.push(poses.into());
        files.extend(BESIDE_POSES.map(|name| poses.with_file_name(name)));
    }
    files.extend(BESIDE_POSES.map(|name| dir.join(name)));
    files.extend(masks.into_iter().flat_map(|masks| masks.files));
    files.retain(|file| file.is_file());
    files.sort();
    files.dedup();
    files
}

/// Leaves out the views whose images are not there: scenes are often passed on
/// without some of them. Errs if that are more than half.
fn drop_missing_images(poses: &mut Poses) -> Result<Option<SceneWarning>, SceneError> {
    let is_there: Vec<bool> = (poses.views.iter())
        .map(|view| view.image.exists())
        .collect();
    let missing: Vec<&PosedImage> = (poses.views.iter().zip(&is_there))
        .filter_map(|(view, is_there)| (!is_there).then_some(view))
        .collect();
    let Some(first) = missing.first() else {
        return Ok(None);
    };
    if 2 * missing.len() > poses.views.len() {
        return Err(images::missing(&first.image));
    }
    let warning = SceneWarning::ImagesMissing {
        first: first.image.clone(),
        views: missing.len(),
    };
    keep_observations(&mut poses.points, &is_there);
    let mut is_there = is_there.into_iter();
    poses.views.retain(|_| is_there.next() == Some(true));
    Ok(Some(warning))
}

/// Leaves at most `max_views` views, spread evenly over their order.
fn thin_views(poses: &mut Poses, max_views: usize) {
    let views = poses.views.len();
    if views <= max_views {
        return;
    }
    // Of the boundaries of `max_views` equal parts, those that views pass.
    let part = |view: usize| view * max_views / views;
    let kept: Vec<bool> = (0..views)
        .map(|view| part(view) != part(view + 1))
        .collect();
    keep_observations(&mut poses.points, &kept);
    let mut kept = kept.into_iter();
    poses.views.retain(|_| kept.next() == Some(true));
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
fn cache_warning(
    photographs: &[Photograph<ViewImage>],
    options: &LoadOptions,
) -> Option<SceneWarning> {
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

/// `points` with their observations where the rectified images show them.
fn rectified_points(
    mut points: Vec<SparsePoint>,
    rectifications: &[Rectification],
) -> Vec<SparsePoint> {
    points.par_iter_mut().for_each(|point| {
        point.observations = (point.observations.iter())
            .filter_map(|&Observation { view, pixel }| {
                let pixel = rectifications.get(view)?.point(&pixel)?;
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
