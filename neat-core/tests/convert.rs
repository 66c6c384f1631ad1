//! Scenes written for other programs: read back, chained, and checked against
//! projections computed by hand from the files.

use image::{Rgb, RgbImage};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector2, Vector3, Vector4};
use neat_core::convert::{POINTS_FILE, SceneFormat, convert};
use neat_core::layout::SceneWarning;
use neat_core::npz::NpzReader;
use neat_core::ply::read_points;
use neat_core::{
    Camera, Intrinsics, LoadOptions, Observation, Scene, SceneError, Similarity, SparsePoint, View,
    Wireframe2d, load_scene,
};
use std::fs;
use std::path::Path;

const SIZE: (u32, u32) = (48, 36);
const FORMATS: [SceneFormat; 4] = [
    SceneFormat::Abc,
    SceneFormat::Colmap,
    SceneFormat::CamerasNpz,
    SceneFormat::TransformsJson,
];
/// Sorted, but `a-b.png` is before `a.png` in a folder.
const NAMES: [&str; 3] = ["a", "a-b", "c_0.5"];

fn view(index: usize, pixel_center: f64) -> View {
    let along = index as f64;
    let axis = nalgebra::Unit::new_normalize(Vector3::new(0.3, 1.0, -0.03));
    let intrinsics = Intrinsics {
        fx: 60.0 + 1.0 / 3.0,
        fy: 61.0,
        // The middle would tell where pixel centres are.
        cx: 23.3,
        cy: 18.7 + along,
        skew: 0.0,
    };
    View {
        name: NAMES[index].into(),
        camera: Camera {
            intrinsics,
            world_from_camera: Rotation3::from_axis_angle(&axis, 0.1 * along - 3.1).into_inner(),
            center_in_world: Vector3::new(0.3 * along, -0.1, 3.0 + 1.0 / 7.0),
            width: SIZE.0,
            height: SIZE.1,
        },
        wireframe: Wireframe2d {
            vertices: [Vector2::new(4.5 + along, 9.25), Vector2::new(30.0, 12.5)]
                .map(|vertex| vertex.add_scalar(pixel_center))
                .to_vec(),
            vertex_scores: vec![0.5, 0.75],
            edges: vec![[0, 1]],
            edge_scores: vec![0.9],
            width: SIZE.0,
            height: SIZE.1,
        },
        image: RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            Rgb([(5 * x) as u8, (7 * y) as u8, index as u8])
        })
        .into(),
    }
}

fn scene(pixel_center: f64) -> Scene {
    let views: Vec<_> = (0..3).map(|index| view(index, pixel_center)).collect();
    let positions = [
        Vector3::new(0.1, -0.2, 0.3),
        Vector3::new(-0.3, 0.1, 0.0),
        Vector3::new(0.2, 0.2, -0.1),
    ];
    // The first is seen by two views, half a pixel to the right; the last by none.
    let seen = |view: usize, point: &Vector3<f64>| Observation {
        view,
        pixel: views[view].camera.project(point).pixel + Vector2::new(0.5, 0.0),
    };
    let observers: [&[usize]; 3] = [&[0, 2], &[2], &[]];
    let sparse_points = (positions.iter().zip(observers))
        .map(|(point, observers)| SparsePoint {
            position_in_world: *point,
            observations: observers.iter().map(|&view| seen(view, point)).collect(),
        })
        .collect();
    Scene {
        name: "box".into(),
        views,
        original_from_world: Similarity {
            scale: 15.0,
            translation: Vector3::new(500.0, 7.5, -3.0),
        },
        pixel_center,
        sphere_radius: 0.75,
        sparse_points,
    }
}

fn load(dir: &Path) -> Scene {
    let loaded = load_scene(dir, &LoadOptions::default()).unwrap();
    assert_eq!(loaded.warnings, [], "{}", dir.display());
    loaded.scene
}

