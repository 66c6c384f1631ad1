//! Cameras on a sphere around the origin.

use super::random::{Purpose, gaussian_pair, stream};
use crate::{Camera, Intrinsics};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Focal length as a multiple of the image width: 560 pixels for 512, the
/// published toy scene's.
const FOCAL_PER_WIDTH: f64 = 560.0 / 512.0;

/// From this distance on, a ball of the given radius around the origin lies
/// within every image whose shorter side is `aspect` of its width.
pub(super) fn min_distance(radius: f64, aspect: f64) -> f64 {
    radius * (2.0 * FOCAL_PER_WIDTH / aspect).hypot(1.0)
}

/// `count` cameras at `distance` from the origin, looking at it, spread evenly:
/// a Fibonacci lattice in a random orientation.
pub fn viewpoints(count: usize, distance: f64, image_size: (u32, u32), seed: u64) -> Vec<Camera> {
    let mut rng = stream(seed, 0, Purpose::Viewpoints);
    let (a, b) = (gaussian_pair(&mut rng), gaussian_pair(&mut rng));
    let orientation = UnitQuaternion::new_normalize(Quaternion::new(a.x, a.y, b.x, b.y));
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f64 / count as f64;
            let (sin, cos) = (i as f64 * golden_angle).sin_cos();
            let radius = (1.0 - z * z).sqrt();
            let direction = orientation * Vector3::new(radius * cos, radius * sin, z);
            looking_at_origin(direction * distance, image_size)
        })
        .collect()
}

/// The camera at `center_in_world` with the origin in the middle of its image
/// and the world's z axis upwards (the y axis, where z is nearly the view).
fn looking_at_origin(center_in_world: Vector3<f64>, image_size: (u32, u32)) -> Camera {
    let forward = -center_in_world.normalize();
    let up = if forward.z.abs() < 0.99 {
        Vector3::z()
    } else {
        Vector3::y()
    };
    let right = forward.cross(&up).normalize();
    let down = forward.cross(&right);
    let (width, height) = image_size;
    let focal_length = FOCAL_PER_WIDTH * f64::from(width);
    Camera {
        intrinsics: Intrinsics::centered(focal_length, image_size),
        world_from_camera: Matrix3::from_columns(&[right, down, forward]),
        center_in_world,
        width,
        height,
    }
}
