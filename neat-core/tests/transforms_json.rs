//! Scenes with `transforms.json`, as Blender, instant-ngp and nerfstudio write
//! them, and the errors of bad ones.

use image::RgbImage;
use nalgebra::{Matrix4, Vector2, Vector3};
use neat_core::layout::{Layout, PoseConvention, PoseDirection, SceneWarning};
use neat_core::{Camera, LoadOptions, LoadedScene, SceneError, Similarity, load_scene};
use serde_json::{Value, json};
use std::fs;
use tempfile::TempDir;

const WIDTH: u32 = 12;
const HEIGHT: u32 = 8;

/// A scene of two images in `train/`, without wireframes and poses.
fn images_dir() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("train")).unwrap();
    for name in ["r_0", "r_1"] {
        let path = dir.path().join(format!("train/{name}.png"));
        RgbImage::new(WIDTH, HEIGHT).save(path).unwrap();
    }
    dir
}

/// Two cameras in OpenGL axes: at z = 4 looking along −z with y up, and at x = 5
/// looking along −x with z up.
fn frames() -> Value {
    json!([
        {"file_path": "./train/r_1", "rotation": 0.1, "transform_matrix":
            [[0.0, 0.0, 1.0, 5.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]},
        {"file_path": "./train/r_0", "rotation": 0.1, "transform_matrix":
            [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 4.0], [0.0, 0.0, 0.0, 1.0]]},
    ])
}

/// As Blender's scenes say it: a focal length of 10 pixels.
fn blender() -> Value {
    json!({"camera_angle_x": 2.0 * 0.6_f64.atan(), "frames": frames()})
}

fn load_file(name: &str, json: &Value) -> Result<LoadedScene, SceneError> {
    let dir = images_dir();
    fs::write(dir.path().join(name), json.to_string()).unwrap();
    let options = LoadOptions {
        require_wireframes: false,
        ..LoadOptions::default()
    };
    load_scene(dir.path(), &options)
}

fn load(json: &Value) -> Result<LoadedScene, SceneError> {
    load_file("transforms.json", json)
}

/// The cameras of `r_0` and `r_1`.
fn cameras(json: &Value) -> [Camera; 2] {
    let views = load(json).unwrap().scene.views;
    [views[0].camera, views[1].camera]
}

/// The error after `change`, which must name the file, and the frame if given.
fn error(change: impl Fn(&mut Value), frame: &str) -> String {
    let mut json = blender();
    change(&mut json);
    let message = load(&json).unwrap_err().to_string();
    assert!(message.contains("transforms.json"), "{message}");
    assert!(message.contains(frame), "{message}");
    message
}

fn assert_near(found: Vector2<f64>, x: f64, y: f64) {
    assert!((found - Vector2::new(x, y)).amax() < 1e-12, "{found}");
}

#[test]
fn points_are_seen_where_a_hand_puts_them() {
    let loaded = load_file("transforms_train.json", &blender()).unwrap();
    assert_eq!(loaded.layout, Layout::TransformsJson);
    assert_eq!(loaded.warnings, []);
    // The middle of the image is W/2: its corner is the origin.
    assert_eq!(loaded.scene.pixel_center, 0.5);
    assert_eq!(loaded.scene.original_from_world, Similarity::identity());
    loaded.scene.validate().unwrap();
    let [a, b] = [&loaded.scene.views[0], &loaded.scene.views[1]];
    assert_eq!((a.name.as_str(), b.name.as_str()), ("r_0", "r_1"));

    // 1 right, 0.5 up, 4 ahead: 10 · 1/4 right of the middle, 10 · 0.5/4 above.
    let seen = a.camera.project(&Vector3::new(1.0, 0.5, 0.0));
    assert_near(seen.pixel, 8.5, 2.75);
    assert_eq!(seen.depth, 4.0);
    // Right is +y here and up is +z: 2 right, 1 up, 5 ahead.
    let seen = b.camera.project(&Vector3::new(0.0, 2.0, 1.0));
    assert_near(seen.pixel, 10.0, 2.0);
    assert_eq!(seen.depth, 5.0);
}

