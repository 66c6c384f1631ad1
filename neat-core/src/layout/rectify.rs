//! From the photograph on disk to the image of a view: undistorted where its lens
//! bends rays, and scaled down where it is larger than asked for. Cameras,
//! wireframes and observations of points follow.

use super::poses::PosedImage;
use crate::downscaling::Downscaling;
use crate::scene::check_image_size;
use crate::undistortion::Undistortion;
use crate::{Camera, Distortion, Intrinsics, ViewError, Wireframe2d};
use image::metadata::Orientation;
use image::{DynamicImage, RgbImage};
use nalgebra::Vector2;
use serde::Serialize;

/// What is done to the photograph of one view.
pub(super) struct Rectification {
    photograph: Camera,
    distortion: Distortion,
    undistortion: Option<Undistortion>,
    downscaling: Option<Downscaling>,
    pixel_center: f64,
    /// How the stored pixels are turned first.
    turn: Orientation,
}

impl Rectification {
    /// For the image `posed`, whose photograph on disk has the camera
    /// `photograph`.
    ///
    /// # Errors
    /// If its lens cannot be undistorted.
    pub fn new(
        posed: &PosedImage,
        photograph: Camera,
        pixel_center: f64,
        max_image_size: Option<u32>,
    ) -> Result<Self, ViewError> {
        let size = (photograph.width, photograph.height);
        let lens = (!posed.distortion.is_none()).then_some(&posed.distortion);
        let undistortion = lens
            .map(|lens| Undistortion::new(&photograph.intrinsics, lens, size, pixel_center))
            .transpose()?;
        Ok(Self {
            photograph,
            distortion: posed.distortion,
            undistortion,
            downscaling: max_image_size.and_then(|max| Downscaling::new(size, max, pixel_center)),
            pixel_center,
            turn: Orientation::NoTransforms,
        })
    }

    /// The same for a photograph that is stored so that it has to be turned first.
    pub fn of_turned(self, turn: Orientation) -> Self {
        Self { turn, ..self }
    }

    /// The model of the lens, where the photograph is undistorted.
    pub fn lens(&self) -> Option<&'static str> {
        self.undistortion.as_ref().map(|_| self.distortion.name())
    }

    /// Whether the photograph is scaled down.
    pub fn scales_down(&self) -> bool {
        self.downscaling.is_some()
    }

    /// Width and height of the photograph.
    pub fn photograph_size(&self) -> (u32, u32) {
        (self.photograph.width, self.photograph.height)
    }

    /// Width and height of the view's image.
    pub fn size(&self) -> (u32, u32) {
        let scaled = self.downscaling.map(|scaling| scaling.size());
        scaled.unwrap_or(self.photograph_size())
    }

    /// The camera of the view's image.
    pub fn camera(&self) -> Camera {
        let undistorted = self.undistortion.as_ref().map(|lens| *lens.pinhole());
        let intrinsics = undistorted.unwrap_or(self.photograph.intrinsics);
        let scaled = self
            .downscaling
            .map(|scaling| scaling.scale_intrinsics(&intrinsics));
        let (width, height) = self.size();
        Camera {
            intrinsics: scaled.unwrap_or(intrinsics),
            width,
            height,
            ..self.photograph
        }
    }

    /// The view's image, of the pixels as they are stored.
    ///
    /// # Errors
    /// If it has another size than its file said first.
    pub fn image(&self, stored: RgbImage) -> Result<RgbImage, ViewError> {
        let mut photograph = DynamicImage::from(stored);
        photograph.apply_orientation(self.turn);
        let photograph = photograph.into_rgb8();
        check_image_size("camera", self.photograph_size(), photograph.dimensions())?;
        let undistorted = match &self.undistortion {
            Some(undistortion) => undistortion.resample(&photograph),
            None => photograph,
        };
        Ok(match &self.downscaling {
            Some(scaling) => scaling.resample(&undistorted),
            None => undistorted,
        })
    }

    /// Image coordinates in the photograph → in the view's image; `None` for what
    /// that does not show.
    pub fn point(&self, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let moved = self.map(pixel)?;
        // Nothing leaves the image by scaling.
        (self.undistortion.is_none() || self.contains(&moved)).then_some(moved)
    }

    /// The wireframe in the view's image of one that was detected in the
    /// photograph, or in the view's image itself if its size says so.
    ///
    /// # Errors
    /// If it was detected in an image of another size.
    pub fn wireframe(&self, detected: Wireframe2d) -> Result<Wireframe2d, ViewError> {
        let size = (detected.width, detected.height);
        if size != self.photograph_size() && size == self.size() {
            return Ok(detected);
        }
        check_image_size("wireframe", size, self.photograph_size())?;
        if self.undistortion.is_none() && self.downscaling.is_none() {
            return Ok(detected);
        }
        let moved = detected.mapped(self.size(), |vertex| self.map(vertex));
        Ok(match self.undistortion {
            Some(_) => moved.clipped_to_image(self.pixel_center),
            None => moved,
        })
    }

    /// All that the view's image depends on besides the bytes of the photograph.
    pub fn key(&self) -> Vec<u8> {
        #[derive(Serialize)]
        struct Key<'a> {
            intrinsics: &'a Intrinsics,
            distortion: &'a Distortion,
            pixel_center: f64,
            size: (u32, u32),
            #[serde(skip_serializing_if = "Option::is_none")]
            turn: Option<u8>,
        }
        let turn = (self.turn != Orientation::NoTransforms).then_some(self.turn.to_exif());
        let key = Key {
            intrinsics: &self.photograph.intrinsics,
            distortion: &self.distortion,
            pixel_center: self.pixel_center,
            size: self.size(),
            turn,
        };
        serde_json::to_vec(&key).expect("Rectification::key: numbers are serialised without error")
    }

    /// [`Self::point`], also outside the image.
    fn map(&self, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let undistorted = match &self.undistortion {
            Some(undistortion) => undistortion.pinhole_from_photograph(pixel)?,
            None => *pixel,
        };
        let scaled = self.downscaling.map(|scaling| scaling.scale(&undistorted));
        Some(scaled.unwrap_or(undistorted))
    }

    fn contains(&self, pixel: &Vector2<f64>) -> bool {
        let (width, height) = self.size();
        let from_corner = pixel.add_scalar(0.5 - self.pixel_center);
        (0.0..=f64::from(width)).contains(&from_corner.x)
            && (0.0..=f64::from(height)).contains(&from_corner.y)
    }
}

#[cfg(test)]
mod tests;
