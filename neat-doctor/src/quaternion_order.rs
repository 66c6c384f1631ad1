//! Rotations made of quaternions whose four numbers were read in another order: some programs
//! write the real part first (COLMAP, Eigen's constructor), others last (ROS, SciPy).

use nalgebra::{Quaternion, Rotation3, UnitQuaternion};
use neat_core::Camera;

/// How quaternions were misread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct QuaternionOrder {
    /// The real part is the first number of the file and was taken for the last, or the other
    /// way round.
    pub real_first: bool,
    /// They lead from the world to the camera, and so do the translations beside them.
    pub to_camera: bool,
}

impl QuaternionOrder {
    pub const ALL: [Self; 4] = [
        Self::of(true, false),
        Self::of(false, false),
        Self::of(true, true),
        Self::of(false, true),
    ];

    const fn of(real_first: bool, to_camera: bool) -> Self {
        Self {
            real_first,
            to_camera,
        }
    }

    /// Makes a camera what it is with the numbers in their right order.
    pub fn restore(self, camera: &mut Camera) {
        let from_camera = camera.world_from_camera;
        let read = if self.to_camera {
            from_camera.transpose()
        } else {
            from_camera
        };
        let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(read));
        let (w, x, y, z) = (q.w, q.i, q.j, q.k);
        let numbers = if self.real_first {
            // The file has what was read as x, y, z, w in this order.
            Quaternion::new(x, y, z, w)
        } else {
            Quaternion::new(z, w, x, y)
        };
        let rotation = UnitQuaternion::new_normalize(numbers)
            .to_rotation_matrix()
            .into_inner();
        if self.to_camera {
            // x_camera = R x_world + t with the t of the file.
            let translation = -(read * camera.center_in_world);
            camera.world_from_camera = rotation.transpose();
            camera.center_in_world = -(rotation.transpose() * translation);
        } else {
            camera.world_from_camera = rotation;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix4, Vector3};

    /// What a reader makes of a file with the real part first, if it takes it for the last.
    #[test]
    fn numbers_read_in_a_wrong_order_are_put_right() {
        let right = UnitQuaternion::from_euler_angles(0.3, -0.8, 2.1);
        let misread =
            UnitQuaternion::new_normalize(Quaternion::new(right.k, right.w, right.i, right.j));
        let intrinsics = neat_core::Intrinsics::new(1.0, 1.0, 0.0, 0.0);
        let mut pose: Matrix4<f64> = misread.to_homogeneous();
        let center = Vector3::new(1.0, 2.0, 3.0);
        pose.fixed_view_mut::<3, 1>(0, 3).copy_from(&center);
        let mut camera = Camera::from_matrices(intrinsics, &pose, 4, 3);
        QuaternionOrder::of(true, false).restore(&mut camera);
        let expected = right.to_rotation_matrix().into_inner();
        assert!((camera.world_from_camera - expected).amax() < 1e-12);
        assert_eq!(camera.center_in_world, center);

        // As COLMAP writes them, with translations to the camera.
        let read = misread.to_rotation_matrix().into_inner();
        camera.world_from_camera = read.transpose();
        camera.center_in_world = -(read.transpose() * center);
        QuaternionOrder::of(true, true).restore(&mut camera);
        assert!((camera.world_from_camera - expected.transpose()).amax() < 1e-12);
        assert!((camera.center_in_world + expected.transpose() * center).amax() < 1e-12);
    }
}
