//! The segment loss with its gradient in one pass on the host: what
//! [`neat_tensor::cameras`] and [`crate::segment_loss`] say in some sixty
//! tensor operations over a few hundred rays, each of which costs more than its
//! arithmetic. Those are its oracle, and its fallback on other devices.

use crate::segment_loss::SegmentLossConfig;
use neat_core::Camera;

/// Depths nearer to zero than this are moved to it before dividing.
const MIN_DEPTH: f32 = 1e-8;

/// What is observed along one ray.
#[derive(Clone, Copy, Debug)]
pub struct ObservedSegment<'a> {
    /// The camera of the ray.
    pub camera: &'a Camera,
    /// Observed ends, calibrated: x, y of both.
    pub ends_calibrated: [f32; 4],
    /// The detector's score.
    pub score: f32,
}

/// The loss and what later steps need of its inside.
#[derive(Clone, Debug)]
pub struct HostSegmentLoss {
    /// The loss.
    pub loss: f32,
    /// Its gradient with respect to the rendered ends, `[R · 6]`.
    pub gradient: Vec<f32>,
    /// Mean pixel error per ray.
    pub error_in_pixels: Vec<f32>,
    /// Whether each ray counts.
    pub counted: Vec<bool>,
}

/// One end on the image plane, with what its derivative needs.
struct Projection {
    point: [f32; 2],
    /// Depth that divided.
    z: f32,
}

/// A camera in float32, as the tensors have it.
struct RayCamera {
    /// Rows of the rotation from the world to the camera.
    rotation: [[f32; 3]; 3],
    center: [f32; 3],
    /// fx, fy, skew.
    focal: [f32; 3],
}

impl RayCamera {
    fn new(camera: &Camera) -> Self {
        let k = camera.intrinsics;
        Self {
            rotation: std::array::from_fn(|r| {
                std::array::from_fn(|c| camera.world_from_camera[(c, r)] as f32)
            }),
            center: camera.center_in_world.map(|c| c as f32).into(),
            focal: [k.fx, k.fy, k.skew].map(|f| f as f32),
        }
    }

    fn project(&self, end: &[f32]) -> Projection {
        let relative: [f32; 3] = std::array::from_fn(|i| end[i] - self.center[i]);
        let [x, y, z] = self
            .rotation
            .map(|row| row[0] * relative[0] + row[1] * relative[1] + row[2] * relative[2]);
        // Pushed off zero on its own side, as the published projection does.
        let z = if z.abs() >= MIN_DEPTH || z.is_nan() {
            z
        } else if z < 0.0 {
            z - MIN_DEPTH
        } else {
            z + MIN_DEPTH
        };
        Projection {
            point: [x / z, y / z],
            z,
        }
    }

    /// The gradient with respect to the end in the world.
    fn pull_back(&self, projection: &Projection, [gx, gy]: [f32; 2]) -> [f32; 3] {
        let [x, y] = projection.point;
        let (gx, gy) = (gx / projection.z, gy / projection.z);
        let gz = -(gx * x + gy * y);
        std::array::from_fn(|i| {
            self.rotation[0][i] * gx + self.rotation[1][i] * gy + self.rotation[2][i] * gz
        })
    }

    /// A calibrated difference of both ends in pixels.
    fn in_pixels(&self, d: [f32; 4]) -> [f32; 4] {
        let [fx, fy, skew] = self.focal;
        [
            fx * d[0] + skew * d[1],
            fy * d[1],
            fx * d[2] + skew * d[3],
            fy * d[3],
        ]
    }
}

/// Compares rendered ends `[R · 6]` in the world with what was observed along
/// their rays; `opacity` is the accumulated weight of each.
///
/// # Panics
/// If the slices do not have one entry per ray.
pub fn host_segment_loss(
    ends: &[f32],
    opacity: &[f32],
    observed: &[ObservedSegment<'_>],
    config: SegmentLossConfig,
) -> HostSegmentLoss {
    let rays = observed.len();
    assert_eq!(ends.len(), 6 * rays, "host_segment_loss: six numbers a ray");
    assert_eq!(opacity.len(), rays, "host_segment_loss: one weight a ray");
    let mut result = HostSegmentLoss {
        loss: 0.0,
        gradient: vec![0.0; 6 * rays],
        error_in_pixels: Vec::with_capacity(rays),
        counted: Vec::with_capacity(rays),
    };
    let minus = |a: [f32; 4], b: [f32; 4]| -> [f32; 4] { std::array::from_fn(|i| a[i] - b[i]) };
    for (ray, observed) in observed.iter().enumerate() {
        let camera = RayCamera::new(observed.camera);
        let both = [0, 3].map(|end| camera.project(&ends[6 * ray + end..][..3]));
        let [[ax, ay], [bx, by]] = [both[0].point, both[1].point];
        let projected = [ax, ay, bx, by];
        let straight = observed.ends_calibrated;
        let swapped = [straight[2], straight[3], straight[0], straight[1]];
        let squared = |target| -> f32 {
            let pixels = camera.in_pixels(minus(projected, target));
            pixels.iter().map(|p| p * p).sum()
        };
        // Ties take the swapped order, as published.
        let keep = squared(straight) < squared(swapped);
        let difference = minus(projected, if keep { straight } else { swapped });
        let error = camera
            .in_pixels(difference)
            .map(f32::abs)
            .iter()
            .sum::<f32>()
            / 4.0;
        let opaque = config
            .min_opacity
            .is_none_or(|min| opacity[ray] > min as f32);
        let counted = error < config.cutoff_in_pixels as f32 && opaque;
        result.error_in_pixels.push(error);
        result.counted.push(counted);
        if !counted {
            continue;
        }
        let size = difference.map(f32::abs).iter().sum::<f32>() / 4.0;
        result.loss += size * observed.score;
        let sign = difference.map(|d| match d {
            d if d > 0.0 => 1.0,
            d if d < 0.0 => -1.0,
            _ => 0.0,
        });
        let gradient = sign.map(|s: f32| s * observed.score / 4.0);
        for (end, projection) in both.iter().enumerate() {
            let pulled = camera.pull_back(projection, [gradient[2 * end], gradient[2 * end + 1]]);
            result.gradient[6 * ray + 3 * end..][..3].copy_from_slice(&pulled);
        }
    }
    let rays_in_mean = if config.mean_over_all_rays {
        rays
    } else {
        result.counted.iter().filter(|counted| **counted).count()
    };
    let scale = 1.0 / (rays_in_mean.max(1) as f32);
    result.loss *= scale;
    for g in &mut result.gradient {
        *g *= scale;
    }
    result
}
