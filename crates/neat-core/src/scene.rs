//! A scene: posed images, each with its 2D wireframe.

use crate::{Camera, Wireframe2d};
use image::RgbImage;
use nalgebra::{Matrix4, Vector3};
use serde::{Deserialize, Serialize};

/// A transform `x ↦ scale · x + translation` with one scale for all axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Similarity {
    /// Common scale of the three axes; positive.
    pub scale: f64,
    /// Added after scaling.
    pub translation: Vector3<f64>,
}

impl Similarity {
    /// The transform that changes nothing.
    pub fn identity() -> Self {
        Self {
            scale: 1.0,
            translation: Vector3::zeros(),
        }
    }

    /// Maps a point.
    pub fn apply(&self, point: &Vector3<f64>) -> Vector3<f64> {
        point * self.scale + self.translation
    }

    /// The transform back.
    pub fn inverse(&self) -> Self {
        Self {
            scale: 1.0 / self.scale,
            translation: -self.translation / self.scale,
        }
    }

    /// As a 4×4 matrix.
    pub fn matrix(&self) -> Matrix4<f64> {
        Matrix4::new_scaling(self.scale).append_translation(&self.translation)
    }
}

/// One posed image and what was detected in it.
#[derive(Clone, Debug)]
pub struct View {
    /// The image's file name without folder and ending.
    pub name: String,
    /// Intrinsics and pose, in the scene's world frame.
    pub camera: Camera,
    /// Junctions and segments, in image coordinates.
    pub wireframe: Wireframe2d,
    /// The photograph.
    pub image: RgbImage,
}

/// Posed images with their 2D wireframes, in one world frame.
#[derive(Clone, Debug)]
pub struct Scene {
    /// A short name, usually the folder's.
    pub name: String,
    /// The views, sorted by name.
    pub views: Vec<View>,
    /// Leads from the world frame of the cameras to the frame of the user's files.
    pub original_from_world: Similarity,
    /// Image coordinates of the centre of pixel (0, 0), on both axes: 0.5 where
    /// the intrinsics' origin is the image corner, 0 where it is that centre.
    pub pixel_center: f64,
}
