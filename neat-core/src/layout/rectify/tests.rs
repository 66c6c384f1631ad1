//! Scenes of distorted and of large photographs, as [`load_posed`] reads them.

use super::super::load::load_posed;
use super::super::poses::Poses;
use super::super::{Layout, LoadOptions, LoadedScene, SceneWarning};
use super::*;
use crate::{Observation, SceneError, Similarity, SparsePoint, file, hawp_json};
use image::Rgb;
use nalgebra::{Matrix4, Vector3};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const SIZE: (u32, u32) = (96, 64);
const INTRINSICS: Intrinsics = Intrinsics {
    fx: 80.0,
    fy: 82.0,
    cx: 49.0,
    cy: 31.5,
    skew: 0.0,
};
const BARREL: Distortion = Distortion::Brown {
    radial: [-0.2, 0.03, 0.0, 0.0, 0.0, 0.0],
    tangential: [1e-3, -1e-3],
};

/// A pose that looks along +z from 5 before the origin.
fn pose() -> Matrix4<f64> {
    Matrix4::new_translation(&Vector3::new(0.0, 0.0, -5.0))
}

/// Points of the object, the last one of which the undistorted image does not
/// show.
fn points() -> [Vector3<f64>; 4] {
    let corner = INTRINSICS.calibrate(&Vector2::new(0.6, 0.6));
    let corner = BARREL.undistort(&corner).unwrap() * 5.0;
    [
        Vector3::new(0.0, 0.0, 0.0),
        Vector3::new(1.5, 0.5, 0.0),
        Vector3::new(-1.0, -1.2, 0.0),
        Vector3::new(corner.x, corner.y, 0.0),
    ]
}

/// Where the photograph shows a point, in image coordinates.
fn in_photograph(distortion: &Distortion, point: &Vector3<f64>) -> Vector2<f64> {
    let calibrated = Vector2::new(point.x, point.y) / (point.z + 5.0);
    INTRINSICS.decalibrate(&distortion.distort(&calibrated))
}

fn picture(x: u32, y: u32) -> Rgb<u8> {
    Rgb([(2 * x) as u8, (3 * y) as u8, (x + y) as u8])
}

/// Two views with a lens, the second of another name and colour, each with a
/// wireframe of `points` detected in the photograph.
fn poses(dir: &Path, distortion: Distortion, pixel_center: f64) -> Poses {
    fs::create_dir_all(dir.join("hawp")).unwrap();
    let names = ["a", "b"];
    for (index, name) in names.into_iter().enumerate() {
        let image = RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| picture(x, y + index as u32));
        image.save(dir.join(format!("{name}.png"))).unwrap();
        let mut wireframe = Wireframe2d::empty(SIZE.0, SIZE.1);
        wireframe.vertices = points()
            .map(|point| in_photograph(&distortion, &point))
            .to_vec();
        wireframe.vertex_scores = vec![0.5; 4];
        wireframe.edges = vec![[0, 1], [1, 2], [0, 3]];
        wireframe.edge_scores = vec![0.9; 3];
        let path = dir.join(format!("hawp/{name}.json"));
        hawp_json::write(&path, &wireframe, pixel_center).unwrap();
    }
    let seen = |point: Vector3<f64>| SparsePoint {
        position_in_world: point,
        observations: [0, 1]
            .map(|view| Observation {
                view,
                pixel: in_photograph(&distortion, &point),
            })
            .to_vec(),
    };
    Poses {
        path: dir.join("poses"),
        views: names
            .map(|name| PosedImage {
                name: name.into(),
                image: dir.join(format!("{name}.png")),
                intrinsics: INTRINSICS,
                distortion,
                world_from_camera: pose(),
                size: None,
            })
            .into(),
        original_from_world: Similarity::identity(),
        file_axes: Default::default(),
        pixel_center: Some(pixel_center),
        points: points().map(seen).to_vec(),
        // The world stays as it is.
        declared_radius: Some(1.0),
    }
}

