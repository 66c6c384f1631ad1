//! A view as matching sees it.

use crate::gray_pyramid::{GrayImage, pyramid};
use nalgebra::{Matrix3, Vector3};
use neat_core::{Camera, SceneError, View};
use std::ops::RangeInclusive;

/// Camera and brightness of a view.
#[derive(Clone, Debug)]
pub(crate) struct StereoView {
    pub camera: Camera,
    levels: RangeInclusive<usize>,
    images: Vec<GrayImage>,
    pixel_center: f64,
}

/// From the frame of one camera to pixels of another.
pub(crate) struct Transfer {
    pub linear: Matrix3<f64>,
    pub offset: Vector3<f64>,
}

impl StereoView {
    /// With its image at `levels`, as far as it can be halved.
    ///
    /// # Errors
    /// If the image cannot be read.
    pub fn new(
        view: &View,
        pixel_center: f64,
        levels: RangeInclusive<usize>,
    ) -> Result<Self, SceneError> {
        Ok(Self {
            camera: view.camera,
            images: pyramid(&*view.image.read()?, levels.clone()),
            levels,
            pixel_center,
        })
    }

    /// The image at one of its levels.
    ///
    /// # Panics
    /// If it has no such level.
    pub fn image(&self, level: usize) -> &GrayImage {
        &self.images[level - self.levels.start()]
    }

    /// Its levels, or none if the image is too small for all of them.
    pub fn levels(&self) -> Option<RangeInclusive<usize>> {
        let is_whole = self.images.len() == self.levels.clone().count();
        is_whole.then(|| self.levels.clone())
    }

    /// Calibrated coordinates (on z = 1) → column and row at `level`.
    pub fn pixels_from_calibrated(&self, level: usize) -> Matrix3<f64> {
        let scale = 1.0 / (1u64 << level) as f64;
        // Pixel (0, 0) of every level begins at the corner of the image.
        let shift = scale * (0.5 - self.pixel_center) - 0.5;
        let to_level = Matrix3::new(scale, 0.0, shift, 0.0, scale, shift, 0.0, 0.0, 1.0);
        to_level * self.camera.intrinsics.matrix()
    }

    /// Column and row at `level` → calibrated coordinates.
    pub fn calibrated_from_pixels(&self, level: usize) -> Matrix3<f64> {
        let matrix = self.pixels_from_calibrated(level);
        matrix.try_inverse().expect("focal lengths are positive")
    }

    /// From this camera's frame to pixels of `other` at `level`: a point `x` lies at
    /// `linear · x + offset`, up to scale.
    pub fn transfer_to(&self, other: &Self, level: usize) -> Transfer {
        let pixels = other.pixels_from_calibrated(level);
        let (here, there) = (&self.camera, &other.camera);
        let between = here.center_in_world - there.center_in_world;
        Transfer {
            linear: pixels * there.world_from_camera.tr_mul(&here.world_from_camera),
            offset: pixels * there.world_from_camera.tr_mul(&between),
        }
    }
}
