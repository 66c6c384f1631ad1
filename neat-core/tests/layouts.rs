//! Scenes written and read in every layout, and the errors of bad ones.

use image::{Rgb, RgbImage};
use nalgebra::{Matrix4, Rotation3, Vector2, Vector3};
use neat_core::layout::{
    CameraAxes, Layout, PixelCenter, PoseConvention, PoseDirection, SceneWarning, abc,
};
use neat_core::npz::{NpyArray, write_npz};
use neat_core::{
    Camera, Intrinsics, LoadOptions, LoadedScene, Scene, SceneError, Similarity, SphereChoice,
    View, Wireframe2d, load_scene,
};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const WIDTH: u32 = 12;
const HEIGHT: u32 = 8;

/// A camera at `center`, turned by `angle` about an oblique axis.
fn camera(angle: f64, center: Vector3<f64>) -> Camera {
    let axis = nalgebra::Unit::new_normalize(Vector3::new(0.3, 1.0, -0.2));
    Camera {
        intrinsics: Intrinsics {
            fx: 20.0,
            fy: 21.0,
            cx: 6.0,
            cy: 4.0,
            skew: 0.25,
        },
        world_from_camera: Rotation3::from_axis_angle(&axis, angle).into_inner(),
        center_in_world: center,
        width: WIDTH,
        height: HEIGHT,
    }
}

fn view(index: u32) -> View {
    let along = f64::from(index);
    View {
        name: format!("view_{index}"),
        camera: camera(0.7 * along, Vector3::new(along, -2.0, 0.5)),
        wireframe: Wireframe2d {
            vertices: vec![Vector2::new(1.5 + along, 2.25), Vector2::new(7.0, 3.0)],
            vertex_scores: vec![0.5, 0.75],
            edges: vec![[0, 1]],
            edge_scores: vec![0.9],
            width: WIDTH,
            height: HEIGHT,
        },
        image: RgbImage::from_fn(WIDTH, HEIGHT, |x, y| Rgb([x as u8, y as u8, index as u8])).into(),
    }
}

fn scene() -> Scene {
    Scene {
        name: "box".into(),
        views: (0..3).map(view).collect(),
        original_from_world: Similarity {
            scale: 15.0,
            translation: Vector3::new(5.0, 7.5, 3.0),
        },
        pixel_center: 0.5,
        sphere_radius: 0.75,
        sparse_points: Vec::new(),
    }
}

/// The test scene on disk.
fn scene_dir() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    abc::write_scene(&scene(), dir.path()).unwrap();
    dir
}

fn load(dir: &TempDir) -> Result<LoadedScene, SceneError> {
    load_scene(dir.path(), &LoadOptions::default())
}

fn message(dir: &TempDir) -> String {
    load(dir).unwrap_err().to_string()
}

fn assert_same_views(found: &Scene, expected: &Scene, tolerance: f64) {
    assert_eq!(found.views.len(), expected.views.len());
    for (found, expected) in found.views.iter().zip(&expected.views) {
        assert_eq!(found.name, expected.name);
        assert_eq!(found.image.read().unwrap(), expected.image.read().unwrap());
        assert_eq!(found.wireframe, expected.wireframe);
        let (a, b) = (&found.camera, &expected.camera);
        assert!((a.intrinsics.matrix() - b.intrinsics.matrix()).amax() <= tolerance);
        assert!((a.matrix_world_from_camera() - b.matrix_world_from_camera()).amax() <= tolerance);
        assert_eq!((a.width, a.height), (b.width, b.height));
    }
}

/// Changes the wireframe file of a view.
fn edit_hawp(dir: &TempDir, name: &str, from: &str, to: &str) {
    let path = dir.path().join("hawp").join(format!("{name}.json"));
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(&path, text.replace(from, to)).unwrap();
}

/// Writes `cameras.npz` with the given poses and the intrinsics of the scene.
fn write_poses(dir: &Path, shape: Vec<usize>, values: Vec<f64>) {
    let k = scene().views[0]
        .camera
        .intrinsics
        .matrix()
        .to_homogeneous()
        .transpose();
    let intrinsics = NpyArray {
        shape: vec![3, 4, 4],
        values: k.as_slice().repeat(3),
    };
    let extrinsics = NpyArray { shape, values };
    let arrays = BTreeMap::from([("intrinsics", intrinsics), ("extrinsics", extrinsics)]);
    write_npz(&dir.join("cameras.npz"), &arrays).unwrap();
}

