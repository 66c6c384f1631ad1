//! What lies behind the object in the photographs, and what follows from it.

use crate::config::{BackEnd, Config};
use image::RgbImage;
use neat_core::{MemoryLimit, Scene, SceneError};
use serde::{Deserialize, Serialize};

/// What lies behind the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Background {
    /// Told by the borders of the images.
    Auto,
    /// Black: empty space has no colour, and silhouettes are known.
    Black,
    /// Anything: a photograph. The border of the scene sphere stands for all that
    /// is behind it, as in VolSDF, and there are no silhouettes.
    Photo,
}

/// A pixel is black if no channel exceeds this: compressed images are not exact.
const BLACK: u8 = 20;
/// So much of the border of an image is black where its background is.
const BLACK_BORDER: f64 = 0.9;
/// And so many of the views are of that kind: objects may touch the border.
const BLACK_VIEWS: f64 = 0.5;
/// Slope of the sphere's distance, as published for DTU.
const SPHERE_SLOPE: f64 = 20.0;

/// Makes `config` fit the background of `scene`: decides [`Background::Auto`], and
/// for a photograph puts the border of the sphere behind the scene and drops the
/// silhouette term; and [`BackEnd::Auto`]. A configuration without
/// `data.background` stays as it is.
///
/// # Errors
/// If an image lies in a file that cannot be read.
pub(crate) fn fit_background(
    config: &mut Config,
    scene: &Scene,
    memory_limit: MemoryLimit,
) -> Result<(), SceneError> {
    let background = match config.data.background {
        None => return Ok(()),
        Some(Background::Auto) if is_black(scene, memory_limit)? => Background::Black,
        Some(Background::Auto) => Background::Photo,
        Some(known) => known,
    };
    config.data.background = Some(background);
    if config.distill.back_end == BackEnd::Auto {
        config.distill.back_end = match background {
            Background::Photo => BackEnd::Tracks,
            Background::Auto | Background::Black => BackEnd::Fast,
        };
    }
    if background == Background::Photo {
        config.train.loss.mask = 0.0;
        if config.model.implicit.bounding_sphere_slope == 0.0 {
            config.model.implicit.bounding_sphere_slope = SPHERE_SLOPE;
        }
    }
    Ok(())
}

fn is_black(scene: &Scene, memory_limit: MemoryLimit) -> Result<bool, SceneError> {
    let bytes_each = scene.views.iter().map(|view| view.image.byte_len()).max();
    let black = memory_limit.try_map(&scene.views, bytes_each.unwrap_or(0), |view| {
        Ok(black_border(&*view.image.read()?) >= BLACK_BORDER)
    })?;
    let black = black.into_iter().filter(|is_black| *is_black).count();
    Ok(black as f64 >= BLACK_VIEWS * scene.views.len() as f64)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;
    use neat_core::synthetic::{SyntheticScene, generate};

    #[test]
    fn photographs_get_a_sphere_behind_them() {
        let small = SyntheticScene {
            views: 4,
            image_size: 48,
            min_visible_length: 2.0,
            ..SyntheticScene::default()
        };
        let mut scene = generate(&small).unwrap().scene;
        let preset = Preset::Fast.config();

        let mut config = preset.clone();
        fit_background(&mut config, &scene, MemoryLimit::NONE).unwrap();
        assert_eq!(config.data.background, Some(Background::Black));
        assert_eq!(config.distill.back_end, BackEnd::Fast);
        assert_eq!(config.train, preset.train);
        assert_eq!(config.model, preset.model);

        for view in &mut scene.views {
            let mut image = view.image.read().unwrap().into_owned();
            for pixel in image.pixels_mut() {
                pixel.0 = pixel.0.map(|c| c.max(90));
            }
            view.image = image.into();
        }
        let mut config = preset.clone();
        fit_background(&mut config, &scene, MemoryLimit::NONE).unwrap();
        assert_eq!(config.data.background, Some(Background::Photo));
        assert_eq!(config.distill.back_end, BackEnd::Tracks);
        assert_eq!(config.train.loss.mask, 0.0);
        assert_eq!(config.model.implicit.bounding_sphere_slope, SPHERE_SLOPE);
        // A decided configuration stays, and so does a published one.
        let decided = config.clone();
        fit_background(&mut config, &scene, MemoryLimit::NONE).unwrap();
        assert_eq!(config, decided);
        let mut published = Preset::PaperDtu.config();
        fit_background(&mut published, &scene, MemoryLimit::NONE).unwrap();
        assert_eq!(published, Preset::PaperDtu.config());
    }
}
