//! From posed images to views: 2D wireframes and photographs, read alike for all
//! layouts.

use super::photograph::{self, Photograph};
use super::poses::{PosedImage, Poses};
use super::rectify::Rectification;
use super::turn::Turn;
use super::{HAWP_DIR, LoadOptions, SceneWarning, images};
use crate::file_cache::FileCache;
use crate::scene::check_image_size;
use crate::{Camera, ImageStore, SceneError, View, ViewError, ViewImage, Wireframe2d, hawp_json};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use tracing::debug;

/// What reads the views of a scene.
pub(super) struct ViewReader<'a> {
    options: &'a LoadOptions,
    /// The images, each with what is done to its photograph.
    images: Vec<(&'a PosedImage, Rectification)>,
    pixel_center: f64,
    hawp_dir: PathBuf,
    /// Memory that reading one photograph takes at most, in bytes.
    pub bytes_each: u64,
}

/// The camera of every photograph, and how it is turned.
///
/// # Errors
/// If an image cannot be read, differs in size from what its pose says or from others of
/// the same intrinsics, or its intrinsics or pose cannot be used.
pub(super) fn cameras(poses: &Poses) -> Result<(Vec<Camera>, Vec<Turn>), SceneError> {
    let read = try_par_map(&poses.views, |posed| {
        let (stored, said) = images::read_size_and_orientation(&posed.image)?;
        let turn = Turn::new(posed, stored, said);
        Ok((camera_of(posed, turn.size(stored), &poses.path)?, turn))
    })?;
    let (cameras, turns): (Vec<Camera>, Vec<Turn>) = read.into_iter().unzip();
    check_shared_intrinsics(poses, &cameras)?;
    Ok((cameras, turns))
}

/// Errs where the same intrinsics are those of photographs of several sizes, of which the
/// file of the poses says none: they can suit one size only, and the rarer ones are refused.
fn check_shared_intrinsics(poses: &Poses, cameras: &[Camera]) -> Result<(), SceneError> {
    let size = |camera: &Camera| (camera.width, camera.height);
    let key = |camera: &Camera| {
        let k = &camera.intrinsics;
        [k.fx, k.fy, k.cx, k.cy, k.skew].map(f64::to_bits)
    };
    let views = poses.views.iter().zip(cameras);
    let views = views.filter(|(posed, _)| posed.size.is_none());
    let mut sizes: BTreeMap<[u64; 5], BTreeMap<(u32, u32), usize>> = BTreeMap::new();
    for (_, camera) in views.clone() {
        *sizes
            .entry(key(camera))
            .or_default()
            .entry(size(camera))
            .or_default() += 1;
    }
    for (posed, camera) in views {
        let of_shared = sizes[&key(camera)].iter();
        if let Some((usual, _)) = of_shared.max_by_key(|(_, views)| **views) {
            check_image_size("camera", *usual, size(camera))
                .map_err(|problem| SceneError::view(&poses.path, &posed.name, problem))?;
        }
    }
    Ok(())
}

impl<'a> ViewReader<'a> {
    /// For the images of the scene in `dir`, whose photographs have these cameras and are
    /// turned so.
    ///
    /// # Errors
    /// If a lens cannot be undistorted, or one photograph alone takes more memory than
    /// there may be.
    pub fn new(
        dir: &Path,
        options: &'a LoadOptions,
        poses: &'a Poses,
        (cameras, turns): (Vec<Camera>, Vec<Turn>),
        pixel_center: f64,
    ) -> Result<Self, SceneError> {
        let posed: Vec<_> = poses.views.iter().zip(cameras).zip(turns).collect();
        let images = try_par_map(&posed, |&((posed, camera), turn)| {
            Rectification::new(posed, camera, pixel_center, options.max_image_size)
                .map(|rectification| rectification.of_turned(turn.to_apply()))
                .map(|rectification| (posed, rectification))
                .map_err(|problem| SceneError::view(&poses.path, &posed.name, problem))
        })?;
        let sizes = images.iter().map(|(_, image)| image.photograph_size());
        let limit = options.memory_limit;
        let bytes_each =
            limit.bytes_each(sizes, photograph::BYTES_PER_PIXEL, "reading an image", dir)?;
        Ok(Self {
            options,
            images,
            pixel_center,
            hawp_dir: dir.join(HAWP_DIR),
            bytes_each,
        })
    }