#[test]
fn the_abc_layout_round_trips_exactly() {
    let loaded = load(&scene_dir()).unwrap();
    assert_eq!(loaded.layout, Layout::Abc);
    assert_eq!(loaded.warnings, []);
    assert_same_views(&loaded.scene, &scene(), 0.0);
    assert_eq!(
        loaded.scene.original_from_world,
        scene().original_from_world
    );
    assert_eq!(loaded.scene.pixel_center, 0.5);
    assert_eq!(loaded.scene.sphere_radius, 0.75);
    loaded.scene.validate().unwrap();
}

#[test]
fn writing_twice_gives_the_same_bytes() {
    let (a, b) = (scene_dir(), scene_dir());
    for file in ["cameras.npz", "hawp/view_1.json", "images/view_1.png"] {
        let read = |dir: &TempDir| fs::read(dir.path().join(file)).unwrap();
        assert_eq!(read(&a), read(&b), "{file}");
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let dir = scene_dir();
    edit_hawp(&dir, "view_1", "0.9", "\"x\"");
    edit_hawp(&dir, "view_2", "0.9", "\"x\"");
    for threads in [1, 4] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let message = pool.install(|| message(&dir));
        assert!(
            message.contains("view_1"),
            "the first bad view decides: {message}"
        );
    }
}

#[test]
fn the_dtu_layout_is_decomposed() {
    let expected = scene();
    let dir = scene_dir();
    fs::rename(dir.path().join("images"), dir.path().join("image")).unwrap();
    let scale_mat = expected.original_from_world.matrix();
    let matrix4 = |m: Matrix4<f64>| NpyArray {
        shape: vec![4, 4],
        values: m.transpose().as_slice().to_vec(),
    };
    let names: Vec<_> = (0..3)
        .map(|i| [format!("world_mat_{i}"), format!("scale_mat_{i}")])
        .collect();
    let mut arrays = BTreeMap::new();
    for (view, [world_mat, scale]) in expected.views.iter().zip(&names) {
        let camera_from_world = view
            .camera
            .matrix_world_from_camera()
            .try_inverse()
            .unwrap();
        let projection = view.camera.intrinsics.matrix().to_homogeneous() * camera_from_world;
        let world = projection * scale_mat.try_inverse().unwrap();
        arrays.insert(world_mat.as_str(), matrix4(world));
        arrays.insert(scale.as_str(), matrix4(scale_mat));
    }
    write_npz(&dir.path().join("cameras.npz"), &arrays).unwrap();

    let loaded = load(&dir).unwrap();
    assert_eq!(loaded.layout, Layout::Dtu);
    // The principal point is the middle of the image, so the corner is the origin.
    assert_eq!(loaded.scene.pixel_center, 0.5);
    assert_same_views(&loaded.scene, &expected, 1e-9);
    assert_eq!(
        loaded.scene.original_from_world,
        expected.original_from_world
    );

    // NeuS's file is preferred to the other one; further arrays do not matter.
    let plain = dir.path().join("cameras.npz");
    let sphere = dir.path().join("cameras_sphere.npz");
    let mut with_more = arrays.clone();
    with_more.insert("camera_mat_0", matrix4(Matrix4::identity()));
    with_more.insert("scale_mat_inv_0", matrix4(Matrix4::identity()));
    write_npz(&sphere, &with_more).unwrap();
    fs::write(&plain, "no archive").unwrap();
    let from_sphere = load(&dir).unwrap();
    assert_eq!(from_sphere.layout, Layout::Dtu);
    assert_same_views(&from_sphere.scene, &loaded.scene, 0.0);
    fs::remove_file(&plain).unwrap();
    assert_same_views(&load(&dir).unwrap().scene, &loaded.scene, 0.0);
    fs::remove_file(&sphere).unwrap();

    arrays.insert("scale_mat_2", matrix4(Matrix4::identity()));
    write_npz(&dir.path().join("cameras.npz"), &arrays).unwrap();
    assert!(message(&dir).contains("`scale_mat_2` differs"));
}

