//! What a person may choose about how a scene is read.

use super::poses::Poses;
use super::{Layout, PixelCenter, PoseConvention};
use crate::{MemoryLimit, SphereChoice};
use std::path::PathBuf;

/// How [`crate::load_scene`] reads a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// The layout; `None` tells it by the files.
    pub layout: Option<Layout>,
    /// Where the centre of a pixel lies in the coordinates of the intrinsics.
    pub pixel_center: PixelCenter,
    /// A view is usable if a segment has a score above this. The published code
    /// uses 0.05 for training.
    pub min_segment_score: f64,
    /// Whether views need 2D wireframes: if so, a missing wireframe is an error
    /// and views without a usable segment are dropped. If not, every view is
    /// kept, and one without a file has an empty wireframe.
    pub require_wireframes: bool,
    /// The colour behind transparent pixels.
    pub background: [u8; 3],
    /// What places the scene sphere, whose centre becomes the world's origin.
    pub sphere: SphereChoice,
    /// What the poses really are, where they are not what their layout says:
    /// applied to what the layout's reader returns.
    pub pose_convention: Option<PoseConvention>,
    /// Multiplies the focal lengths.
    pub focal_scale: Option<f64>,
    /// Multiplies focal lengths and principal points, and the image size where
    /// the layout gives one: 0.5 for intrinsics made before the images were
    /// scaled down to half. The origin is taken to be the corner of the image.
    pub intrinsics_scale: Option<f64>,
    /// At most so many views, spread evenly over the order of the files; `None`
    /// takes all.
    pub max_views: Option<usize>,
    /// The longest side of images, in pixels: larger ones are scaled down.
    /// `None` keeps all as they are.
    pub max_image_size: Option<u32>,
    /// A folder that keeps undistorted images for the next time; it is created
    /// where needed, and can be deleted at any time. `None` keeps nothing.
    pub cache_dir: Option<PathBuf>,
    /// How much memory may be used. Images that are too large together to stay in it
    /// ([`MemoryLimit::holds_images`]) go to a temporary file in [`Self::cache_dir`],
    /// or in the system's folder for such files; what is read is the same.
    pub memory_limit: MemoryLimit,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            layout: None,
            pixel_center: PixelCenter::Auto,
            min_segment_score: 0.05,
            require_wireframes: true,
            background: [0; 3],
            sphere: SphereChoice::Auto,
            pose_convention: None,
            focal_scale: None,
            intrinsics_scale: None,
            max_views: None,
            max_image_size: None,
            cache_dir: None,
            memory_limit: MemoryLimit::NONE,
        }
    }
}

impl LoadOptions {
    /// Makes poses, intrinsics and points what these options say they are.
    pub(super) fn correct(&self, poses: &mut Poses) {
        let convention = self.pose_convention.unwrap_or_default();
        let file_axes = &poses.file_axes;
        let scale = self.intrinsics_scale.unwrap_or(1.0);
        let focal_scale = scale * self.focal_scale.unwrap_or(1.0);
        for view in &mut poses.views {
            view.world_from_camera =
                convention.world_from_camera(&view.world_from_camera, file_axes);
            view.intrinsics = view.intrinsics.with_focal_factor(focal_scale);
            view.intrinsics.cx *= scale;
            view.intrinsics.cy *= scale;
            if self.intrinsics_scale.is_some() {
                // Saturates where the factor makes no sense.
                let scaled = |pixels: u32| (f64::from(pixels) * scale).round() as u32;
                view.size = view.size.map(|(w, h)| (scaled(w), scaled(h)));
            }
        }
        for point in &mut poses.points {
            for observation in &mut point.observations {
                observation.pixel *= scale;
            }
            if convention.mirrored_world {
                point.position_in_world *= -1.0;
            }
        }
        if convention.mirrored_world {
            poses.original_from_world.scale *= -1.0;
        }
    }
}