fn load(dir: &TempDir, distortion: Distortion, options: &LoadOptions) -> LoadedScene {
    try_load(dir, distortion, 0.5, options).unwrap()
}

fn try_load(
    dir: &TempDir,
    distortion: Distortion,
    pixel_center: f64,
    options: &LoadOptions,
) -> Result<LoadedScene, SceneError> {
    let poses = poses(dir.path(), distortion, pixel_center);
    load_posed(dir.path(), Layout::CamerasJson, poses, options)
}

/// The image of the first view.
fn image_of(loaded: &LoadedScene) -> RgbImage {
    loaded.scene.views[0].image.read().unwrap().into_owned()
}

fn scaled_to(max_image_size: u32) -> LoadOptions {
    LoadOptions {
        max_image_size: Some(max_image_size),
        ..LoadOptions::default()
    }
}

fn cached_in(dir: impl Into<std::path::PathBuf>) -> LoadOptions {
    LoadOptions {
        cache_dir: Some(dir.into()),
        ..LoadOptions::default()
    }
}

#[test]
fn wireframes_and_observations_are_where_the_new_cameras_see_the_points() {
    let dir = tempfile::tempdir().unwrap();
    for pixel_center in [0.0, 0.5] {
        for options in [LoadOptions::default(), scaled_to(50)] {
            let loaded = try_load(&dir, BARREL, pixel_center, &options).unwrap();
            let scene = &loaded.scene;
            scene.validate().unwrap();
            for (index, view) in scene.views.iter().enumerate() {
                let seen = points().map(|point| view.camera.project(&point).pixel);
                for (found, expected) in view.wireframe.vertices.iter().zip(&seen[..3]) {
                    assert!((found - expected).norm() < 1e-9);
                }
                // The last point is outside, and the edge to it is cut.
                assert_eq!(view.wireframe.vertices.len(), 4);
                assert_eq!(view.wireframe.edges, [[0, 1], [1, 2], [0, 3]]);
                let cut = view.wireframe.vertices[3];
                let (along, whole) = (cut - seen[0], seen[3] - seen[0]);
                assert!(along.perp(&whole).abs() < 1e-9 && along.norm() < whole.norm());

                for (point, expected) in scene.sparse_points[..3].iter().zip(&seen) {
                    let observation = point.observations[index];
                    assert_eq!(observation.view, index);
                    assert!((observation.pixel - expected).norm() < 1e-9);
                }
            }
            assert_eq!(scene.sparse_points[3].observations, []);
        }
    }
}

#[test]
fn images_are_those_of_the_lens_and_the_smaller_size() {
    let dir = tempfile::tempdir().unwrap();
    let whole = load(&dir, BARREL, &LoadOptions::default());
    let photograph = RgbImage::from_fn(SIZE.0, SIZE.1, picture);
    let undistortion = Undistortion::new(&INTRINSICS, &BARREL, SIZE, 0.5).unwrap();
    let expected = undistortion.resample(&photograph);
    assert_eq!(image_of(&whole), expected);
    assert_eq!(
        whole.scene.views[0].camera.intrinsics,
        *undistortion.pinhole()
    );
    let undistorted = SceneWarning::Undistorted {
        lenses: vec!["Brown"],
        views: 2,
    };
    assert_eq!(whole.warnings, std::slice::from_ref(&undistorted));
    assert!(
        undistorted.to_string().contains("2 views") && undistorted.to_string().contains("Brown")
    );

    let small = load(&dir, BARREL, &scaled_to(48));
    let scaling = Downscaling::new(SIZE, 48, 0.5).unwrap();
    assert_eq!(image_of(&small), scaling.resample(&expected));
    let scaled = SceneWarning::ScaledDown {
        max_image_size: 48,
        views: 2,
    };
    assert_eq!(small.warnings, [undistorted, scaled]);

    let plain = load(&dir, Distortion::None, &scaled_to(96));
    assert_eq!(plain.warnings, []);
    assert_eq!(image_of(&plain), photograph);
    assert_eq!(plain.scene.views[0].camera.intrinsics, INTRINSICS);
}