#[test]
fn the_json_layout_finds_converted_images() {
    let expected = scene();
    let dir = scene_dir();
    fs::remove_file(dir.path().join("cameras.npz")).unwrap();
    let rows = |m: &Matrix4<f64>| -> Vec<Vec<f64>> {
        m.row_iter()
            .map(|row| row.iter().copied().collect())
            .collect()
    };
    // In descending order, to be sorted by the reader; with an ending that is gone.
    let frames: Vec<_> = expected
        .views
        .iter()
        .rev()
        .map(|view| {
            let k = view.camera.intrinsics.matrix();
            let k: Vec<Vec<f64>> = k
                .row_iter()
                .map(|row| row.iter().copied().collect())
                .collect();
            serde_json::json!({
                "file": format!("images/{}.jpg", view.name), "width": WIDTH, "height": HEIGHT,
                "K": k, "c2w": rows(&view.camera.matrix_world_from_camera()),
            })
        })
        .collect();
    let mut json = serde_json::json!({
        "frames": frames, "scale_mat": rows(&expected.original_from_world.matrix()),
    });
    let write = |json: &serde_json::Value| {
        fs::write(dir.path().join("cameras.json"), json.to_string()).unwrap();
    };
    write(&json);
    let loaded = load(&dir).unwrap();
    assert_eq!(loaded.layout, Layout::CamerasJson);
    assert_same_views(&loaded.scene, &expected, 0.0);

    json["frames"][0]["width"] = 13.into();
    write(&json);
    let message = message(&dir);
    assert!(message.contains("view_2") && message.contains("13×8") && message.contains("12×8"));
}

#[test]
fn pixel_centers_follow_the_option_and_shift_the_wireframes() {
    let dir = scene_dir();
    let options = LoadOptions {
        pixel_center: PixelCenter::Integer,
        ..LoadOptions::default()
    };
    let integer = load_scene(dir.path(), &options).unwrap().scene;
    assert_eq!(integer.pixel_center, 0.0);
    let shift = scene().views[0].wireframe.vertices[0] - integer.views[0].wireframe.vertices[0];
    assert_eq!(shift, Vector2::new(0.5, 0.5));
}

#[test]
fn an_undecided_pixel_center_is_the_published_one_with_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let mut scene = scene();
    scene.views[1].camera.intrinsics.cx = 6.3;
    abc::write_scene(&scene, dir.path()).unwrap();
    let poses = scene.views.iter().flat_map(|view| {
        view.camera
            .matrix_world_from_camera()
            .transpose()
            .as_slice()
            .to_vec()
    });
    let intrinsics = scene.views.iter().flat_map(|view| {
        view.camera
            .intrinsics
            .matrix()
            .transpose()
            .as_slice()
            .to_vec()
    });
    let arrays = BTreeMap::from([
        (
            "extrinsics",
            NpyArray {
                shape: vec![3, 4, 4],
                values: poses.collect(),
            },
        ),
        (
            "intrinsics",
            NpyArray {
                shape: vec![3, 3, 3],
                values: intrinsics.collect(),
            },
        ),
    ]);
    write_npz(&dir.path().join("cameras.npz"), &arrays).unwrap();
    let options = LoadOptions {
        sphere: SphereChoice::File,
        ..LoadOptions::default()
    };
    let loaded = load_scene(dir.path(), &options).unwrap();
    assert_eq!(loaded.scene.pixel_center, 0.0);
    assert_eq!(
        loaded.warnings,
        [SceneWarning::PixelCenterAssumed { pixel_center: 0.0 }]
    );
}

#[test]
fn views_without_segments_are_dropped_until_none_is_left() {
    let dir = scene_dir();
    edit_hawp(&dir, "view_1", "0.9", "0.05");
    let loaded = load(&dir).unwrap();
    let names: Vec<_> = loaded
        .scene
        .views
        .iter()
        .map(|view| view.name.as_str())
        .collect();
    assert_eq!(names, ["view_0", "view_2"]);
    assert_eq!(loaded.warnings.len(), 1);
    assert!(loaded.warnings[0].to_string().contains("view_1"));

    edit_hawp(&dir, "view_0", "0.9", "0.01");
    edit_hawp(&dir, "view_2", "0.9", "0.01");
    assert!(message(&dir).contains("none of the 3 views"));
}

#[test]
fn wireframes_are_required_unless_told_otherwise() {
    let dir = scene_dir();
    fs::remove_file(dir.path().join("hawp/view_1.json")).unwrap();
    assert!(message(&dir).contains("view_1.json") && message(&dir).contains("detect"));
    fs::remove_dir_all(dir.path().join("hawp")).unwrap();
    assert!(message(&dir).contains("hawp") && message(&dir).contains("detect"));
    let options = LoadOptions {
        require_wireframes: false,
        ..LoadOptions::default()
    };
    let loaded = load_scene(dir.path(), &options).unwrap();
    assert_eq!(loaded.scene.views.len(), 3);
    assert_eq!(
        loaded.scene.views[0].wireframe,
        Wireframe2d::empty(WIDTH, HEIGHT)
    );
}

