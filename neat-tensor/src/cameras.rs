//! Pinhole cameras as tensors: what points and segments look like in images.

use burn::tensor::{Device, Tensor, TensorData};
use neat_core::Camera;

/// Cameras of a batch of rays or points, one per row.
#[derive(Clone, Debug)]
pub struct RayCameras {
    /// Rotations from the world to the camera, `[R, 9]`, row-major.
    pub camera_from_world: Tensor<2>,
    /// Centres of projection in the world, `[R, 3]`.
    pub center: Tensor<2>,
    /// `fx, fy, skew` of the intrinsics, `[R, 3]`.
    pub focal: Tensor<2>,
}

impl RayCameras {
    /// One camera per row, in float32.
    pub fn new<'a>(cameras: impl Iterator<Item = &'a Camera>, device: &Device) -> Self {
        let (mut rotation, mut center, mut focal) = (Vec::new(), Vec::new(), Vec::new());
        let mut rows = 0;
        for camera in cameras {
            rows += 1;
            // Columns of world_from_camera are rows of camera_from_world.
            rotation.extend(camera.world_from_camera.iter().map(|c| *c as f32));
            center.extend(camera.center_in_world.iter().map(|c| *c as f32));
            let k = camera.intrinsics;
            focal.extend([k.fx, k.fy, k.skew].map(|f| f as f32));
        }
        let tensor = |values: Vec<f32>, columns: usize| {
            Tensor::from_data(TensorData::new(values, [rows, columns]), device)
        };
        Self {
            camera_from_world: tensor(rotation, 9),
            center: tensor(center, 3),
            focal: tensor(focal, 3),
        }
    }
}

/// Depths nearer to zero than this are moved to it before dividing.
const MIN_DEPTH: f64 = 1e-8;

/// Ends `[R, 6]` in the world → calibrated coordinates `[R, 4]` (x, y of both
/// ends on z = 1).
pub fn project_calibrated(ends: Tensor<2>, cameras: &RayCameras) -> Tensor<2> {
    let first = project_point(ends.clone().narrow(1, 0, 3), cameras);
    let second = project_point(ends.narrow(1, 3, 3), cameras);
    Tensor::cat(vec![first, second], 1)
}

fn project_point(point: Tensor<2>, cameras: &RayCameras) -> Tensor<2> {
    let relative = point - cameras.center.clone();
    let coordinate = |row: usize| {
        (cameras.camera_from_world.clone().narrow(1, 3 * row, 3) * relative.clone()).sum_dim(1)
    };
    let z = coordinate(2);
    // Pushed off zero on its own side, as the published projection does.
    let too_near = z.clone().abs().lower_elem(MIN_DEPTH);
    let guard = z
        .full_like(MIN_DEPTH)
        .mask_fill(z.clone().lower_elem(0.0), -MIN_DEPTH);
    let guarded = z.clone() + guard;
    let z = z.mask_where(too_near, guarded);
    Tensor::cat(vec![coordinate(0), coordinate(1)], 1) / z
}

/// Differences of calibrated coordinates `[R, 4]` → differences in pixels.
pub fn calibrated_difference_in_pixels(difference: Tensor<2>, cameras: &RayCameras) -> Tensor<2> {
    let column = |t: &Tensor<2>, i: usize| t.clone().narrow(1, i, 1);
    let (fx, fy, skew) = (
        column(&cameras.focal, 0),
        column(&cameras.focal, 1),
        column(&cameras.focal, 2),
    );
    let end = |i: usize| {
        let (dx, dy) = (column(&difference, i), column(&difference, i + 1));
        vec![fx.clone() * dx + skew.clone() * dy.clone(), fy.clone() * dy]
    };
    Tensor::cat([end(0), end(2)].concat(), 1)
}