/// The same images, cameras and wireframes in the user's frame.
fn assert_same(found: &Scene, expected: &Scene, context: &str) {
    assert_eq!(found.views.len(), expected.views.len(), "{context}");
    for (a, b) in found.views.iter().zip(&expected.views) {
        assert_eq!(a.name, b.name, "{context}");
        assert_eq!(
            a.image.read().unwrap(),
            b.image.read().unwrap(),
            "{context}"
        );
        // K and wireframe count from the same point.
        let shift = found.pixel_center - expected.pixel_center;
        let mut k = b.camera.intrinsics.matrix();
        k[(0, 2)] += shift;
        k[(1, 2)] += shift;
        let difference = (a.camera.intrinsics.matrix() - k).amax() / k.amax();
        assert!(difference < 1e-9, "{context}: K off by {difference:e}");
        assert_eq!((a.camera.width, a.camera.height), SIZE);
        let rotation = (a.camera.world_from_camera - b.camera.world_from_camera).amax();
        assert!(rotation < 1e-9, "{context}: rotation off by {rotation:e}");
        let center = |scene: &Scene, camera: &Camera| {
            scene.original_from_world.apply(&camera.center_in_world)
        };
        let (found, expected) = (center(found, &a.camera), center(expected, &b.camera));
        let difference = (found - expected).norm() / expected.norm();
        assert!(difference < 1e-9, "{context}: centre off by {difference:e}");
        for (a, b) in a.wireframe.vertices.iter().zip(&b.wireframe.vertices) {
            assert_eq!(*a, b.add_scalar(shift), "{context}");
        }
        assert_eq!(a.wireframe.edges, b.wireframe.edges, "{context}");
        assert_eq!(a.wireframe.edge_scores, b.wireframe.edge_scores);
        assert_eq!(a.wireframe.vertex_scores, b.wireframe.vertex_scores);
    }
}

#[test]
fn every_format_reads_back() {
    for pixel_center in [0.0, 0.5] {
        let scene = scene(pixel_center);
        for format in FORMATS {
            let parent = tempfile::tempdir().unwrap();
            let dir = parent.path().join("new/scene");
            convert(&scene, format, &dir).unwrap();
            let context = format!("{format:?}, pixel centre {pixel_center}");
            assert_same(&load(&dir), &scene, &context);
            // No temporary folder is left.
            assert_eq!(fs::read_dir(dir.parent().unwrap()).unwrap().count(), 1);
            let back = load(&dir);
            assert_eq!(back.sparse_points.len(), 3, "{context}");
            for (found, expected) in back.sparse_points.iter().zip(&scene.sparse_points) {
                let original = |scene: &Scene, point: &SparsePoint| {
                    scene.original_from_world.apply(&point.position_in_world)
                };
                let difference = original(&back, found) - original(&scene, expected);
                assert!(difference.norm() < 1e-9, "{context}");
                // Only COLMAP's files say where points were seen.
                if format == SceneFormat::Colmap {
                    let shift = 0.5 - pixel_center;
                    assert_eq!(found.observations.len(), expected.observations.len());
                    for (a, b) in found.observations.iter().zip(&expected.observations) {
                        assert_eq!(a.view, b.view);
                        assert!((a.pixel - b.pixel.add_scalar(shift)).norm() < 1e-9);
                    }
                }
            }
            if format != SceneFormat::Colmap {
                let points = read_points(&dir.join(POINTS_FILE)).unwrap();
                for (found, point) in points.iter().zip(&scene.sparse_points) {
                    let expected = scene.original_from_world.apply(&point.position_in_world);
                    assert_eq!(*found, expected, "{context}");
                }
                assert_eq!(points.len(), 3);
            }
        }
    }
}