    /// Reads wireframes and photographs, and says what was done to them.
    ///
    /// # Errors
    /// The first in the order of the views.
    pub fn read(&self, warnings: &mut Vec<SceneWarning>) -> Result<Vec<View>, SceneError> {
        let wireframes = try_par_map(&self.images, |image| self.wireframe(image))?;
        let photographs = self.photographs()?;
        debug!(
            images = photographs.len(),
            in_file = photographs.iter().any(|view| view.image.is_in_file()),
            from_cache = photographs.iter().filter(|view| view.was_cached).count(),
            "photographs read"
        );
        warnings.extend(self.undistorted());
        warnings.extend(self.scaled_down());
        warnings.extend(self.not_cached(&photographs));
        let read = self.images.iter().zip(photographs).zip(wireframes);
        read.map(|(((posed, rectification), photograph), wireframe)| {
            let view = View {
                name: posed.name.clone(),
                camera: rectification.camera(),
                wireframe,
                image: photograph.image,
            };
            view.validate()
                .map_err(|problem| SceneError::view(&self.hawp_dir, &view.name, problem))?;
            Ok(view)
        })
        .collect()
    }

    /// What was done to the photographs.
    pub fn into_rectifications(self) -> Vec<Rectification> {
        let images = self.images.into_iter();
        images.map(|(_, rectification)| rectification).collect()
    }

    fn wireframe(
        &self,
        (posed, rectification): &(&PosedImage, Rectification),
    ) -> Result<Wireframe2d, SceneError> {
        let path = self.hawp_dir.join(format!("{}.json", posed.name));
        if !self.options.require_wireframes && !path.exists() {
            let (width, height) = rectification.size();
            return Ok(Wireframe2d::empty(width, height));
        }
        rectification
            .wireframe(hawp_json::read(&path, self.pixel_center)?)
            .map_err(|problem| SceneError::view(&self.hawp_dir, &posed.name, problem))
    }

    fn photographs(&self) -> Result<Vec<Photograph<ViewImage>>, SceneError> {
        let options = self.options;
        let cache = options.cache_dir.as_ref().map(FileCache::new);
        let sizes = self.images.iter().map(|(_, image)| image.size());
        let limit = options.memory_limit;
        let store = ImageStore::for_images(sizes, limit, options.cache_dir.as_deref())?;
        limit.try_map(&self.images, self.bytes_each, |(posed, rectification)| {
            let background = options.background;
            photograph::read(posed, rectification, background, cache.as_ref())?
                .kept_in(&store, posed)
        })
    }

    fn undistorted(&self) -> Option<SceneWarning> {
        let lenses = self.images.iter().filter_map(|(_, image)| image.lens());
        let mut lenses: Vec<_> = lenses.collect();
        let views = lenses.len();
        lenses.sort_unstable();
        lenses.dedup();
        (views > 0).then_some(SceneWarning::Undistorted { lenses, views })
    }

    fn scaled_down(&self) -> Option<SceneWarning> {
        let max_image_size = self.options.max_image_size?;
        let scaled = self.images.iter().filter(|(_, image)| image.scales_down());
        let views = scaled.count();
        (views > 0).then_some(SceneWarning::ScaledDown {
            max_image_size,
            views,
        })
    }

    /// The first reason why an image is not in the cache.
    fn not_cached(&self, photographs: &[Photograph<ViewImage>]) -> Option<SceneWarning> {
        let mut errors = photographs
            .iter()
            .filter_map(|view| view.not_cached.as_ref());
        let error = errors.next()?;
        let reason = (error.source()).map_or_else(|| error.to_string(), ToString::to_string);
        let dir = self.options.cache_dir.clone()?;
        Some(SceneWarning::NotCached { dir, reason })
    }
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
        .map_err(|problem| SceneError::view(path, &posed.name, problem))
}

/// Maps in parallel; of several errors the first in order is returned.
fn try_par_map<T: Sync, U: Send>(
    items: &[T],
    f: impl Fn(&T) -> Result<U, SceneError> + Sync + Send,
) -> Result<Vec<U>, SceneError> {
    let results: Vec<_> = items.par_iter().map(f).collect();
    results.into_iter().collect()
}
