//! Images on disk.

use crate::{SceneError, file, hawp_json::file_stem, image_file};
use image::metadata::Orientation;
use image::{DynamicImage, ImageError, ImageFormat, RgbImage};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// The endings of the images that are read.
pub(super) const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// The first of these files of the folder `dir` that is there.
pub(super) fn first_of(dir: &Path, names: &[&str]) -> Option<PathBuf> {
    let mut paths = names.iter().map(|name| dir.join(name));
    paths.find(|path| path.is_file())
}

/// The first file by name in `dir` with this ending. Hidden files do not count,
/// nor do the files of a folder that cannot be read.
pub(super) fn first_with_ending(dir: &Path, ending: &str) -> Option<PathBuf> {
    let files = fs::read_dir(dir).into_iter().flatten().flatten();
    let matches = |path: &PathBuf| {
        path.extension()
            .is_some_and(|found| found.eq_ignore_ascii_case(ending))
            && !file_stem(path).starts_with('.')
            && path.is_file()
    };
    files.map(|entry| entry.path()).filter(matches).min()
}

/// The images in a folder, sorted by file name. Hidden files are no images.
///
/// # Errors
/// If the folder cannot be read.
pub fn list(dir: &Path) -> Result<Vec<PathBuf>, SceneError> {
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

/// [`read_size`], and one pixel for an image that is not there: its view will be
/// left out, or the scene refused.
pub(super) fn size_of_posed(path: &Path) -> Result<(u32, u32), SceneError> {
    if path.exists() {
        read_size(path)
    } else {
        Ok((1, 1))
    }
}

/// How a reader learns width and height of an image: [`read_size`], but for tests
/// without files.
pub(super) type ReadSize = fn(&Path) -> Result<(u32, u32), SceneError>;

/// The error about an image that is not there.
pub(super) fn missing(path: &Path) -> SceneError {
    if path.is_symlink() {
        return SceneError::missing(
            path,
            "it is a link that leads to no file: replace it by the image or remove its pose",
        );
    }
    SceneError::missing(path, REMEDY)
}

/// Whether a folder, with all below it, has less than half as many files as a list names images:
/// known before each of millions is looked for.
pub(super) fn most_are_missing(dir: &Path, images: usize) -> bool {
    let mut files = 0;
    let mut folders = vec![dir.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => folders.push(entry.path()),
                Ok(kind) if kind.is_file() => files += 1,
                // A link may lead to a folder with any number of files.
                _ => return false,
            }
            if 2 * files >= images {
                return false;
            }
        }
    }
    images > 0
}

/// Width and height, from the first bytes of an image.
///
/// # Errors
/// If it is missing or no image.
pub fn read_size(path: &Path) -> Result<(u32, u32), SceneError> {
    image_file::header(path, REMEDY, |image| image.dimensions())
}

/// Width and height of an image as it is stored, and how it says that it is to be turned.
/// An orientation that cannot be read turns nothing.
///
/// # Errors
/// As [`read_size`].
pub(super) fn read_size_and_orientation(
    path: &Path,
) -> Result<((u32, u32), Orientation), SceneError> {
    image_file::header(path, REMEDY, |image| {
        let orientation = image.orientation().unwrap_or(Orientation::NoTransforms);
        (image.dimensions(), orientation)
    })
}

/// Whether an image has transparency, from its first bytes.
pub(super) fn has_alpha(path: &Path) -> Option<bool> {
    image_file::header(path, REMEDY, |image| image.color_type().has_alpha()).ok()
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

/// Folders above an image that are looked at, from the image upward.
const MAX_FOLDERS: usize = 15;

/// The image that the file of poses `path` calls `name`, in one of the folders
/// `dirs`, of which the first is the one that the format means.
///
/// Such files come from other machines, with absolute paths, drive letters or
/// `..`. No file outside the scene is opened: only what follows the last of these
/// counts, and its leading folders are left out one by one until an image is
/// found. Where there is none, the path is that of the place to put it: for a name
/// from elsewhere the last of `dirs`.
pub(super) fn locate(path: &Path, dirs: &[PathBuf], name: &str) -> Result<PathBuf, SceneError> {
    let mut parts: Vec<&str> = name.split(['/', '\\']).collect();
    let leads_out = |part: &&str| *part == ".." || part.contains(':');
    let start = parts.iter().rposition(leads_out).map_or(0, |at| at + 1);
    let is_from_elsewhere = start > 0 || name.starts_with(['/', '\\']);
    parts.drain(..start);
    parts.retain(|part| !part.is_empty() && *part != ".");
    let (Some(file_name), Some(first_dir), Some(last_dir)) =
        (parts.last(), dirs.first(), dirs.last())
    else {
        return Err(SceneError::ViewName {
            path: path.into(),
            view: name.into(),
            reason: "names no image: write the file again",
        });
    };
    for from in parts.len().saturating_sub(MAX_FOLDERS + 1)..parts.len() {
        let relative: PathBuf = parts[from..].iter().collect();
        let mut images = dirs
            .iter()
            .map(|dir| with_existing_ending(dir.join(&relative)));
        if let Some(image) = images.find(|image| image.is_file()) {
            return Ok(image);
        }
    }
    Ok(if is_from_elsewhere {
        last_dir.join(file_name)
    } else {
        first_dir.join(parts.iter().collect::<PathBuf>())
    })
}

/// The bytes of an image's file.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, SceneError> {
    file::read(path, REMEDY)
}

