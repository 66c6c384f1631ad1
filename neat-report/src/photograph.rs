//! Small copies of photographs, for some of the views.

use crate::ReportError;
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use nalgebra::Vector3;
use neat_core::{Downscaling, Scene, View};
use rayon::prelude::*;

/// How many photographs a report has, and how large they are. There may be more settings
/// one day: write `..PhotographConfig::default()`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PhotographConfig {
    /// At most so many photographs, of views that are spread over the scene; 0 for
    /// none. The other views show their 2D segments on grey.
    pub max_photographs: usize,
    /// Their longer side has at most so many pixels.
    pub max_size: u32,
    /// JPEG quality, from 1 to 100.
    pub quality: u8,
}

impl Default for PhotographConfig {
    fn default() -> Self {
        Self {
            max_photographs: 24,
            max_size: 640,
            quality: 70,
        }
    }
}

/// A photograph as JPEG, perhaps smaller than the image that the camera speaks of;
/// the corners of both are the same points.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Photograph {
    /// The content of a JPEG file.
    pub jpeg: Vec<u8>,
    /// Its width in pixels.
    pub width: u32,
    /// Its height in pixels.
    pub height: u32,
}

impl Photograph {
    /// A copy of an image.
    ///
    /// # Errors
    /// If it has no pixels or more than a JPEG can have.
    pub fn of_image(
        image: &RgbImage,
        config: &PhotographConfig,
    ) -> Result<Self, image::ImageError> {
        let scaling = Downscaling::new(image.dimensions(), config.max_size, 0.5);
        let smaller = scaling.map(|scaling| scaling.resample(image));
        let image = smaller.as_ref().unwrap_or(image);
        let mut jpeg = Vec::new();
        let quality = config.quality.clamp(1, 100);
        JpegEncoder::new_with_quality(&mut jpeg, quality).encode_image(image)?;
        let (width, height) = image.dimensions();
        Ok(Self {
            jpeg,
            width,
            height,
        })
    }
}

/// The photographs of a scene, one entry for each view: up to
/// [`PhotographConfig::max_photographs`] views whose cameras are far from each other
/// have one.
///
/// # Errors
/// If an image cannot be encoded, or read where it lies in a file; the message names
/// the view.
pub fn photographs(
    scene: &Scene,
    config: &PhotographConfig,
) -> Result<Vec<Option<Photograph>>, ReportError> {
    let centers: Vec<_> = (scene.views.iter())
        .map(|view| view.camera.center_in_world)
        .collect();
    let mut chosen = spread(&centers, config.max_photographs);
    chosen.sort_unstable();
    let mut found = vec![None; centers.len()];
    // No more than this at once: images may be read only now.
    for views in chosen.chunks(rayon::current_num_threads()) {
        let some = (views.par_iter())
            .map(|&view| photograph_of(&scene.views[view], config))
            .collect::<Result<Vec<_>, _>>()?;
        for (&view, photograph) in views.iter().zip(some) {
            found[view] = Some(photograph);
        }
    }
    Ok(found)
}

fn photograph_of(view: &View, config: &PhotographConfig) -> Result<Photograph, ReportError> {
    Photograph::of_image(&*view.image.read()?, config).map_err(|source| ReportError::Photograph {
        view: view.name.clone(),
        source,
    })
}

/// Up to `count` points that are far from each other, in the order of choice: the
/// first point, then always the one that is farthest from all chosen ones; of equals
/// the first.
fn spread(points: &[Vector3<f64>], count: usize) -> Vec<usize> {
    let mut distances = vec![f64::INFINITY; points.len()];
    let mut chosen = Vec::new();
    while chosen.len() < count.min(points.len()) {
        let next = (0..points.len()).fold(0, |best, candidate| {
            if distances[candidate] > distances[best] {
                candidate
            } else {
                best
            }
        });
        chosen.push(next);
        for (distance, point) in distances.iter_mut().zip(points) {
            *distance = distance.min((point - points[next]).norm_squared());
        }
        // Cameras at one place would otherwise be chosen again.
        distances[next] = f64::NEG_INFINITY;
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;
    use neat_core::synthetic::{SyntheticScene, generate};

    #[test]
    fn chosen_views_are_spread() {
        let line: Vec<_> = (0..9).map(|i| Vector3::x() * f64::from(i)).collect();
        assert_eq!(spread(&line, 3), [0, 8, 4]);
        assert_eq!(spread(&line, 0), [0_usize; 0]);
        assert_eq!(spread(&[], 5), [0_usize; 0]);
        let mut all = spread(&[Vector3::zeros(); 4], 9);
        all.sort();
        assert_eq!(all, [0, 1, 2, 3]);
    }

    #[test]
    fn photographs_are_small_and_few() {
        let config = SyntheticScene {
            views: 5,
            image_size: 64,
            min_visible_length: 2.0,
            ..SyntheticScene::default()
        };
        let scene = generate(&config).unwrap().scene;
        let config = PhotographConfig {
            max_photographs: 2,
            max_size: 32,
            quality: 70,
        };
        let found = photographs(&scene, &config).unwrap();
        assert_eq!(found.len(), 5);
        let found: Vec<_> = found.into_iter().flatten().collect();
        assert_eq!(found.len(), 2);
        for photograph in found {
            let decoded = image::load_from_memory(&photograph.jpeg).unwrap();
            assert_eq!((decoded.width(), decoded.height()), (32, 32));
            assert_eq!((photograph.width, photograph.height), (32, 32));
        }
    }

    #[test]
    fn small_images_keep_their_size() {
        let image = RgbImage::from_pixel(7, 5, Rgb([10, 200, 30]));
        let photograph = Photograph::of_image(&image, &PhotographConfig::default()).unwrap();
        assert_eq!((photograph.width, photograph.height), (7, 5));
        let empty = RgbImage::new(0, 0);
        assert!(Photograph::of_image(&empty, &PhotographConfig::default()).is_err());
    }
}