#[test]
fn folders_that_are_no_scene_are_told_what_is_missing() {
    let dir = tempfile::tempdir().unwrap();
    let nowhere = load_scene(dir.path().join("nowhere"), &LoadOptions::default()).unwrap_err();
    assert!(matches!(nowhere, SceneError::Missing { .. }));
    assert!(matches!(load(&dir), Err(SceneError::UnknownLayout { .. })));

    fs::write(dir.path().join("cameras.json"), "{\"frames\": []}").unwrap();
    assert!(matches!(load(&dir), Err(SceneError::NoView { .. })));
    fs::write(dir.path().join("cameras.json"), "{\"frames\": [").unwrap();
    assert!(matches!(load(&dir), Err(SceneError::Json { .. })));
    fs::write(dir.path().join("cameras.npz"), "").unwrap();
    assert!(matches!(load(&dir), Err(SceneError::Empty { .. })));

    let dir = scene_dir();
    fs::remove_dir_all(dir.path().join("images")).unwrap();
    assert!(message(&dir).contains("images"));
}

#[test]
fn images_and_poses_must_match() {
    let dir = scene_dir();
    fs::remove_file(dir.path().join("images/view_2.png")).unwrap();
    assert!(message(&dir).contains("3 poses") && message(&dir).contains("2 images"));

    let dir = scene_dir();
    fs::write(dir.path().join("images/view_1.png"), b"\x89PNG\r\n").unwrap();
    assert!(message(&dir).contains("view_1.png"));

    let dir = scene_dir();
    RgbImage::new(5, 5)
        .save(dir.path().join("images/view_0.png"))
        .unwrap();
    let message = message(&dir);
    assert!(
        message.contains("view_0") && message.contains("5×5"),
        "{message}"
    );

    let dir = scene_dir();
    let images = dir.path().join("images");
    fs::rename(images.join("view_1.png"), images.join("view_0.jpg")).unwrap();
    assert!(matches!(load(&dir), Err(SceneError::ViewName { .. })));
}

#[test]
fn bad_poses_are_named_with_file_and_view() {
    let good: Vec<f64> = scene()
        .views
        .iter()
        .flat_map(|view| {
            view.camera
                .matrix_world_from_camera()
                .transpose()
                .as_slice()
                .to_vec()
        })
        .collect();
    let dir = scene_dir();
    let with = |change: &dyn Fn(&mut [f64])| {
        let mut poses = good.clone();
        change(&mut poses[16..32]);
        write_poses(dir.path(), vec![3, 4, 4], poses);
        load(&dir).map_err(|error| error.to_string())
    };
    with(&|_| {}).unwrap();

    let singular = with(&|pose| pose[..12].fill(0.0)).unwrap_err();
    assert!(
        singular.contains("singular") && singular.contains("view_1"),
        "{singular}"
    );
    let mirrored = with(&|pose| [0, 4, 8].iter().for_each(|&i| pose[i] = -pose[i])).unwrap_err();
    assert!(
        mirrored.contains("mirrored") && mirrored.contains("view_1"),
        "{mirrored}"
    );
    let scaled = with(&|pose| pose.iter_mut().for_each(|x| *x *= 1.1)).unwrap_err();
    assert!(scaled.contains("not a rigid"), "{scaled}");
    let nan = with(&|pose| pose[3] = f64::NAN).unwrap_err();
    assert!(nan.contains("extrinsics") && nan.contains("NaN"), "{nan}");

    write_poses(dir.path(), vec![4, 3, 4], good.clone());
    assert!(matches!(load(&dir), Err(SceneError::WrongShape { .. })));
    write_poses(dir.path(), vec![48], good);
    assert!(matches!(load(&dir), Err(SceneError::WrongShape { .. })));
}

#[test]
fn scenes_that_could_not_be_read_back_are_not_written() {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("scene");
    let mut unsorted = scene();
    unsorted.views.swap(0, 1);
    let mut escaping = scene();
    escaping.views[0].name = "../view".into();
    let mut empty = scene();
    empty.views.clear();
    for bad in [unsorted, escaping, empty] {
        assert!(abc::write_scene(&bad, &target).is_err());
        assert!(!target.exists());
    }
    fs::write(&target, "a file, not a folder").unwrap();
    assert!(matches!(
        abc::write_scene(&scene(), &target),
        Err(SceneError::Write { .. })
    ));
}