#[test]
fn wireframes_of_the_smaller_size_are_used_as_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let poses = poses(dir.path(), Distortion::None, 0.5);
    let small = Wireframe2d {
        vertices: vec![Vector2::new(3.5, 4.5), Vector2::new(20.5, 9.5)],
        vertex_scores: vec![0.5; 2],
        edges: vec![[0, 1]],
        edge_scores: vec![0.9],
        width: 48,
        height: 32,
    };
    let path = dir.path().join("hawp/b.json");
    hawp_json::write(&path, &small, 0.5).unwrap();
    let loaded = load_posed(dir.path(), Layout::CamerasJson, poses, &scaled_to(48)).unwrap();
    assert_eq!(loaded.scene.views[1].wireframe, small);
    // Half of where it is in the photograph.
    let expected = in_photograph(&Distortion::None, &points()[1]) / 2.0;
    assert!((loaded.scene.views[0].wireframe.vertices[1] - expected).norm() < 1e-12);

    let poses = self::poses(dir.path(), Distortion::None, 0.5);
    hawp_json::write(&path, &small, 0.5).unwrap();
    let error = load_posed(
        dir.path(),
        Layout::CamerasJson,
        poses,
        &LoadOptions::default(),
    );
    let message = error.unwrap_err().to_string();
    assert!(message.contains("48×32") && message.contains("96×64") && message.contains("`b`"));
}

#[test]
fn the_same_is_read_with_little_memory() {
    let dir = TempDir::new().unwrap();
    let plenty = load(&dir, BARREL, &LoadOptions::default()).scene;
    for cache_dir in [None, Some(dir.path().join("cache"))] {
        let options = LoadOptions {
            memory_limit: crate::MemoryLimit::of_bytes(120_000),
            cache_dir,
            ..LoadOptions::default()
        };
        let little = load(&dir, BARREL, &options).scene;
        assert_eq!(little.views.len(), plenty.views.len());
        for (little, plenty) in little.views.iter().zip(&plenty.views) {
            assert!(little.image.is_in_file() && !plenty.image.is_in_file());
            assert_eq!(little.image.read().unwrap(), plenty.image.read().unwrap());
            assert_eq!(little.camera, plenty.camera);
            assert_eq!(little.wireframe, plenty.wireframe);
        }
    }
}

#[test]
fn the_second_time_images_come_from_the_cache() {
    let dir = tempfile::tempdir().unwrap();
    let cache = dir.path().join("cache");
    let entries = || fs::read_dir(&cache).map_or(0, Iterator::count);
    // Nothing is kept of photographs without distortion.
    load(&dir, Distortion::None, &cached_in(&cache));
    assert_eq!(entries(), 0);

    let first = image_of(&load(&dir, BARREL, &cached_in(&cache)));
    assert_eq!(entries(), 2);
    // The cache is what is read: another picture of the same key is believed.
    let forged = RgbImage::from_pixel(SIZE.0, SIZE.1, Rgb([1, 2, 3]));
    let view = &poses(dir.path(), BARREL, 0.5).views[0];
    let camera = Camera::from_matrices(INTRINSICS, &pose(), SIZE.0, SIZE.1);
    let rectification = Rectification::new(view, camera, 0.5, None).unwrap();
    let key = super::super::photograph::key(
        &file::read(&view.image, "").unwrap(),
        &rectification,
        [0; 3],
    );
    let store = crate::file_cache::FileCache::new(&cache);
    let kept = store.get(&key).unwrap();
    store
        .put(&key, &super::super::photograph::png(&forged).unwrap())
        .unwrap();
    assert_eq!(image_of(&load(&dir, BARREL, &cached_in(&cache))), forged);

    // What cannot be a result is made again: no PNG, and one of another size.
    let small = super::super::photograph::png(&RgbImage::new(5, 5)).unwrap();
    for bad in [b"no image".as_slice(), &kept[..kept.len() / 2], &small] {
        store.put(&key, bad).unwrap();
        let again = load(&dir, BARREL, &cached_in(&cache));
        assert_eq!(image_of(&again), first);
        assert_eq!(store.get(&key).unwrap(), kept);
    }
    // Other lenses and sizes are other results.
    load(&dir, Distortion::Fov { omega: 0.5 }, &cached_in(&cache));
    assert_eq!(entries(), 4);
}