/// Reads an image; transparent pixels are blended with `background`.
///
/// # Errors
/// If it is missing, truncated or no image.
pub fn read_rgb(path: &Path, background: [u8; 3]) -> Result<RgbImage, SceneError> {
    decode_rgb(&read_bytes(path)?, path, background)
}

/// Decodes the bytes of an image; transparent pixels are blended with
/// `background`. `path` is for messages.
pub(super) fn decode_rgb(
    bytes: &[u8],
    path: &Path,
    background: [u8; 3],
) -> Result<RgbImage, SceneError> {
    // By its first bytes: endings of converted data sets are not to be trusted. The
    // decoder makes up what is missing.
    let is_jpeg = image::guess_format(bytes).is_ok_and(|format| format == ImageFormat::Jpeg);
    if is_jpeg && !jpeg_is_complete(bytes) {
        let error = io::Error::new(io::ErrorKind::UnexpectedEof, "the file is truncated");
        return Err(SceneError::image(path, ImageError::IoError(error)));
    }
    let image = image_file::decode(bytes, path, u32::MAX)?;
    Ok(if image.color().has_alpha() {
        blend(&image, background)
    } else {
        image.into_rgb8()
    })
}

/// Whether a JPEG file goes on to its end marker (ITU-T T.81, annex B). What
/// follows is nobody's business.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    const END: u8 = 0xd9;
    const START_OF_SCAN: u8 = 0xda;
    let mut at = 0;
    let mut in_scan = false;
    while let Some(&[first, marker]) = bytes.get(at..at + 2).and_then(|b| b.first_chunk()) {
        match (first, marker) {
            (0xff, END) => return true,
            // Zeros are stuffed, and markers of restarts put, into scans only;
            // 0xd8 starts the image, and any number of 0xff fills.
            (0xff, 0x00 | 0xd0..=0xd8) => at += 2,
            (0xff, 0xff) => at += 1,
            (0xff, marker) => {
                let Some(&length) = bytes.get(at + 2..).and_then(|b| b.first_chunk()) else {
                    return false;
                };
                in_scan = marker == START_OF_SCAN;
                at += 2 + usize::from(u16::from_be_bytes(length)).max(2);
            }
            // Decoders differ in what they take between segments; none may be
            // refused that they take.
            _ if !in_scan => return true,
            _ => at += 1,
        }
    }
    false
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
    fn images_are_located_below_the_scene_only() {
        let dir = tempfile::tempdir().unwrap();
        let scene = dir.path().join("scene");
        fs::create_dir_all(scene.join("images/left")).unwrap();
        for file in [
            "a.png",
            "scene/b.png",
            "scene/images/c.png",
            "scene/images/left/d.jpg",
        ] {
            fs::write(dir.path().join(file), b"x").unwrap();
        }
        let dirs = [scene.clone(), scene.join("images")];
        let found = |name| locate(Path::new("model"), &dirs, name).unwrap();
        for (name, expected) in [
            ("b.png", "b.png"),
            ("c.png", "images/c.png"),
            ("/home/someone/photos/images/c.png", "images/c.png"),
            (r"C:\photos\left\d.png", "images/left/d.jpg"),
            ("../elsewhere/b.png", "b.png"),
            // Not there: where it should be put, never above the scene.
            ("left/none.png", "left/none.png"),
            ("../a.png", "images/a.png"),
            ("/home/someone/none.png", "images/none.png"),
        ] {
            assert_eq!(found(name), scene.join(expected), "{name}");
        }
        for name in ["", "/", "..", "C:"] {
            assert!(locate(Path::new("model"), &dirs, name).is_err(), "{name}");
        }
    }

    #[test]
    fn truncated_jpegs_are_errors_and_trailing_bytes_are_not() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.jpg");
        let noise = |x: u32, y: u32| (x * 7919 + y * 104_729).wrapping_mul(2_654_435_761) >> 24;
        let image = RgbImage::from_fn(64, 48, |x, y| image::Rgb([noise(x, y) as u8; 3]));
        image.save(&path).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        for share in [4, 2] {
            let part = &bytes[..bytes.len() - bytes.len() / share];
            let error = decode_rgb(part, &path, [0; 3]).unwrap_err();
            assert!(matches!(error, SceneError::Image { .. }), "{error}");
        }
        bytes.extend_from_slice(b"more \xff\xda than an image");
        let image = decode_rgb(&bytes, &path, [0; 3]).unwrap();
        assert_eq!(image.dimensions(), (64, 48));
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