/// Rewrites the arrays of `cameras.npz`, pose by pose and K by K.
fn rewrite_cameras(dir: &TempDir, f: impl Fn(&mut Matrix4<f64>, &mut Matrix4<f64>)) {
    let scene = load(dir).unwrap().scene;
    let (mut poses, mut intrinsics) = (Vec::new(), Vec::new());
    for view in &scene.views {
        let mut pose = view.camera.matrix_world_from_camera();
        let mut k = view.camera.intrinsics.matrix().to_homogeneous();
        f(&mut pose, &mut k);
        // Row by row: nalgebra stores columns.
        poses.extend_from_slice(pose.transpose().as_slice());
        intrinsics.extend_from_slice(k.transpose().as_slice());
    }
    let stack = |values| NpyArray {
        shape: vec![scene.views.len(), 4, 4],
        values,
    };
    let arrays = BTreeMap::from([
        ("extrinsics", stack(poses)),
        ("intrinsics", stack(intrinsics)),
    ]);
    write_npz(&dir.path().join("cameras.npz"), &arrays).unwrap();
}

#[test]
fn poses_of_another_convention_are_read_by_saying_so() {
    let dir = scene_dir();
    let expected = load(&dir).unwrap().scene;
    let flip = Matrix4::from_diagonal(&nalgebra::Vector4::new(1.0, -1.0, -1.0, 1.0));
    // What an OpenGL program calls its view matrix, for images twice as large.
    rewrite_cameras(&dir, |pose, k| {
        *pose = (*pose * flip).try_inverse().unwrap();
        for row in 0..2 {
            for column in 0..3 {
                k[(row, column)] *= 2.0;
            }
        }
        k[(0, 0)] *= 1.5;
        k[(1, 1)] *= 1.5;
        k[(0, 1)] *= 1.5;
    });
    let options = LoadOptions {
        pose_convention: Some(PoseConvention {
            direction: PoseDirection::WorldToCamera,
            axes: CameraAxes::OPENGL,
            mirrored_world: false,
        }),
        focal_scale: Some(1.0 / 1.5),
        intrinsics_scale: Some(0.5),
        ..LoadOptions::default()
    };
    let loaded = load_scene(dir.path(), &options).unwrap().scene;
    for (view, expected) in loaded.views.iter().zip(&expected.views) {
        let pose = view.camera.matrix_world_from_camera();
        assert!((pose - expected.camera.matrix_world_from_camera()).amax() < 1e-12);
        let k = view.camera.intrinsics.matrix() - expected.camera.intrinsics.matrix();
        assert!(k.amax() < 1e-12, "{k}");
    }
}

#[test]
fn a_mirrored_world_is_refused_and_read_by_saying_so() {
    let dir = scene_dir();
    let expected = load(&dir).unwrap().scene;
    rewrite_cameras(&dir, |pose, _| {
        let turned = -pose.row(2);
        pose.set_row(2, &turned);
    });
    assert!(message(&dir).contains("mirrored"));
    let options = LoadOptions {
        pose_convention: Some(PoseConvention {
            mirrored_world: true,
            ..PoseConvention::default()
        }),
        ..LoadOptions::default()
    };
    let loaded = load_scene(dir.path(), &options).unwrap().scene;
    for (view, in_right_world) in loaded.views.iter().zip(&expected.views) {
        let point = Vector3::new(0.3, -0.2, 0.1);
        let seen = in_right_world.camera.project(&point).pixel;
        let in_files = Vector3::new(point.x, point.y, -point.z);
        // Both where neat works and where its results are.
        let in_world = loaded.original_from_world.inverse().apply(&in_files);
        assert!((view.camera.project(&in_world).pixel - seen).amax() < 1e-9);
        let camera = loaded.original_from_world.apply_to_camera(&view.camera);
        assert!((camera.project(&in_files).pixel - seen).amax() < 1e-9);
    }
}

#[test]
fn at_most_so_many_views_spread_over_the_files() {
    let dir = tempfile::tempdir().unwrap();
    let mut many = scene();
    many.views = (0..7).map(view).collect();
    abc::write_scene(&many, dir.path()).unwrap();
    let names = |max_views| {
        let options = LoadOptions {
            max_views: Some(max_views),
            ..LoadOptions::default()
        };
        let scene = load_scene(dir.path(), &options).unwrap().scene;
        let names = scene.views.into_iter().map(|view| view.name);
        names.collect::<Vec<_>>()
    };
    assert_eq!(names(3), ["view_2", "view_4", "view_6"]);
    assert_eq!(names(7).len(), 7);
    assert_eq!(names(100).len(), 7);
    for max_views in 2..7 {
        assert_eq!(names(max_views).len(), max_views);
    }
}
