//! Masks on disk: which pixels show the object.
//!
//! `mask/` or `masks/` with one image per view, by name or else, where there are
//! as many, by order; bright pixels show the object. Without such a folder the
//! opaque pixels of images with transparency do.

use super::images;
use super::poses::PosedImage;
use crate::visual_hull::Mask;
use crate::{MemoryLimit, SceneError, file, hawp_json::file_stem, image_file};
use image::{GrayImage, imageops};
use std::path::{Path, PathBuf};

const DIRS: [&str; 2] = ["mask", "masks"];
/// Cells along the longer side of a [`Mask`].
const CELLS: u32 = 256;
/// Brighter pixels show the object.
const BRIGHT: u8 = 127;

/// The masks of all views.
pub(super) struct MaskFiles {
    /// One file per view.
    pub files: Vec<PathBuf>,
    /// What of them shows the object.
    by: Shown,
    room: Room,
}

/// Memory to read masks in.
#[derive(Clone, Copy)]
pub(super) struct Room {
    /// For all that are read at once.
    pub limit: MemoryLimit,
    /// What one of them takes: about as much as a photograph.
    pub bytes_each: u64,
}

#[derive(Clone, Copy)]
enum Shown {
    /// Bright pixels.
    Brightness,
    /// Opaque pixels.
    Opacity,
}

/// The file with the mask of each view. `None` unless every view has one.
pub(super) fn find(dir: &Path, views: &[PosedImage], room: Room) -> Option<MaskFiles> {
    let bright = |files| MaskFiles {
        files,
        by: Shown::Brightness,
        room,
    };
    for folder in DIRS.map(|name| dir.join(name)) {
        let Ok(files) = images::list(&folder) else {
            continue;
        };
        let named = |view: &PosedImage| {
            let file = files.iter().find(|file| file_stem(file) == view.name)?;
            Some(file.clone())
        };
        if let Some(masks) = views.iter().map(named).collect() {
            return Some(bright(masks));
        }
        if files.len() == views.len() {
            return Some(bright(files));
        }
    }
    let transparent = |view: &PosedImage| {
        let has_alpha = images::has_alpha(&view.image).unwrap_or(false);
        has_alpha.then(|| view.image.clone())
    };
    let files = views.iter().map(transparent).collect::<Option<_>>()?;
    Some(MaskFiles {
        files,
        by: Shown::Opacity,
        room,
    })
}

/// Reads the masks. `None` if they hide nothing: many programs write images with an
/// alpha channel that is opaque everywhere.
pub(super) fn read(masks: &MaskFiles) -> Result<Option<Vec<Mask>>, SceneError> {
    let Room { limit, bytes_each } = masks.room;
    let read = limit.try_map(&masks.files, bytes_each, |path| read_one(path, masks.by))?;
    let hides_something = read.iter().any(|mask| mask.inside.contains(&false));
    Ok(hides_something.then_some(read))
}

fn read_one(path: &Path, by: Shown) -> Result<Mask, SceneError> {
    let bytes = file::read(path, "put the mask there")?;
    let image = image_file::decode(&bytes, path, u32::MAX)?;
    let gray = match by {
        Shown::Brightness => image.into_luma8(),
        Shown::Opacity => {
            let rgba = image.into_rgba8();
            GrayImage::from_fn(rgba.width(), rgba.height(), |x, y| {
                image::Luma([rgba.get_pixel(x, y)[3]])
            })
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Distortion, Intrinsics};
    use image::{GrayAlphaImage, LumaA, Rgba, RgbaImage};
    use nalgebra::Matrix4;
    use std::fs;

    const ROOM: Room = Room {
        limit: MemoryLimit::NONE,
        bytes_each: 0,
    };

    fn view(image: PathBuf) -> PosedImage {
        PosedImage {
            name: file_stem(&image),
            image,
            intrinsics: Intrinsics::centered(100.0, (8, 4)),
            distortion: Distortion::None,
            world_from_camera: Matrix4::identity(),
            size: None,
        }
    }

    #[test]
    fn opaque_images_are_no_masks_and_transparent_ones_are() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let mut image = RgbaImage::from_pixel(8, 4, Rgba([9, 9, 9, 255]));
        image.save(&path).unwrap();
        let views = [view(path.clone())];
        let found = find(dir.path(), &views, ROOM).unwrap();
        assert_eq!(read(&found).unwrap(), None);

        image.put_pixel(7, 0, Rgba([9, 9, 9, 0]));
        image.save(&path).unwrap();
        let mask = read(&find(dir.path(), &views, ROOM).unwrap())
            .unwrap()
            .unwrap();
        assert_eq!(mask[0].inside.iter().filter(|inside| !**inside).count(), 1);

        // A file of masks counts by its brightness, also with an alpha channel.
        fs::create_dir(dir.path().join("mask")).unwrap();
        let mut mask = GrayAlphaImage::from_pixel(8, 4, LumaA([0, 255]));
        mask.put_pixel(2, 1, LumaA([255, 255]));
        mask.save(dir.path().join("mask/a.png")).unwrap();
        let mask = read(&find(dir.path(), &views, ROOM).unwrap())
            .unwrap()
            .unwrap();
        assert_eq!(mask[0].inside.iter().filter(|inside| **inside).count(), 1);
    }
}
