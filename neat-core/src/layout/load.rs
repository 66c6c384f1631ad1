//! From a folder to a scene: poses, images and 2D wireframes, read alike for all
//! layouts.

use super::masks::{self, Room};
use super::poses::{PosedImage, Poses};
use super::rectify::Rectification;
use super::sphere::Evidence;
use super::view_reader::{self, ViewReader};
use super::{
    CameraAxes, HAWP_DIR, Layout, LoadOptions, SceneWarning, images, input_files, pixel_center,
    point_files, turn,
};
use crate::scene_sphere::SphereSource;
use crate::{Camera, Observation, Scene, SceneError, SceneSphere, SparsePoint, View, hawp_json};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use tracing::{debug, info_span};

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
    /// The axes that cameras have in files of this layout. Other than OpenCV's they were turned
    /// when they were read.
    pub file_axes: CameraAxes,
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
    let _span = info_span!("load_scene", dir = %dir.display()).entered();
    let layout = options.layout.map_or_else(|| Layout::detect(dir), Ok)?;
    let mut poses = layout.read_poses(dir)?;
    debug!(
        %layout,
        was_given = options.layout.is_some(),
        poses = %poses.path.display(),
        images = poses.views.len(),
        points = poses.points.len(),
        "poses read"
    );
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
    let mut warnings = Vec::new();
    if layout.poses_some_images() {
        warnings.extend(images_without_pose(&poses));
    }
    choose_images(dir, &mut poses, options, &mut warnings)?;
    let (cameras, turns) = view_reader::cameras(&poses)?;
    warnings.extend(turn::warnings(&poses.views, &turns));
    let pixel_center = pixel_center::choose(options.pixel_center, &poses, &cameras, &mut warnings);
    let reader = ViewReader::new(dir, options, &poses, (cameras, turns), pixel_center)?;
    let mut views = reader.read(&mut warnings)?;
    let room = Room {
        limit: options.memory_limit,
        bytes_each: reader.bytes_each,
    };
    let rectifications = reader.into_rectifications();
    rectify_points(&mut poses.points, &rectifications);
    drop_unusable(dir, &mut views, &mut poses, options, &mut warnings)?;

    let cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
    if poses.points.is_empty() {
        let convention = options.pose_convention.unwrap_or_default();
        let is_mirrored = convention.mirrored_world;
        poses.points = point_files::read(dir, &cameras, &poses.original_from_world, is_mirrored)?;
    }
    let masks = masks::find(dir, &poses.views, room);
    let sphere = Evidence {
        dir,
        masks: masks.as_ref(),
        cameras: &cameras,
        points: &poses.points,
        declared_radius: poses.declared_radius,
    }
    .sphere(options.sphere, &poses.original_from_world)?;
    debug!(views = views.len(), pixel_center, %sphere, "scene read");
    if sphere.source == SphereSource::Unknown {
        warnings.push(SceneWarning::SphereUnknown);
    }
    let files = input_files::list(dir, &poses.path, &poses.views, masks);
    warnings.extend(input_files::links_outside(dir, &files));
    let scene = Scene {
        name: scene_name(dir),
        views,
        original_from_world: poses.original_from_world,
        pixel_center,
        sphere_radius: sphere.radius,
        sparse_points: poses.points,
    }
    .centered_at(&sphere.center);
    Ok(LoadedScene {
        sphere: SceneSphere {
            center: poses.original_from_world.apply(&sphere.center),
            radius: poses.original_from_world.length_factor() * sphere.radius,
            ..sphere
        },
        files,
        file_axes: poses.file_axes,
        scene,
        layout,
        warnings,
    })
}

/// Leaves the images that are to be read. What can be refused without decoding them,
/// which takes seconds, is refused here.
fn choose_images(
    dir: &Path,
    poses: &mut Poses,
    options: &LoadOptions,
    warnings: &mut Vec<SceneWarning>,
) -> Result<(), SceneError> {
    if poses.views.is_empty() {
        return Err(SceneError::NoView { path: dir.into() });
    }
    warnings.extend(drop_missing_images(poses)?);
    if let Some(max_views) = options.max_views {
        thin_views(poses, max_views);
    }
    let hawp_dir = dir.join(HAWP_DIR);
    if options.require_wireframes && !hawp_dir.is_dir() {
        return Err(SceneError::missing(&hawp_dir, hawp_json::REMEDY));
    }
    Ok(())
}

/// Tells of images beside those of the views: reconstructions leave some out, and files of
/// poses that end early too many.
fn images_without_pose(poses: &Poses) -> Option<SceneWarning> {
    let images = || poses.views.iter().map(|view| view.image.as_path());
    // Endings play no role: data sets hold copies of their images in other formats.
    let posed: BTreeSet<PathBuf> = images().map(|image| image.with_extension("")).collect();
    let folders: BTreeSet<&Path> = images().filter_map(Path::parent).collect();
    let beside = folders.into_iter().flat_map(images::list).flatten();
    let mut without = beside.filter(|image| !posed.contains(&image.with_extension("")));
    let first = without.next()?;
    Some(SceneWarning::ImagesWithoutPose {
        first,
        images: 1 + without.count(),
    })
}

/// Leaves out the views in which nothing was detected, where that is needed.
fn drop_unusable(
    dir: &Path,
    views: &mut Vec<View>,
    poses: &mut Poses,
    options: &LoadOptions,
    warnings: &mut Vec<SceneWarning>,
) -> Result<(), SceneError> {
    let min_segment_score = options.min_segment_score;
    let mut kept = Vec::with_capacity(views.len());
    views.retain(|view| {
        let is_usable =
            !options.require_wireframes || !view.wireframe.segments(min_segment_score).is_empty();
        if !is_usable {
            warnings.push(SceneWarning::ViewWithoutSegments {
                view: view.name.clone(),
                min_segment_score,
            });
        }
        kept.push(is_usable);
        is_usable
    });
    if views.is_empty() {
        return Err(SceneError::NoUsableView {
            path: dir.into(),
            views: kept.len(),
            min_segment_score,
        });
    }
    poses.retain_views(&kept);
    Ok(())
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
        first_is_link: first.image.is_symlink(),
        views: missing.len(),
    };
    poses.retain_views(&is_there);
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
    poses.retain_views(&kept);
}

/// Moves the observations of points to where the views' images show them; what these
/// do not show is left out.
fn rectify_points(points: &mut [SparsePoint], rectifications: &[Rectification]) {
    points.par_iter_mut().for_each(|point| {
        point.observations = (point.observations.iter())
            .filter_map(|&Observation { view, pixel }| {
                let pixel = rectifications.get(view)?.point(&pixel)?;
                Some(Observation { view, pixel })
            })
            .collect();
    });
}

/// The folder's name, also for `.` and `scene/..`.
fn scene_name(dir: &Path) -> String {
    let canonical = dir.canonicalize().unwrap_or_else(|_| dir.into());
    let name = canonical.file_name().unwrap_or(canonical.as_os_str());
    name.to_string_lossy().into_owned()
}