#[test]
fn a_cache_that_cannot_be_written_is_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let occupied = dir.path().join("cache");
    fs::write(&occupied, "a file").unwrap();
    let loaded = load(&dir, BARREL, &cached_in(&occupied));
    let without = load(&dir, BARREL, &LoadOptions::default());
    assert_eq!(image_of(&loaded), image_of(&without));
    let [_, warning] = loaded.warnings.as_slice() else {
        panic!("two warnings: {:?}", loaded.warnings);
    };
    assert!(matches!(warning, SceneWarning::NotCached { dir, .. } if *dir == occupied));
    assert!(warning.to_string().contains("cache"));
}

#[test]
fn lenses_that_cannot_be_undistorted_name_file_and_view() {
    let dir = tempfile::tempdir().unwrap();
    let folding = Distortion::Brown {
        radial: [-80.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        tangential: [0.0; 2],
    };
    let error = try_load(&dir, folding, 0.5, &LoadOptions::default()).unwrap_err();
    let message = error.to_string();
    assert!(message.contains("poses") && message.contains("`a`") && message.contains("Brown"));
}

/// One view of 3072×2048 pixels. `cargo test --release -p neat-core --lib -- \
/// --ignored --nocapture rectify::tests::times`
#[test]
#[ignore = "prints times"]
#[allow(clippy::print_stderr)]
fn times_of_a_first_and_a_second_load() {
    let dir = tempfile::tempdir().unwrap();
    let size = (3072, 2048);
    let photograph = RgbImage::from_fn(size.0, size.1, |x, y| {
        let noise = x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503);
        let smooth = 100.0 + 90.0 * (f64::from(x) / 40.0).sin() * (f64::from(y) / 55.0).cos();
        Rgb([smooth as u8, (smooth as u8) / 2, (noise >> 28) as u8])
    });
    let image = dir.path().join("a.jpg");
    photograph.save(&image).unwrap();
    let intrinsics = Intrinsics {
        fx: 2760.0,
        fy: 2765.0,
        cx: 1520.0,
        cy: 1007.0,
        skew: 0.0,
    };
    let load = |options: &LoadOptions| {
        let view = PosedImage {
            name: "a".into(),
            image: image.clone(),
            intrinsics,
            distortion: BARREL,
            world_from_camera: pose(),
            size: Some(size),
        };
        let poses = Poses {
            path: dir.path().join("poses"),
            views: vec![view],
            original_from_world: Similarity::identity(),
            file_axes: Default::default(),
            pixel_center: Some(0.5),
            points: Vec::new(),
            declared_radius: Some(1.0),
        };
        let options = LoadOptions {
            require_wireframes: false,
            ..options.clone()
        };
        let start = std::time::Instant::now();
        load_posed(dir.path(), Layout::CamerasJson, poses, &options).unwrap();
        start.elapsed().as_millis()
    };
    let one_thread = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    one_thread.install(|| {
        for max_image_size in [None, Some(1600)] {
            let options = LoadOptions {
                max_image_size,
                ..cached_in(dir.path().join("cache"))
            };
            let uncached = load(&LoadOptions {
                cache_dir: None,
                ..options.clone()
            });
            let (first, second) = (load(&options), load(&options));
            eprintln!(
                "longest side {max_image_size:?}: {uncached} ms without a cache, \
                 {first} ms the first time, {second} ms the second"
            );
        }
    });
}
