//! Masks on disk: which pixels show the object.
//!
//! `mask/` or `masks/` with one image per view, by name or else, where there are
//! as many, by order; bright pixels show the object. Without such a folder the
//! opaque pixels of images with transparency do.

use super::images;
use super::poses::PosedImage;
use crate::scene_sphere::Mask;
use crate::{SceneError, hawp_json::file_stem};
use image::{GrayImage, ImageReader, imageops};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

const DIRS: [&str; 2] = ["mask", "masks"];
/// Cells along the longer side of a [`Mask`].
const CELLS: u32 = 256;
/// Brighter pixels show the object.
const BRIGHT: u8 = 127;

/// The file with the mask of each view. `None` unless every view has one.
pub(super) fn find(dir: &Path, views: &[PosedImage]) -> Option<Vec<PathBuf>> {
    for folder in DIRS.map(|name| dir.join(name)) {
        let Ok(files) = images::list(&folder) else {
            continue;
        };
        let named = |view: &PosedImage| {
            let file = files.iter().find(|file| file_stem(file) == view.name)?;
            Some(file.clone())
        };
        if let Some(masks) = views.iter().map(named).collect() {
            return Some(masks);
        }
        if files.len() == views.len() {
            return Some(files);
        }
    }
    let transparent = |view: &PosedImage| {
        let has_alpha = images::has_alpha(&view.image).unwrap_or(false);
        has_alpha.then(|| view.image.clone())
    };
    views.iter().map(transparent).collect()
}

/// Reads the masks in `files`.
pub(super) fn read(files: &[PathBuf]) -> Result<Vec<Mask>, SceneError> {
    let masks: Vec<_> = files.par_iter().map(|path| read_one(path)).collect();
    masks.into_iter().collect()
}

fn read_one(path: &Path) -> Result<Mask, SceneError> {
    let image = ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(|source| crate::file::read_error(path, "put the mask there", source))?
        .decode()
        .map_err(|source| SceneError::Image {
            path: path.into(),
            source,
        })?;
    let gray = match image.color().has_alpha() {
        true => {
            let rgba = image.into_rgba8();
            GrayImage::from_fn(rgba.width(), rgba.height(), |x, y| {
                image::Luma([rgba.get_pixel(x, y)[3]])
            })
        }
        false => image.into_luma8(),
    };
    let (width, height) = gray.dimensions();
    let scale = f64::from(CELLS) / f64::from(width.max(height));
    let cells = |pixels: u32| ((f64::from(pixels) * scale).round() as u32).clamp(1, pixels.max(1));
    let small = imageops::thumbnail(&gray, cells(width), cells(height));
    Ok(Mask {
        size: (small.width() as usize, small.height() as usize),
        inside: small.pixels().map(|pixel| pixel[0] > BRIGHT).collect(),
    })
}
