//! Case 10: projection on tensors is projection by a camera.

use burn::tensor::{Device, Tensor, TensorData};
use nalgebra::{Matrix3, Matrix4, Vector2, Vector3};
use neat_core::{Camera, Intrinsics};
use neat_tensor::cameras::{RayCameras, calibrated_difference_in_pixels, project_calibrated};
use neat_tests::backends::on_each_backend;
use neat_tests::comparison::{assert_close, assert_relatively_close};
use neat_tests::golden::Golden;
use neat_tests::tensors::{golden_tensor, numbers};

/// `rays` rays of one camera.
pub fn same_camera(camera: &Camera, rays: usize, device: &Device) -> RayCameras {
    let repeated = |row: Vec<f64>| {
        let width = row.len();
        Tensor::from_data(TensorData::new(row.repeat(rays), [rays, width]), device)
    };
    let Intrinsics { fx, fy, skew, .. } = camera.intrinsics;
    RayCameras {
        // Columns of world_from_camera, as nalgebra stores them, are rows of
        // camera_from_world.
        camera_from_world: repeated(camera.world_from_camera.iter().copied().collect()),
        center: repeated(camera.center_in_world.iter().copied().collect()),
        focal: repeated(vec![fx, fy, skew]),
    }
}

/// A camera of 512 × 512 pixels from the matrices of these names.
pub fn camera(golden: &Golden, intrinsics: &str, world_from_camera: &str) -> Camera {
    Camera::from_matrices(
        Intrinsics::from_matrix(&Matrix3::from_row_slice(&golden.numbers(intrinsics))),
        &Matrix4::from_row_slice(&golden.numbers(world_from_camera)),
        512,
        512,
    )
}

#[test]
fn points_before_and_behind_the_camera() {
    let golden = Golden::open("10_rays_projection");
    let truth = golden.rows::<2>("f64.calibrated");
    let points = golden.rows::<3>("world_points");
    let camera = camera(&golden, "K", "pose_c2w");
    let by_camera: Vec<f64> = points
        .iter()
        .flat_map(|&p| camera.project(&Vector3::from(p)).calibrated.data.0[0])
        .collect();
    assert_close("camera", &by_camera, truth.as_flattened(), 3e-6);
    on_each_backend(|device| {
        let points: Tensor<2> = golden_tensor(&golden, "world_points", &device);
        // The segment from each point to the one before.
        let before = Tensor::cat(
            vec![
                points.clone().narrow(0, 19, 1),
                points.clone().narrow(0, 0, 19),
            ],
            0,
        );
        let segments = Tensor::cat(vec![points, before], 1);
        let projected = project_calibrated(segments, &same_camera(&camera, 20, &device));
        let expected: Vec<f64> = (0..20)
            .flat_map(|i| [truth[i], truth[(i + 19) % 20]].concat())
            .collect();
        assert_close("tensors", &numbers(projected), &expected, 3e-6);
    });
}

#[test]
fn points_at_the_camera_plane_are_pushed_off_it() {
    let golden = Golden::open("10_rays_projection");
    let identity = Camera::from_matrices(
        Intrinsics::from_matrix(&Matrix3::identity()),
        &Matrix4::identity(),
        1,
        1,
    );
    on_each_backend(|device| {
        let points: Tensor<2> = golden_tensor(&golden, "guard/points", &device);
        let rays = points.dims()[0];
        let segments = Tensor::cat(vec![points.clone(), points], 1);
        let projected = project_calibrated(segments, &same_camera(&identity, rays, &device));
        let first = numbers(projected.narrow(1, 0, 2));
        let truth = golden.numbers("guard/projected");
        assert_relatively_close("guard", &first, &truth, 3e-6);
    });
}

#[test]
fn differences_become_pixels_by_focal_length_and_skew() {
    let golden = Golden::open("10_rays_projection");
    let camera = camera(&golden, "skewed_K", "pose_c2w");
    let differences = [[0.1, -0.2, 0.03, 0.04], [-0.5, 0.25, 0.0, 1.0]];
    let origin = camera.intrinsics.decalibrate(&Vector2::zeros());
    let expected: Vec<f64> = differences
        .as_flattened()
        .chunks(2)
        .flat_map(|d| {
            (camera.intrinsics.decalibrate(&Vector2::new(d[0], d[1])) - origin)
                .data
                .0[0]
        })
        .collect();
    on_each_backend(|device| {
        let in_pixels = calibrated_difference_in_pixels(
            Tensor::from_data(differences, &device),
            &same_camera(&camera, 2, &device),
        );
        assert_close("pixels", &numbers(in_pixels), &expected, 1e-3);
    });
}
