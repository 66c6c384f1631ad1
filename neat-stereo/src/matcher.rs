//! A view held against its neighbours at one level of their pyramids.

use crate::patch::Patch;
use crate::view::{StereoView, Transfer};
use nalgebra::{Matrix3, Vector3};
use neat_core::Ray;

/// Neighbours that a view is held against, at most.
pub(crate) const MAX_OTHERS: usize = 4;
/// Surfaces seen flatter than this are no evidence: 78° off the sight line.
const MIN_COSINE: f32 = 0.2;

/// A view and its neighbours at one level.
pub(crate) struct Matcher<'a> {
    view: &'a StereoView,
    others: Vec<Other<'a>>,
    level: usize,
    calibrated_from_pixels: Matrix3<f32>,
    /// Change of the inverse depth that moves a patch by a pixel of this level in the
    /// neighbour farthest away.
    pub step: f32,
    /// The inverse depth at which rays of that neighbour meet ours at right angles or so.
    nearest: f32,
}

struct Other<'a> {
    view: &'a StereoView,
    /// From pixels here, on a plane at distance 1, to pixels there: `linear + offset planeᵀ`.
    linear: Matrix3<f32>,
    offset: Vector3<f32>,
}

/// A pixel with the patch around it.
pub(crate) struct Target {
    pixel: [f32; 2],
    patch: Patch,
    /// Its sight line in the camera's frame, on z = 1.
    pub ray: Vector3<f32>,
}

impl<'a> Matcher<'a> {
    /// Of a view and at least one other one.
    pub fn new(view: &'a StereoView, others: &[&'a StereoView], level: usize) -> Self {
        let calibrated = view.calibrated_from_pixels(level);
        let of_other = |other: &&'a StereoView| {
            let Transfer { linear, offset } = view.transfer_to(other, level);
            Other {
                view: other,
                linear: (linear * calibrated).cast(),
                offset: offset.cast(),
            }
        };
        let baseline = |other: &&StereoView| {
            (other.camera.center_in_world - view.camera.center_in_world).norm()
        };
        let widest = others.iter().map(baseline).fold(0.0, f64::max);
        let focal_length = view.pixels_from_calibrated(level)[(0, 0)];
        Self {
            view,
            others: others.iter().take(MAX_OTHERS).map(of_other).collect(),
            level,
            calibrated_from_pixels: calibrated.cast(),
            step: (1.0 / (focal_length * widest)) as f32,
            nearest: (1.0 / widest) as f32,
        }
    }

    /// The level of the pyramids.
    pub fn level(&self) -> usize {
        self.level
    }

    /// Pixel (`x`, `y`), where a patch around it shows something.
    pub fn target(&self, [x, y]: [usize; 2]) -> Option<Target> {
        let patch = Patch::around(self.view.image(self.level), x, y)?;
        let pixel = [x as f32, y as f32];
        let ray = self.calibrated_from_pixels * Vector3::new(pixel[0], pixel[1], 1.0);
        Some(Target { pixel, patch, ray })
    }

    /// Least and largest inverse depth of a pixel within the ball around the origin.
    pub fn inverse_depths(&self, target: &Target, ball_radius: f64) -> Option<[f32; 2]> {
        let camera = &self.view.camera;
        let ray: Vector3<f64> = target.ray.cast();
        let length = ray.norm();
        let direction = camera.world_from_camera * ray / length;
        let sight = Ray {
            origin: camera.center_in_world,
            direction,
        };
        let [near, far] = sight.interval_in_ball(ball_radius)?;
        let [low, high] = [far, near].map(|distance| (length / distance) as f32);
        Some([low, high.min(self.nearest)])
    }

    /// How well the neighbours agree that the surface `plane · x = 1` of the camera's frame
    /// is at `target`: the mean correlation of the better half of them, as the others may
    /// not see it. `None` where too few show the place, or the plane is seen too flat.
    pub fn score(&self, target: &Target, plane: &Vector3<f32>) -> Option<f32> {
        let cosine = plane.dot(&target.ray) / (plane.norm() * target.ray.norm());
        // Also false for a plane behind the camera, and for no number.
        if !matches!(
            cosine.partial_cmp(&MIN_COSINE),
            Some(std::cmp::Ordering::Greater)
        ) {
            return None;
        }
        let plane = self.calibrated_from_pixels.tr_mul(plane);
        let mut correlations = [f32::NEG_INFINITY; MAX_OTHERS];
        for (correlation, other) in correlations.iter_mut().zip(&self.others) {
            let homography = other.linear + other.offset * plane.transpose();
            let image = other.view.image(self.level);
            let found = target.patch.correlation(image, &homography, target.pixel);
            *correlation = found.unwrap_or(f32::NEG_INFINITY);
        }
        correlations.sort_unstable_by(|a, b| b.total_cmp(a));
        let counted = self.others.len().div_ceil(2);
        let mean = correlations[..counted].iter().sum::<f32>() / counted as f32;
        mean.is_finite().then_some(mean)
    }
}
