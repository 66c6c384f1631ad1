//! The images of a scene at the resolution of the examination: made when they are
//! looked at, so that few of them are in memory at once.

use crate::gray_image::GrayImage;
use nalgebra::Vector2;
use neat_core::{MemoryLimit, Scene, SceneError};

/// Bytes for each pixel of a photograph that lies in a file, while it is scaled down.
const BYTES_PER_PIXEL: u64 = 4;
/// Bytes for a working copy of the largest size with what is derived from it: its blurred
/// versions, gradients and descriptors.
const BYTES_PER_COPY: u64 = 64 << 20;

/// Where a point of an image lies in its working copy, which is scaled down by `factor`.
pub(crate) fn in_copy(point: &Vector2<f64>, pixel_center: f64, factor: u32) -> Vector2<f64> {
    (point.add_scalar(0.5 - pixel_center) / f64::from(factor)).add_scalar(-0.5)
}

/// Gives out the working copies of views.
pub(crate) struct WorkingCopies<'a> {
    scene: &'a Scene,
    limit: MemoryLimit,
    bytes_each: u64,
}

impl<'a> WorkingCopies<'a> {
    pub fn new(scene: &'a Scene, limit: MemoryLimit) -> Self {
        let pixels = scene.views.iter().map(|view| {
            let (width, height) = view.image.dimensions();
            u64::from(width) * u64::from(height)
        });
        let bytes_each = BYTES_PER_COPY + BYTES_PER_PIXEL * pixels.max().unwrap_or(0);
        Self {
            scene,
            limit,
            bytes_each,
        }
    }

    /// The working copy of a view, and the factor that it is scaled down by.
    ///
    /// # Errors
    /// If its image lies in a file that cannot be read.
    pub fn of(&self, view: usize) -> Result<(GrayImage, u32), SceneError> {
        Ok(GrayImage::working_copy(
            &*self.scene.views[view].image.read()?,
        ))
    }

    /// Looks at some views in parallel, at no more at once than fit into memory.
    ///
    /// # Errors
    /// The first error of `look` in the order of the views.
    pub fn look_at<T: Send>(
        &self,
        views: &[usize],
        look: impl Fn(usize) -> Result<T, SceneError> + Sync + Send,
    ) -> Result<Vec<T>, SceneError> {
        self.limit
            .try_map(views, self.bytes_each, |&view| look(view))
    }
}
