//! The segment loss on the host against the one in tensor operations.

use burn::tensor::{Tensor, TensorData};
use nalgebra::{Matrix3, Rotation3, Vector3};
use neat_core::{Camera, Intrinsics};
use neat_field::host_segment_loss::{ObservedSegment, host_segment_loss};
use neat_field::segment_loss::{SegmentLossConfig, segment_loss};
use neat_tensor::cameras::{RayCameras, project_calibrated};
use neat_tests::backends::flex;
use neat_tests::comparison::{assert_close, assert_relatively_close};
use neat_tests::finite_differences::normal;
use neat_tests::tensors::numbers;

const RAYS: usize = 40;

fn camera(ray: usize) -> Camera {
    let turn = 0.1 * ray as f64;
    let rotation: Matrix3<f64> = Rotation3::from_euler_angles(0.1, turn, -0.2).into_inner();
    Camera {
        intrinsics: Intrinsics {
            fx: 500.0 + ray as f64,
            fy: 480.0,
            cx: 256.0,
            cy: 250.0,
            skew: 2.0,
        },
        world_from_camera: rotation,
        center_in_world: rotation * Vector3::new(0.1, -0.2, -3.0),
        width: 512,
        height: 512,
    }
}

fn float32(values: Vec<f64>) -> Vec<f32> {
    values.into_iter().map(|x| x as f32).collect()
}

#[test]
fn the_host_says_what_tensor_operations_say() {
    let device = flex();
    let cameras: Vec<Camera> = (0..RAYS).map(camera).collect();
    let mut ends = float32(normal(6 * RAYS, 1));
    // One end exactly in the camera's own plane, one pair behind it.
    let center = cameras[3].center_in_world.map(|c| c as f32);
    ends[18..21].copy_from_slice(center.as_slice());
    let behind = cameras[4].center_in_world * 2.0;
    ends[24..27].copy_from_slice(behind.map(|c| c as f32).as_slice());
    let observed = float32(normal(4 * RAYS, 2).into_iter().map(|x| 0.2 * x).collect());
    let score: Vec<f32> = (0..RAYS).map(|i| 0.5 + 0.01 * i as f32).collect();
    let opacity: Vec<f32> = (0..RAYS).map(|i| (i % 7) as f32 / 6.0).collect();
    let tensor = |values: &[f32], columns: usize| -> Tensor<2> {
        Tensor::from_data(TensorData::new(values.to_vec(), [RAYS, columns]), &device)
    };
    let per_camera = |f: &dyn Fn(&Camera) -> Vec<f64>| -> Vec<f32> {
        cameras.iter().flat_map(|c| float32(f(c))).collect()
    };
    let ray_cameras = RayCameras {
        camera_from_world: tensor(
            &per_camera(&|c| c.world_from_camera.iter().copied().collect()),
            9,
        ),
        center: tensor(
            &per_camera(&|c| c.center_in_world.iter().copied().collect()),
            3,
        ),
        focal: tensor(
            &per_camera(&|c| vec![c.intrinsics.fx, c.intrinsics.fy, c.intrinsics.skew]),
            3,
        ),
    };
    let segments: Vec<ObservedSegment<'_>> = (0..RAYS)
        .map(|i| ObservedSegment {
            camera: &cameras[i],
            ends_calibrated: std::array::from_fn(|k| observed[4 * i + k]),
            score: score[i],
        })
        .collect();

    for cutoff_in_pixels in [100.0, 250.0, 1e9] {
        for min_opacity in [None, Some(0.3)] {
            for mean_over_all_rays in [false, true] {
                let config = SegmentLossConfig {
                    cutoff_in_pixels,
                    min_opacity,
                    mean_over_all_rays,
                };
                let leaf = tensor(&ends, 6).require_grad();
                let truth = segment_loss(
                    project_calibrated(leaf.clone(), &ray_cameras),
                    tensor(&observed, 4),
                    tensor(&score, 1),
                    tensor(&opacity, 1),
                    &ray_cameras,
                    config,
                );
                let gradients = truth.loss.clone().backward();
                let gradient = numbers(leaf.grad(&gradients).expect("tracked"));
                let host = host_segment_loss(&ends, &opacity, &segments, config);

                let what = format!("{config:?}");
                let counted: Vec<f64> = host
                    .counted
                    .iter()
                    .map(|c| f64::from(u8::from(*c)))
                    .collect();
                assert_eq!(counted, numbers(truth.counted), "{what}");
                let widen = |x: &[f32]| x.iter().map(|x| f64::from(*x)).collect::<Vec<_>>();
                assert_relatively_close(
                    &what,
                    &widen(&host.error_in_pixels),
                    &numbers(truth.error_in_pixels),
                    1e-5,
                );
                let loss = numbers(truth.loss)[0];
                assert_close(
                    &what,
                    &[f64::from(host.loss)],
                    &[loss],
                    1e-5 * loss.abs().max(1e-3),
                );
                assert_relatively_close(&what, &widen(&host.gradient), &gradient, 1e-4);
            }
        }
    }
}