#[test]
fn chains_of_formats_lose_nothing() {
    let first = scene(0.0);
    let mut current = first.clone();
    let parent = tempfile::tempdir().unwrap();
    use SceneFormat::{Abc, CamerasNpz, Colmap, TransformsJson};
    let chain = [
        Colmap,
        CamerasNpz,
        TransformsJson,
        Abc,
        CamerasNpz,
        Colmap,
        Abc,
        TransformsJson,
    ];
    for (index, format) in chain.into_iter().enumerate() {
        let dir = parent.path().join(index.to_string());
        convert(&current, format, &dir).unwrap();
        current = load(&dir);
        assert_same(&current, &first, &format!("{format:?}, number {index}"));
    }
}

#[test]
fn formats_of_projections_keep_skew_and_others_refuse_it() {
    let mut scene = scene(0.5);
    scene.views[1].camera.intrinsics.skew = 0.7;
    for format in FORMATS {
        let parent = tempfile::tempdir().unwrap();
        let dir = parent.path().join("scene");
        let result = convert(&scene, format, &dir);
        if matches!(format, SceneFormat::Abc | SceneFormat::CamerasNpz) {
            result.unwrap();
            assert_same(&load(&dir), &scene, "skew");
        } else {
            let message = result.unwrap_err().to_string();
            assert!(
                message.contains("`a-b`") && message.contains("cameras.npz"),
                "{message}"
            );
            assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 0);
        }
    }
}

/// Numbers of the lines of a COLMAP file that are no comments; words that are no
/// numbers are NaN.
fn lines(path: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    let number = |word: &str| word.parse().unwrap_or(f64::NAN);
    lines
        .map(|line| {
            line.split(' ')
                .filter(|word| !word.is_empty())
                .map(number)
                .collect()
        })
        .collect()
}

/// COLMAP's formulas on the files alone: x = K (R X + t), from the corner.
#[test]
fn colmap_projects_the_written_points_to_where_the_scene_sees_them() {
    for pixel_center in [0.0, 0.5] {
        let scene = scene(pixel_center);
        let parent = tempfile::tempdir().unwrap();
        let dir = parent.path().join("scene");
        convert(&scene, SceneFormat::Colmap, &dir).unwrap();
        let model = dir.join("sparse/0");
        let [cameras, images, points] =
            ["cameras", "images", "points3D"].map(|name| lines(&model.join(format!("{name}.txt"))));
        assert_eq!(cameras.len(), 3, "principal points differ");
        assert_eq!(points.len(), 3);
        let text = fs::read_to_string(model.join("images.txt")).unwrap();
        assert!(text.contains(" 2 a-b.png\n"), "{text}");

        let mut observations = 0;
        for point in &points {
            let [id, x, y, z, r, _g, b, error, track @ ..] = point.as_slice() else {
                panic!("{point:?}");
            };
            let truth = &scene.sparse_points[*id as usize - 1];
            let position = Vector3::new(*x, *y, *z);
            let expected = scene.original_from_world.apply(&truth.position_in_world);
            assert!((position - expected).norm() < 1e-9);
            assert_eq!(track.len(), 2 * truth.observations.len());
            match truth.observations.first() {
                None => assert_eq!((*error, *r), (-1.0, 128.0)),
                Some(first) => {
                    assert!((error - 0.5).abs() < 1e-9, "half a pixel to the right");
                    // The pixel's column is a fifth of its red, its blue the view.
                    let column = (first.pixel.x + 0.5 - pixel_center).floor();
                    assert_eq!((*r, *b), (5.0 * column, first.view as f64));
                }
            }
            for element in track.chunks(2) {
                let (image, place) = (element[0] as usize, element[1] as usize);
                let record = &images[2 * (image - 1)];
                let seen = &images[2 * (image - 1) + 1][3 * place..3 * place + 3];
                assert_eq!(seen[2], *id);
                let &[number, w, i, j, k, tx, ty, tz, camera, _name] = record.as_slice() else {
                    panic!("{record:?}");
                };
                assert_eq!(number, image as f64);
                let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
                let p = rotation * position + Vector3::new(tx, ty, tz);
                let camera = &cameras[camera as usize - 1];
                let [_, model, width, height, fx, fy, cx, cy] = camera[..] else {
                    panic!("{camera:?}");
                };
                assert!(model.is_nan() && (width, height) == (48.0, 36.0));
                let projected = Vector2::new(fx * p.x / p.z + cx, fy * p.y / p.z + cy);
                let off = Vector2::new(seen[0], seen[1]) - projected;
                assert!((off - Vector2::new(0.5, 0.0)).norm() < 1e-9, "{off}");
                assert!(p.z > 0.0);
                // What the scene says, counted from the corner.
                let view = &scene.views[image - 1];
                let in_scene = view.camera.project(&truth.position_in_world).pixel;
                let from_corner = in_scene.add_scalar(0.5 - pixel_center);
                assert!((from_corner - projected).norm() < 1e-9);
                observations += 1;
            }
        }
        assert_eq!(observations, 3);
    }
}

