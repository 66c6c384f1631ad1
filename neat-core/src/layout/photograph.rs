//! The image of a view: its photograph, decoded and rectified, or what an earlier
//! run has kept of that.

use super::images;
use super::poses::PosedImage;
use super::rectify::Rectification;
use crate::file_cache::{CacheKey, FileCache};
use crate::{ImageStore, SceneError, ViewImage};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ImageFormat, RgbImage};

/// The kind of the results in the cache.
const KIND: &str = "undistorted";
/// To be raised whenever the same photograph and lens give another image.
const VERSION: u32 = 1;

/// An image, whether it was in the cache, and why it is not there now though it should
/// be.
pub(super) struct Photograph<Image = RgbImage> {
    pub image: Image,
    pub was_cached: bool,
    pub not_cached: Option<SceneError>,
}

/// What reading takes, in bytes for each pixel of the photograph: its file, what it is
/// decoded to, the undistorted image, and its copy for the cache. Through a lens 6 were
/// measured with files that are small; files of noise and transparency take up to 10 more.
pub(super) const BYTES_PER_PIXEL: u64 = 16;

impl Photograph {
    /// With the image in `store`.
    ///
    /// # Errors
    /// If its file cannot be written.
    pub fn kept_in(
        self,
        store: &ImageStore,
        posed: &PosedImage,
    ) -> Result<Photograph<ViewImage>, SceneError> {
        Ok(Photograph {
            image: store.keep(&posed.name, self.image)?,
            was_cached: self.was_cached,
            not_cached: self.not_cached,
        })
    }
}

/// Reads and rectifies the photograph of `posed`. Transparent pixels show
/// `background`. Images that are undistorted are looked for in `cache`, and kept
/// there; decoding others is as fast as that.
///
/// # Errors
/// If the photograph cannot be read.
pub(super) fn read(
    posed: &PosedImage,
    rectification: &Rectification,
    background: [u8; 3],
    cache: Option<&FileCache>,
) -> Result<Photograph, SceneError> {
    let bytes = images::read_bytes(&posed.image)?;
    let rectify = || {
        let photograph = images::decode_rgb(&bytes, &posed.image, background)?;
        rectification
            .image(photograph)
            .map_err(|problem| SceneError::view(&posed.image, &posed.name, problem))
    };
    let photograph = |image, was_cached, not_cached| Photograph {
        image,
        was_cached,
        not_cached,
    };
    let Some(cache) = cache.filter(|_| rectification.lens().is_some()) else {
        return Ok(photograph(rectify()?, false, None));
    };
    let key = key(&bytes, rectification, background);
    if let Some(image) = cached(cache, &key, rectification.size()) {
        return Ok(photograph(image, true, None));
    }
    let image = rectify()?;
    let not_cached = png(&image)
        .map_err(|source| SceneError::image(cache.dir(), source))
        .and_then(|png| cache.put(&key, &png))
        .err();
    Ok(photograph(image, false, not_cached))
}

/// The key of the image that `rectification` makes of the file `bytes`.
pub(super) fn key(bytes: &[u8], rectification: &Rectification, background: [u8; 3]) -> CacheKey {
    CacheKey::new(KIND, VERSION, &[bytes, &background, &rectification.key()])
}

/// The cached image, if it is one of this size.
fn cached(cache: &FileCache, key: &CacheKey, size: (u32, u32)) -> Option<RgbImage> {
    let png = cache.get(key)?;
    let image = image::load_from_memory_with_format(&png, ImageFormat::Png).ok()?;
    (image.width(), image.height())
        .eq(&size)
        .then(|| image.into_rgb8())
}

/// A PNG that is quick to write and to read.
pub(super) fn png(image: &RgbImage) -> image::ImageResult<Vec<u8>> {
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Up);
    image.write_with_encoder(encoder)?;
    Ok(bytes)
}
