//! How a scene is read, as a person may choose it.

mod choice;

pub use choice::Choice;

use neat_core::SphereChoice;
use neat_core::layout::{PixelCenter, PoseConvention};
use serde::{Deserialize, Serialize};
use std::fmt;

/// How the scene is read and which part of space is modelled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataConfig {
    /// Where pixel (0, 0) has its centre: `auto` follows the camera file's
    /// convention, `integer` is what the published code does for every source.
    pub pixel_center: PixelCenter,
    /// 2D segments need a higher score than this (published: 0.05).
    pub min_segment_score: f64,
    /// Pixels nearer to a 2D segment than this belong to its attraction region
    /// (τ_d of the paper).
    pub attraction_distance: f64,
    /// What places the scene sphere: `auto`, `file`, `points`, `cameras`, `masks`,
    /// or `x,y,z,radius` in the frame of the files.
    #[serde(default)]
    pub scene_sphere: SphereChoice,
    /// What the poses really are, where they are not what their layout says.
    #[serde(default)]
    pub pose_convention: Option<PoseConvention>,
    /// Multiplies the focal lengths of the files.
    #[serde(default)]
    pub focal_scale: Option<f64>,
    /// Multiplies the intrinsics of the files, for images of another size.
    #[serde(default)]
    pub intrinsics_scale: Option<f64>,
    /// At most so many views are used, spread evenly over the order of the files.
    #[serde(default)]
    pub max_views: Option<usize>,
    /// Images with a longer side than this, in pixels, are scaled down.
    #[serde(default)]
    pub max_image_size: Option<u32>,
    /// What lies behind the object; `None` changes nothing, `auto` is told by the
    /// borders of the images.
    #[serde(default)]
    pub background: Option<Choice<Background>>,
    /// Radius of the modelled ball, in the unit of the poses. `None` takes that of
    /// the scene sphere and scales the world so that it is 1.
    pub scene_radius: Option<f64>,
}

/// As the preset `fast` has it.
impl Default for DataConfig {
    fn default() -> Self {
        Self {
            pixel_center: PixelCenter::Auto,
            min_segment_score: 0.05,
            attraction_distance: 10.0,
            scene_sphere: SphereChoice::Auto,
            pose_convention: None,
            focal_scale: None,
            intrinsics_scale: None,
            max_views: None,
            max_image_size: None,
            background: Some(Choice::Auto),
            scene_radius: None,
        }
    }
}

/// What lies behind the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Background {
    /// Black: empty space has no colour, and silhouettes are known.
    Black,
    /// Anything: a photograph. The border of the scene sphere stands for all that
    /// is behind it, as in VolSDF, and there are no silhouettes.
    Photo,
}

impl fmt::Display for Background {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Black => "black",
            Self::Photo => "photo",
        })
    }
}