/// nerfstudio's conventions on the file alone: x right, y up, looking along −z,
/// and pixels from the corner.
#[test]
fn nerfstudio_projects_points_to_where_the_scene_sees_them() {
    let scene = scene(0.0);
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("scene");
    convert(&scene, SceneFormat::TransformsJson, &dir).unwrap();
    let text = fs::read_to_string(dir.join("transforms.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["ply_file_path"], POINTS_FILE);
    let frames = json["frames"].as_array().unwrap();
    for (frame, view) in frames.iter().zip(&scene.views) {
        assert_eq!(frame["file_path"], format!("images/{}.png", view.name));
        let element = |i: usize, j: usize| frame["transform_matrix"][i][j].as_f64().unwrap();
        let number = |key: &str| frame[key].as_f64().unwrap();
        let rotation = Matrix3::from_fn(element);
        assert!((rotation.determinant() - 1.0).abs() < 1e-12);
        let center = Vector3::from_fn(|i, _| element(i, 3));
        let last = Vector4::from_fn(|j, _| element(3, j));
        assert_eq!(last, Vector4::new(0.0, 0.0, 0.0, 1.0));
        for point in &scene.sparse_points {
            let original = scene.original_from_world.apply(&point.position_in_world);
            let p = rotation.transpose() * (original - center);
            assert!(p.z < 0.0, "in front of the camera");
            let right = p.x / -p.z * number("fl_x") + number("cx");
            let down = -p.y / -p.z * number("fl_y") + number("cy");
            let expected = view.camera.project(&point.position_in_world).pixel;
            let found = Vector2::new(right, down) - expected;
            // The scene counts from the centre of the first pixel.
            assert!((found - Vector2::new(0.5, 0.5)).norm() < 1e-9, "{found}");
        }
    }
}

#[test]
fn idr_reads_projections_of_the_original_frame() {
    let scene = scene(0.0);
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("scene");
    convert(&scene, SceneFormat::CamerasNpz, &dir).unwrap();
    let mut npz = NpzReader::open(&dir.join("cameras.npz"), "").unwrap();
    // By the order of the files: `a-b.png` is the first.
    for (index, name) in ["a-b", "a", "c_0.5"].into_iter().enumerate() {
        let view = scene.views.iter().find(|view| view.name == name).unwrap();
        let mut matrix = |name: &str| {
            nalgebra::Matrix4::from_row_slice(
                &npz.array(&format!("{name}_{index}")).unwrap().values,
            )
        };
        let (world, scale) = (matrix("world_mat"), matrix("scale_mat"));
        let point = scene.sparse_points[0].position_in_world;
        let expected = view.camera.project(&point);
        for homogeneous in [
            // The scene sphere is the unit ball of the normalised world.
            world * scale * (point / scene.sphere_radius).push(1.0),
            world * scene.original_from_world.apply(&point).push(1.0),
        ] {
            let found = Vector2::new(homogeneous.x, homogeneous.y) / homogeneous.z;
            assert!((found - expected.pixel).norm() < 1e-9);
        }
    }
}

#[test]
fn shared_cameras_are_written_once_and_wireframes_of_all_views_or_of_none() {
    let mut scene = scene(0.5);
    scene.views[1].camera.intrinsics = scene.views[0].camera.intrinsics;
    scene.views[1].wireframe = Wireframe2d::empty(SIZE.0, SIZE.1);
    scene.sparse_points.clear();
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("scene");
    convert(&scene, SceneFormat::Colmap, &dir).unwrap();
    assert_eq!(lines(&dir.join("sparse/0/cameras.txt")).len(), 2);
    assert_eq!(lines(&dir.join("sparse/0/points3D.txt")).len(), 0);
    // One for the view without segments too, which is not to be detected again.
    assert_eq!(fs::read_dir(dir.join("hawp")).unwrap().count(), 3);
    let options = LoadOptions {
        require_wireframes: false,
        ..LoadOptions::default()
    };
    assert_same(&load_scene(&dir, &options).unwrap().scene, &scene, "shared");

    for view in &mut scene.views {
        view.wireframe = Wireframe2d::empty(SIZE.0, SIZE.1);
    }
    for format in FORMATS {
        let dir = parent.path().join(format!("{format:?}"));
        convert(&scene, format, &dir).unwrap();
        assert!(!dir.join(POINTS_FILE).exists());
        assert!(!dir.join("hawp").exists());
    }
}

#[test]
fn bad_targets_and_names_are_refused() {
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("scene");
    convert(&scene(0.5), SceneFormat::Abc, &dir).unwrap();
    for format in FORMATS {
        let error = convert(&scene(0.5), format, &dir).unwrap_err();
        assert!(matches!(error, SceneError::NotEmpty { .. }), "{error}");
    }
    assert_same(&load(&dir), &scene(0.5), "untouched");

    let mut spaced = scene(0.5);
    spaced.views[2].name = "c 1".into();
    let target = parent.path().join("other");
    let message = convert(&spaced, SceneFormat::Colmap, &target)
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("`c 1`") && message.contains("space"),
        "{message}"
    );
    convert(&spaced, SceneFormat::TransformsJson, &target).unwrap();
    assert_same(&load(&target), &spaced, "spaces");

    let mut bad = scene(0.5);
    bad.views[0].camera.center_in_world.x = f64::NAN;
    let target = parent.path().join("bad");
    assert!(convert(&bad, SceneFormat::Colmap, &target).is_err());
    assert!(!target.exists());
}

/// A lens is put into the files of a scene; what is written of that is a pinhole.
#[test]
fn distorted_scenes_are_written_undistorted() {
    let parent = tempfile::tempdir().unwrap();
    let distorted = parent.path().join("distorted");
    convert(&scene(0.5), SceneFormat::Colmap, &distorted).unwrap();
    let cameras = distorted.join("sparse/0/cameras.txt");
    let pinholes = fs::read_to_string(&cameras).unwrap();
    let lens = |line: &str| match line.starts_with('#') {
        true => format!("{line}\n"),
        false => format!(
            "{} -0.2 0.05 0.001 -0.002\n",
            line.replace("PINHOLE", "OPENCV")
        ),
    };
    fs::write(&cameras, pinholes.lines().map(lens).collect::<String>()).unwrap();

    let loaded = load_scene(&distorted, &LoadOptions::default()).unwrap();
    let undistorted = SceneWarning::Undistorted {
        lenses: vec!["Brown"],
        views: 3,
    };
    assert_eq!(loaded.warnings, [undistorted]);
    let original = &scene(0.5).views[0];
    let [bent, straight] =
        [&loaded.scene.views[0], original].map(|view| view.image.read().unwrap());
    assert_ne!(bent, straight);
    for format in FORMATS {
        let dir = parent.path().join(format!("{format:?}"));
        convert(&loaded.scene, format, &dir).unwrap();
        assert_same(&load(&dir), &loaded.scene, &format!("{format:?}"));
    }
}
