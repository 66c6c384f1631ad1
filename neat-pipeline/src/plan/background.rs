//! What lies behind the object in the photographs.

use crate::config::Background;
use image::RgbImage;
use neat_core::{MemoryLimit, Scene, SceneError};

/// A pixel is black if no channel exceeds this: compressed images are not exact.
const BLACK: u8 = 20;
/// So much of the border of an image is black where its background is.
const BLACK_BORDER: f64 = 0.9;
/// And so many of the views are of that kind: objects may touch the border.
const BLACK_VIEWS: f64 = 0.5;

/// What lies behind the object, told by the borders of the images, and in words by how
/// many.
///
/// # Errors
/// If an image lies in a file that cannot be read.
pub(super) fn background(
    scene: &Scene,
    memory_limit: MemoryLimit,
) -> Result<(Background, String), SceneError> {
    let bytes_each = scene.views.iter().map(|view| view.image.byte_len()).max();
    let black = memory_limit.try_map(&scene.views, bytes_each.unwrap_or(0), |view| {
        Ok(black_border(&*view.image.read()?) >= BLACK_BORDER)
    })?;
    let black = black.into_iter().filter(|is_black| *is_black).count();
    let views = scene.views.len();
    let background = if black as f64 >= BLACK_VIEWS * views as f64 {
        Background::Black
    } else {
        Background::Photo
    };
    let reason = format!("as the borders of {black} of {views} images are black");
    Ok((background, reason))
}

/// The share of the outermost pixels that are black.
fn black_border(image: &RgbImage) -> f64 {
    let (width, height) = image.dimensions();
    let rows = [0, height - 1];
    let columns = [0, width - 1];
    let horizontal = rows.iter().flat_map(|&y| (0..width).map(move |x| (x, y)));
    let vertical = columns
        .iter()
        .flat_map(|&x| (0..height).map(move |y| (x, y)));
    let (mut black, mut all) = (0, 0);
    for (x, y) in horizontal.chain(vertical) {
        all += 1;
        black += u32::from(image.get_pixel(x, y).0.iter().all(|&c| c <= BLACK));
    }
    f64::from(black) / f64::from(all)
}
