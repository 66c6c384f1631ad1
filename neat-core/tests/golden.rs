//! Cameras and assignment against numbers of the published code
//! (`tests/data/golden/README.md`, cases 07 and 10).

use nalgebra::{Matrix3, Matrix4, Vector2, Vector3};
use neat_core::assignment::assign;
use neat_core::{Camera, Intrinsics};
use safetensors::{Dtype, SafeTensors};
use std::path::Path;

/// The bytes of a golden file.
fn golden(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../tests/data/golden")
        .join(name);
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A tensor's elements as `f64`, row-major.
fn numbers(tensors: &SafeTensors, name: &str) -> Vec<f64> {
    let view = tensors.tensor(name).unwrap();
    let data = view.data();
    match view.dtype() {
        Dtype::F64 => data
            .as_chunks()
            .0
            .iter()
            .map(|&b| f64::from_le_bytes(b))
            .collect(),
        Dtype::F32 => {
            let values = data.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b));
            values.map(f64::from).collect()
        }
        Dtype::I32 => {
            let values = data.as_chunks().0.iter().map(|&b| i32::from_le_bytes(b));
            values.map(f64::from).collect()
        }
        other => panic!("{name} has elements of type {other:?}"),
    }
}

fn vectors2(tensors: &SafeTensors, name: &str) -> Vec<Vector2<f64>> {
    numbers(tensors, name)
        .as_chunks()
        .0
        .iter()
        .map(|&v: &[f64; 2]| v.into())
        .collect()
}

fn vectors3(tensors: &SafeTensors, name: &str) -> Vec<Vector3<f64>> {
    numbers(tensors, name)
        .as_chunks()
        .0
        .iter()
        .map(|&v: &[f64; 3]| v.into())
        .collect()
}

/// The camera of case 10 with the intrinsics called `k`.
fn camera(tensors: &SafeTensors, k: &str) -> Camera {
    let k = Matrix3::from_row_slice(&numbers(tensors, k));
    let pose = Matrix4::from_row_slice(&numbers(tensors, "pose_c2w"));
    let intrinsics = Intrinsics::try_from_matrix(&k).unwrap();
    Camera::try_from_matrices(intrinsics, &pose, 512, 512).unwrap()
}

/// Checks rays and projections of one set of intrinsics.
///
/// Tolerances are the README's. Depth has none there: the reference inverts the
/// pose and we transpose its float32 rotation, which is 5e-7 off orthogonal; at
/// distances of 2 that makes 1.2e-6.
fn check_rays_and_projections(k: &str, prefix: &str) {
    let bytes = golden("10_rays_projection.safetensors");
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let camera = camera(&tensors, k);

    let uv = vectors2(&tensors, "uv");
    let directions = vectors3(&tensors, &format!("f64.{prefix}ray_dirs"));
    let center = vectors3(&tensors, "f64.cam_loc")[0];
    for (point, expected) in uv.iter().zip(&directions) {
        let ray = camera.ray_through(point);
        assert!((ray.direction - expected).amax() < 1e-6);
        assert!((ray.origin - center).amax() < 1e-6);
    }

    let points = vectors3(&tensors, "world_points");
    let pixels = vectors2(&tensors, &format!("f64.{prefix}pixel"));
    let calibrated = vectors2(&tensors, "f64.calibrated");
    let depths = numbers(&tensors, "f64.camera_z");
    for (i, point) in points.iter().enumerate() {
        let projection = camera.project(point);
        assert!((projection.pixel - pixels[i]).amax() < 1e-3, "pixel {i}");
        assert!(
            (projection.calibrated - calibrated[i]).amax() < 3e-6,
            "calibrated {i}"
        );
        assert!((projection.depth - depths[i]).abs() < 2e-6, "depth {i}");
    }
    assert!(
        depths[18] < 0.0 && depths[19] < 0.0,
        "the last two are behind the camera"
    );
}

#[test]
fn rays_and_projections_are_the_published_ones() {
    check_rays_and_projections("K", "");
}

#[test]
fn skew_is_the_published_one() {
    check_rays_and_projections("skewed_K", "skewed_K/");
}

#[test]
fn points_in_the_camera_plane_are_guarded_as_published() {
    let bytes = golden("10_rays_projection.safetensors");
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let intrinsics = Intrinsics::from_matrix(&Matrix3::identity());
    let camera = Camera::from_matrices(intrinsics, &Matrix4::identity(), 1, 1);
    let points = vectors3(&tensors, "f64.guard/points");
    let expected = vectors2(&tensors, "f64.guard/projected");
    for (point, expected) in points.iter().zip(&expected) {
        let pixel = camera.project(point).pixel;
        let scale = expected.amax().max(1.0);
        assert!(
            (pixel - expected).amax() <= 1e-12 * scale,
            "{point}: {pixel} {expected}"
        );
    }
}

#[test]
fn assignment_has_the_published_total_cost() {
    let bytes = golden("07_gjp_assignment.safetensors");
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    for (problem, rows, columns) in [("p20x64", 20, 64), ("p64x64", 64, 64), ("p90x64", 90, 64)] {
        let cost = numbers(&tensors, &format!("f64.{problem}/cost"));
        let expected = numbers(&tensors, &format!("f64.{problem}/total_cost"))[0];
        let assignment = assign(&cost, rows, columns).unwrap();
        assert!(
            (assignment.total_cost - expected).abs() < 1e-12 * expected,
            "{problem}"
        );

        // The other problem is degenerate: its indices depend on rounding.
        if problem == "p64x64" {
            continue;
        }
        let expected_rows = numbers(&tensors, &format!("{problem}/assign_row_local"));
        let expected_columns = numbers(&tensors, &format!("{problem}/assign_col_global"));
        let expected = expected_rows
            .iter()
            .map(|&x| x as usize)
            .zip(expected_columns.iter().map(|&x| x as usize));
        assert!(assignment.pairs().eq(expected), "{problem}");
    }

    let ties = numbers(&tensors, "ties12x17/cost");
    let transposed: Vec<f64> = (0..17 * 12).map(|i| ties[i % 12 * 17 + i / 12]).collect();
    for (name, cost, rows, columns) in [
        ("ties12x17", &ties, 12, 17),
        ("ties17x12", &transposed, 17, 12),
    ] {
        let expected = numbers(&tensors, &format!("{name}/total_cost"))[0];
        assert_eq!(
            assign(cost, rows, columns).unwrap().total_cost,
            expected,
            "{name}"
        );
    }
}
