//! Images of strangers: decoded only where the file can hold what it claims.
//!
//! The header of a PNG or JPEG file names a width and a height before any pixel
//! follows, and decoders allocate what it names. A few bytes must not cost
//! gigabytes, so the claim is compared with the length of the file first.

use crate::{SceneError, file};
use image::{DynamicImage, ImageDecoder, ImageError, ImageReader, ImageResult, Limits};
use std::io::{self, BufRead, BufReader, Cursor, Seek};
use std::path::Path;

/// Pixels that one byte of a file can stand for. Deflate packs 1032 bytes into one,
/// each of up to eight pixels; a JPEG block of 64 pixels takes a bit at least.
const MAX_PIXELS_PER_BYTE: u64 = 1 << 14;

/// Decodes the bytes of an image of at most `max_side` pixels a side; `path` is for
/// messages.
///
/// # Errors
/// If they are no image, are truncated, claim more pixels than they can hold, or the
/// pixels would take more than 512 MiB.
pub fn decode(bytes: &[u8], path: &Path, max_side: u32) -> Result<DynamicImage, SceneError> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    reader
        .map_err(ImageError::IoError)
        .and_then(|reader| {
            DynamicImage::from_decoder(decoder(reader, bytes.len() as u64, max_side)?)
        })
        .map_err(|source| SceneError::image(path, source))
}

/// What the header of an image file says, through `describe`. Pixels are not
/// decoded.
///
/// # Errors
/// As [`decode`], or if the file is missing (the message then gives `remedy`), is no
/// regular file, or is larger than [`file::MAX_FILE_BYTES`].
pub(crate) fn header<T>(
    path: &Path,
    remedy: &str,
    describe: impl FnOnce(&mut dyn ImageDecoder) -> T,
) -> Result<T, SceneError> {
    let (opened, length) = file::open(path, remedy)?;
    let reader = ImageReader::new(BufReader::new(opened)).with_guessed_format();
    reader
        .map_err(ImageError::IoError)
        .and_then(|reader| Ok(describe(&mut decoder(reader, length, u32::MAX)?)))
        .map_err(|source| SceneError::image(path, source))
}

/// The decoder of a file of `length` bytes, if its claims can be true.
fn decoder<'a, R: BufRead + Seek + 'a>(
    mut reader: ImageReader<R>,
    length: u64,
    max_side: u32,
) -> ImageResult<impl ImageDecoder + use<'a, R>> {
    let mut limits = Limits::default();
    limits.max_image_width = Some(max_side);
    limits.max_image_height = Some(max_side);
    reader.limits(limits.clone());
    let mut decoder = reader.into_decoder()?;
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > length.saturating_mul(MAX_PIXELS_PER_BYTE) {
        let claim = format!("its {length} bytes cannot hold {width}×{height} pixels");
        return Err(io::Error::new(io::ErrorKind::InvalidData, claim).into());
    }
    limits.reserve(decoder.total_bytes())?;
    decoder.set_limits(limits)?;
    Ok(decoder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::damaged;
    use image::{GrayImage, ImageFormat, Luma, RgbImage};
    use proptest::prelude::*;
    use std::error::Error;

    fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    fn small(format: ImageFormat) -> Vec<u8> {
        let image = RgbImage::from_fn(9, 7, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 7]));
        encoded(&image.into(), format)
    }

    fn parse(bytes: &[u8]) -> Result<DynamicImage, SceneError> {
        decode(bytes, Path::new("a.png"), u32::MAX)
    }

    /// A PNG whose header is right but claims another size.
    fn png_of_size(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = small(ImageFormat::Png);
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        let checksum = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&checksum);
        bytes
    }

    /// CRC-32 as PNG asks for it, bit by bit.
    fn crc32(bytes: &[u8]) -> [u8; 4] {
        let step = |crc: u32| (crc >> 1) ^ (0xedb8_8320 * (crc & 1));
        let crc = bytes.iter().fold(u32::MAX, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| step(crc))
        });
        (!crc).to_be_bytes()
    }

    #[test]
    fn claims_beyond_the_file_are_refused_and_uniform_images_are_not() {
        assert_eq!(parse(&png_of_size(9, 7)).unwrap().width(), 9);
        for (width, height, reason) in [
            (12_000, 12_000, "cannot hold"),
            (u32::MAX >> 1, u32::MAX >> 1, "limit"),
        ] {
            let error = parse(&png_of_size(width, height)).unwrap_err();
            let cause = error.source().unwrap().to_string();
            assert!(cause.contains(reason), "{cause}");
        }
        // The most that a file can legitimately hold per byte.
        let black = GrayImage::from_pixel(4000, 3000, Luma([0]));
        let bytes = encoded(&black.into(), ImageFormat::Png);
        assert_eq!(parse(&bytes).unwrap().width(), 4000);
        let gray = RgbImage::from_pixel(4000, 3000, image::Rgb([128; 3]));
        let bytes = encoded(&gray.into(), ImageFormat::Jpeg);
        assert_eq!(parse(&bytes).unwrap().width(), 4000);
        assert!(decode(&bytes, Path::new("a.jpg"), 3999).is_err());
    }

    proptest! {
        #[test]
        fn damaged_images_do_not_panic(
            png in damaged(small(ImageFormat::Png)), jpeg in damaged(small(ImageFormat::Jpeg)),
        ) {
            for bytes in [png, jpeg] {
                let length = bytes.len() as u64;
                if let Ok(image) = parse(&bytes) {
                    let pixels = u64::from(image.width()) * u64::from(image.height());
                    prop_assert!(pixels <= length * MAX_PIXELS_PER_BYTE);
                }
            }
        }
    }
}
