//! Points of scenes whose surfaces are known.

use image::{Rgb, RgbImage};
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::{Camera, Intrinsics, Scene, Similarity, View, Wireframe2d};
use neat_stereo::{StereoError, SurfacePoint, match_views};
use std::ops::ControlFlow;

const SIZE: (u32, u32) = (256, 192);
const BALL_RADIUS: f64 = 1.2;
/// Pixels of the lattices of four views.
const PIXELS: usize = 4 * 128 * 96;

/// A camera at `center` that looks at the origin.
fn camera(center: Vector3<f64>) -> Camera {
    let forward = -center.normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    Camera {
        intrinsics: Intrinsics::centered(240.0, SIZE),
        world_from_camera: Matrix3::from_columns(&[right, forward.cross(&right), forward]),
        center_in_world: center,
        width: SIZE.0,
        height: SIZE.1,
    }
}

/// Waves in all directions.
fn texture(x: f64, y: f64) -> f64 {
    let wave = |k: i32| {
        let k = f64::from(k);
        let (sin, cos) = (2.4 * k).sin_cos();
        ((20.0 + 9.0 * k) * (x * cos + y * sin) + k * k).sin()
    };
    128.0 + 15.0 * (0..8).map(wave).sum::<f64>()
}

/// Two walls that meet in an edge, x = −|y| / 2, with what `paint` says on them.
fn view(name: &str, camera: Camera, paint: impl Fn(f64, f64) -> f64) -> View {
    let image = RgbImage::from_fn(SIZE.0, SIZE.1, |column, row| {
        let pixel = Vector2::new(f64::from(column) + 0.5, f64::from(row) + 0.5);
        let ray = camera.ray_through(&pixel);
        let hit = [1.0, -1.0].map(|side| {
            let normal = Vector3::new(1.0, 0.5 * side, 0.0);
            let distance = -normal.dot(&ray.origin) / normal.dot(&ray.direction);
            let point = ray.origin + ray.direction * distance;
            (distance > 0.0 && point.y * side >= 0.0).then_some(point)
        });
        // The walls are seen from outside of their edge: one of them at most.
        let point = hit.into_iter().flatten().next();
        Rgb([point.map_or(0, |point| paint(point.y, point.z).clamp(0.0, 255.0) as u8); 3])
    });
    View {
        name: name.into(),
        camera,
        wireframe: Wireframe2d::empty(SIZE.0, SIZE.1),
        image: image.into(),
    }
}

/// Seen from `count` places on an arc before the walls.
fn scene(count: usize, paint: impl Fn(f64, f64) -> f64 + Copy) -> Scene {
    let place = |k: usize| {
        let (sin, cos) = (0.2 * (k as f64 - 1.5)).sin_cos();
        Vector3::new(2.5 * cos, 2.5 * sin, 0.3 * (k % 2) as f64)
    };
    let views = (0..count).map(|k| view(&format!("view-{k}"), camera(place(k)), paint));
    Scene {
        name: "walls".into(),
        views: views.collect(),
        original_from_world: Similarity::identity(),
        pixel_center: 0.5,
        sphere_radius: BALL_RADIUS,
        sparse_points: Vec::new(),
    }
}

fn points(scene: &Scene) -> Vec<SurfacePoint> {
    match_views(scene, BALL_RADIUS, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Distance from the walls, and the normal of the wall there.
fn truth(point: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let normal = Vector3::new(1.0, 0.5 * point.y.signum(), 0.0).normalize();
    (normal.dot(point).abs(), normal)
}

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

#[test]
fn points_lie_on_textured_walls() {
    let found = points(&scene(4, texture));
    assert!(found.len() > PIXELS / 2, "{} points", found.len());
    let distances: Vec<f64> = (found.iter())
        .map(|point| truth(&point.position_in_world).0)
        .collect();
    // A pixel is .0104 wide at the edge.
    let [median, most] = [0.5, 0.95].map(|share| quantile(distances.clone(), share));
    assert!(median < 0.002 && most < 0.0104, "{median} {most}");
    let angle = |point: &SurfacePoint| {
        let (_, normal) = truth(&point.position_in_world);
        point.normal_in_world.angle(&normal).to_degrees()
    };
    let angle = quantile(found.iter().map(angle).collect(), 0.5);
    assert!(angle < 5.0, "{angle}");
    for point in &found {
        assert!((point.normal_in_world.norm() - 1.0).abs() < 1e-6);
        assert!(point.views.len() >= 3 && point.views.is_sorted());
        assert!(point.position_in_world.norm() < BALL_RADIUS);
    }
}

#[test]
fn points_do_not_depend_on_the_number_of_threads() {
    let scene = scene(4, texture);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| points(&scene))
    };
    let alone = with(1);
    assert!(!alone.is_empty());
    for threads in [2, 3] {
        assert_eq!(with(threads), alone);
    }
}

#[test]
fn where_nothing_agrees_there_are_no_points() {
    let all = scene(4, texture);
    // Two views agree on many a wrong point.
    for count in 0..3 {
        let mut few = all.clone();
        few.views.truncate(count);
        assert_eq!(points(&few), []);
    }
    // Walls of one colour.
    assert_eq!(points(&scene(4, |_, _| 90.0)), []);

    // Cameras that look away from each other.
    let mut apart = all.clone();
    for (k, view) in apart.views.iter_mut().enumerate() {
        let (sin, cos) = (1.57 * k as f64).sin_cos();
        view.camera = camera(2.5 * Vector3::new(cos, sin, 0.0));
    }
    assert_eq!(points(&apart), []);

    // Images that have nothing to do with each other.
    let mut strangers = all;
    for (k, view) in strangers.views.iter_mut().enumerate() {
        let elsewhere = move |x: f64, y: f64| texture(x + 3.7 * k as f64, y - 5.1 * k as f64);
        *view = self::view(&view.name, view.camera, elsewhere);
    }
    let chance = points(&strangers).len();
    assert!(chance < PIXELS / 100, "{chance} points");
}

#[test]
fn a_strip_of_an_image_does_no_harm() {
    let mut scene = scene(4, texture);
    let alone = points(&scene);
    let mut strip = scene.views[3].clone();
    strip.name = "view-4".into();
    strip.image = RgbImage::new(300, 1).into();
    (strip.camera.width, strip.camera.height) = (300, 1);
    scene.views.push(strip);
    assert_eq!(points(&scene), alone);
}

#[test]
fn it_ends_when_nobody_wants_it() {
    let scene = scene(4, texture);
    let mut told = Vec::new();
    let result = match_views(&scene, BALL_RADIUS, &mut |share| {
        told.push(share);
        ControlFlow::Break(())
    });
    assert!(matches!(result, Err(StereoError::Interrupted)));
    assert_eq!(told, [0.0]);
}