/// By one flag, and in the world of the file.
#[test]
fn matrices_of_the_other_direction_are_read_by_saying_so() {
    let mut json = blender();
    for frame in json["frames"].as_array_mut().unwrap() {
        let rows: Vec<[f64; 4]> = serde_json::from_value(frame["transform_matrix"].take()).unwrap();
        let inverse = Matrix4::from_row_iterator(rows.concat())
            .try_inverse()
            .unwrap();
        let row = |row: usize| [0, 1, 2, 3].map(|column| inverse[(row, column)]);
        frame["transform_matrix"] = json!([0, 1, 2, 3].map(row));
    }
    let dir = images_dir();
    fs::write(dir.path().join("transforms.json"), json.to_string()).unwrap();
    let options = LoadOptions {
        require_wireframes: false,
        pose_convention: Some(PoseConvention {
            direction: PoseDirection::WorldToCamera,
            ..PoseConvention::default()
        }),
        ..LoadOptions::default()
    };
    let found = load_scene(dir.path(), &options).unwrap().scene;
    let expected = load(&blender()).unwrap().scene;
    assert_eq!(found.original_from_world, expected.original_from_world);
    for (found, expected) in found.views.iter().zip(&expected.views) {
        let [found, expected] = [found, expected].map(|v| v.camera.matrix_world_from_camera());
        assert!((found - expected).amax() < 1e-12, "{found}");
    }
}

#[test]
fn both_styles_of_intrinsics_are_read_and_frames_win() {
    let mut json = json!({
        "camera_model": "OPENCV", "fl_x": 10.0, "fl_y": 11.0, "cx": 6.25, "cy": 3.5,
        "w": 12.0, "h": 8, "k1": 0.0, "k2": 0, "p1": 0.0, "p2": null, "camera_angle_x": 0.1,
        "applied_transform": [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]],
        "applied_scale": 0.5, "ply_file_path": "points.ply", "frames": frames(),
    });
    json["frames"][0]["fl_x"] = 20.0.into();
    json["frames"][0]["cy"] = 4.5.into();
    let loaded = load(&json).unwrap();
    // A calibrated principal point does not tell where pixel centres are.
    assert_eq!(
        loaded.warnings,
        [SceneWarning::PixelCenterAssumed { pixel_center: 0.0 }]
    );
    let k = |camera: &Camera| {
        let k = camera.intrinsics;
        [k.fx, k.fy, k.cx, k.cy, k.skew]
    };
    let [a, b] = cameras(&json);
    assert_eq!(k(&a), [10.0, 11.0, 6.25, 3.5, 0.0]);
    assert_eq!(k(&b), [20.0, 11.0, 6.25, 4.5, 0.0]);
    // `applied_transform` is in the poses already.
    assert_eq!(a.center_in_world, Vector3::new(0.0, 0.0, 4.0));

    // The file may tell it.
    json["pixel_center"] = 0.5.into();
    let loaded = load(&json).unwrap();
    assert_eq!((loaded.scene.pixel_center, loaded.warnings.len()), (0.5, 0));
    json["pixel_center"] = 0.25.into();
    let message = load(&json).unwrap_err().to_string();
    assert!(message.contains("`pixel_center` is 0.25"), "{message}");

    // One side of the size is completed by the image; both angles count.
    let mut json = blender();
    json["camera_angle_y"] = (2.0 * 0.5_f64.atan()).into();
    json["h"] = 8.into();
    json["frames"][1]["camera_angle_x"] = (2.0 * 0.3_f64.atan()).into();
    let [a, b] = cameras(&json);
    assert!((a.intrinsics.fx - 20.0).abs() < 1e-12 && (b.intrinsics.fx - 10.0).abs() < 1e-12);
    assert!((a.intrinsics.fy - 8.0).abs() < 1e-12 && (b.intrinsics.fy - 8.0).abs() < 1e-12);

    // Without a size in the file or a need for it, it is that of the image.
    let json = json!({"fl_x": 10, "cx": 5.5, "cy": 3.5, "frames": frames()});
    let loaded = load(&json).unwrap();
    assert_eq!(loaded.scene.pixel_center, 0.0, "told by (W − 1)/2");
    assert_eq!(loaded.warnings, []);
}

#[test]
fn the_layout_is_looked_for_last() {
    let dir = images_dir();
    for (file, layout) in [
        ("transforms_train.json", Layout::TransformsJson),
        ("transforms.json", Layout::TransformsJson),
        ("cameras.json", Layout::CamerasJson),
    ] {
        fs::write(dir.path().join(file), "{}").unwrap();
        assert_eq!(Layout::detect(dir.path()).unwrap(), layout);
    }
    // Of the two names, `transforms.json` is read.
    fs::remove_file(dir.path().join("cameras.json")).unwrap();
    let error = load_scene(dir.path(), &LoadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("transforms.json"), "{error}");
    let options = LoadOptions {
        layout: Some(Layout::TransformsJson),
        ..LoadOptions::default()
    };
    let error = load_scene(dir.path().join("train"), &options).unwrap_err();
    assert!(matches!(error, SceneError::Missing { .. }));
}

