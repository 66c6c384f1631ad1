//! Images on disk.

use crate::{SceneError, file, hawp_json::file_stem};
use image::{DynamicImage, ImageReader, RgbImage};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// The endings of the images that are read.
pub(super) const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// The images in a folder, sorted by file name. Hidden files are no images.
pub(super) fn list(dir: &Path) -> Result<Vec<PathBuf>, SceneError> {
    let read_error = |source: io::Error| {
        file::read_error(dir, "a scene needs this folder with its images", source)
    };
    let mut images = Vec::new();
    for entry in fs::read_dir(dir).map_err(read_error)? {
        let path = entry.map_err(read_error)?.path();
        if is_image(&path) {
            images.push(path);
        }
    }
    images.sort();
    Ok(images)
}

fn is_image(path: &Path) -> bool {
    has_known_ending(path) && !file_stem(path).starts_with('.')
}

/// Whether the name ends as one of an image, in either case.
pub(super) fn has_known_ending(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    ENDINGS
        .iter()
        .any(|known| ending.eq_ignore_ascii_case(known))
}

/// What to do about a missing image.
const REMEDY: &str = "put the image there or remove its pose";

/// Width and height, from the first bytes of an image.
pub(super) fn read_size(path: &Path) -> Result<(u32, u32), SceneError> {
    ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(|source| file::read_error(path, REMEDY, source))?
        .into_dimensions()
        .map_err(|source| SceneError::Image {
            path: path.into(),
            source,
        })
}

/// `image`, or where it does not exist the same with another ending that does:
/// data sets are often passed on with their images converted.
pub(super) fn with_existing_ending(image: PathBuf) -> PathBuf {
    if image.exists() {
        return image;
    }
    let mut others = ENDINGS.iter().map(|ending| image.with_extension(ending));
    others.find(|other| other.exists()).unwrap_or(image)
}

/// The bytes of an image's file.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, SceneError> {
    file::read(path, REMEDY)
}

/// Decodes the bytes of an image; transparent pixels are blended with
/// `background`. `path` is for messages.
pub(super) fn decode_rgb(
    bytes: &[u8],
    path: &Path,
    background: [u8; 3],
) -> Result<RgbImage, SceneError> {
    let error = |source| SceneError::Image {
        path: path.into(),
        source,
    };
    // By its first bytes: endings of converted data sets are not to be trusted.
    let image = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|source| error(source.into()))?
        .decode()
        .map_err(error)?;
    if image.color().has_alpha() {
        return Ok(blend(&image, background));
    }
    Ok(image.into_rgb8())
}

fn blend(image: &DynamicImage, background: [u8; 3]) -> RgbImage {
    let rgba = image.to_rgba8();
    RgbImage::from_fn(rgba.width(), rgba.height(), |x, y| {
        let [r, g, b, alpha] = rgba.get_pixel(x, y).0;
        let over = |front: u8, back: u8| {
            let alpha = u32::from(alpha);
            let sum = u32::from(front) * alpha + u32::from(back) * (255 - alpha);
            // At most 255 · 255 / 255, rounded.
            ((sum + 127) / 255) as u8
        };
        image::Rgb([
            over(r, background[0]),
            over(g, background[1]),
            over(b, background[2]),
        ])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transparency_shows_the_background() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let mut rgba = image::RgbaImage::new(3, 1);
        rgba.put_pixel(0, 0, image::Rgba([200, 100, 50, 255]));
        rgba.put_pixel(1, 0, image::Rgba([200, 100, 50, 0]));
        rgba.put_pixel(2, 0, image::Rgba([255, 255, 255, 51]));
        rgba.save(&path).unwrap();
        let bytes = read_bytes(&path).unwrap();
        let rgb = decode_rgb(&bytes, &path, [10, 20, 30]).unwrap();
        assert_eq!(rgb.into_raw(), [200, 100, 50, 10, 20, 30, 59, 67, 75]);
    }

    #[test]
    fn listing_is_sorted_and_skips_other_files() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["b.PNG", "a.jpg", ".a.png", "notes.txt", "c.jpeg"] {
            fs::write(dir.path().join(name), b"x").unwrap();
        }
        let names: Vec<_> = list(dir.path())
            .unwrap()
            .iter()
            .map(|p| file_stem(p))
            .collect();
        assert_eq!(names, ["a", "b", "c"]);
        assert!(matches!(
            list(&dir.path().join("none")),
            Err(SceneError::Missing { .. })
        ));
    }
}