#[test]
fn images_are_found_by_other_endings_but_not_outside() {
    let mut json = blender();
    json["frames"][0]["file_path"] = "train/r_1.jpg".into();
    json["frames"][1]["file_path"] = "train/r_0.png".into();
    load(&json).unwrap();

    let named =
        |path: &'static str| move |json: &mut Value| json["frames"][1]["file_path"] = path.into();
    for path in ["../r_0", "train/../../r_0.png", "/train/r_0.png"] {
        assert!(error(named(path), path).contains("outside the scene"));
    }
    for path in ["", "./"] {
        assert!(error(named(path), "frame").contains("names no image"));
    }
    assert!(error(named("./train/r_1.png"), "r_1").contains("appears twice"));
    json["frames"][1]["file_path"] = "./train/r_7".into();
    let error = load(&json).unwrap_err();
    assert!(matches!(error, SceneError::Missing { .. }));
    assert!(error.to_string().contains("r_7.png"), "{error}");
}

#[test]
fn lenses_that_are_not_read_are_errors() {
    for (key, value) in [
        ("k4", json!(0.1)),
        ("camera_model", json!("EQUIRECTANGULAR")),
        ("distortion_params", json!([0, 0, 0, 0.25, 0, 0])),
    ] {
        let for_all = error(|json| json[key] = value.clone(), "r_1");
        assert!(for_all.contains("undistort"), "{for_all}");
        let for_one = error(|json| json["frames"][1][key] = value.clone(), "r_0");
        assert!(for_one.contains("undistort"), "{for_one}");
    }
    // A frame of its own may be without.
    let mut json = blender();
    json["k4"] = 0.1.into();
    for index in 0..2 {
        json["frames"][index]["k4"] = 0.into();
    }
    load(&json).unwrap();
}

#[test]
fn bad_poses_are_named_with_file_and_frame() {
    let pose = |json: &mut Value| json["frames"][1]["transform_matrix"].take();
    let with = |change: &dyn Fn(&mut Value)| {
        let changed = |json: &mut Value| {
            let mut matrix = pose(json);
            change(&mut matrix);
            json["frames"][1]["transform_matrix"] = matrix;
        };
        error(changed, "r_0")
    };
    let mirrored = with(&|pose| pose[0][0] = (-1.0).into());
    assert!(mirrored.contains("mirrored") && mirrored.contains("OpenGL"));
    assert!(with(&|pose| pose[0][0] = 0.0.into()).contains("singular"));
    assert!(with(&|pose| pose[0][0] = 1.1.into()).contains("not a rigid"));
    assert!(with(&|pose| pose[3][3] = 2.0.into()).contains("not a rigid"));
    assert!(with(&|pose| pose[0][0] = Value::Null).contains("not finite"));
    assert!(with(&|pose| pose[1][3] = Value::Null).contains("not finite"));
    let three_rows = |pose: &mut Value| drop(pose.as_array_mut().unwrap().pop());
    assert!(with(&three_rows).contains("expected 4×4"));
    assert!(with(&|pose| pose[2] = json!([0, 0, 1])).contains("expected 4×4"));
    assert!(with(&|pose| *pose = json!([])).contains("expected 4×4"));
}

#[test]
fn bad_intrinsics_are_named_with_file_and_frame() {
    let set = |key: &'static str, value: Value| {
        move |json: &mut Value| json["frames"][1][key] = value.clone()
    };
    let missing = error(|json| json["camera_angle_x"] = Value::Null, "r_1");
    assert!(missing.contains("no focal length") && missing.contains("fl_x"));
    assert!(error(set("fl_x", json!(-1)), "r_0").contains("not both positive"));
    for angle in [0.0, -0.5, 3.2, 1e300] {
        let message = error(set("camera_angle_x", json!(angle)), "r_0");
        assert!(message.contains("between 0 and π"), "{message}");
    }
    for width in [0.0, 12.5, -12.0, 1e12] {
        let message = error(set("w", json!(width)), "r_0");
        assert!(message.contains("number of pixels"), "{message}");
    }
    let wide = error(set("w", json!(13)), "r_0");
    assert!(wide.contains("13×8") && wide.contains("12×8"), "{wide}");
}

#[test]
fn files_that_are_no_list_of_frames_are_named() {
    let none = load(&json!({"camera_angle_x": 0.5, "frames": []})).unwrap_err();
    assert!(matches!(none, SceneError::NoView { .. }));
    assert!(none.to_string().contains("transforms.json"));
    for json in [
        json!({}),
        json!([]),
        json!({"frames": [{}]}),
        json!({"frames": 1}),
    ] {
        let error = load(&json).unwrap_err();
        assert!(matches!(error, SceneError::Json { .. }), "{error}");
        assert!(error.to_string().contains("transforms.json"));
    }
}
