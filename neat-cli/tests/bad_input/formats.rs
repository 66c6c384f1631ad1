//! The files of other programs, damaged.

use crate::case::{Case, TRAIN, check};
use crate::support::{TestScene, neat};
use serde_json::{Value, json};
use std::fs;

/// Puts the scene into another format.
fn convert(scene: &TestScene, format: &str) {
    let converted = scene.path("converted");
    neat(&["convert", &scene.path("scene"), "--to", format])
        .args(["--out", &converted])
        .assert()
        .success();
    fs::remove_dir_all(scene.file("scene")).unwrap();
    fs::rename(converted, scene.file("scene")).unwrap();
}

/// The scene as a `transforms.json` that is changed.
fn transforms(scene: &TestScene, change: impl FnOnce(&mut Value)) {
    convert(scene, "transforms-json");
    let path = scene.file("scene/transforms.json");
    let mut json = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut json);
    fs::write(path, json.to_string()).unwrap();
}

/// The scene as a COLMAP model, where `old` in a file becomes `new`.
fn colmap(scene: &TestScene, file: &str, old: &str, new: &str) {
    convert(scene, "colmap");
    let path = scene.file(&format!("scene/sparse/0/{file}"));
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(old), "no `{old}` in:\n{text}");
    fs::write(path, text.replace(old, new)).unwrap();
}

/// Replaces the poses of the scene by a file of another program.
fn poses(scene: &TestScene, file: &str, content: &[u8]) {
    fs::remove_file(scene.file("scene/cameras.npz")).unwrap();
    fs::write(scene.file(&format!("scene/{file}")), content).unwrap();
}

#[test]
fn transforms_json() {
    check(
        "transforms.json",
        &[
            Case {
                kind: "JSON that ends early",
                spoil: |scene| poses(scene, "transforms.json", b"{\"frames\": ["),
                command: TRAIN,
                names: &["transforms.json", "may be truncated", "line 1"],
            },
            Case {
                kind: "no frames",
                spoil: |scene| poses(scene, "transforms.json", b"{\"frames\": []}"),
                command: TRAIN,
                names: &["transforms.json holds no view"],
            },
            Case {
                kind: "an image outside the folder of the scene",
                spoil: |scene| {
                    transforms(scene, |json| {
                        json["frames"][1]["file_path"] = json!("../../secret.png");
                    });
                },
                command: TRAIN,
                names: &["transforms.json", "../../secret.png", "outside the scene"],
            },
            Case {
                kind: "a pose of 3×3 numbers",
                spoil: |scene| {
                    transforms(scene, |json| {
                        json["frames"][1]["transform_matrix"] =
                            json!([[1, 0, 0], [0, 1, 0], [0, 0, 1]]);
                    });
                },
                command: TRAIN,
                names: &["image_0001.png", "transform_matrix", "4×4"],
            },
            Case {
                kind: "a focal length of 0",
                spoil: |scene| transforms(scene, |json| json["frames"][1]["fl_x"] = json!(0)),
                command: TRAIN,
                names: &["view `image_0001`", "focal length"],
            },
            Case {
                kind: "an unknown camera model",
                spoil: |scene| transforms(scene, |json| json["camera_model"] = json!("MIRROR")),
                command: TRAIN,
                names: &["transforms.json", "`MIRROR`", "undistort"],
            },
        ],
    );
}

#[test]
fn colmap_models() {
    check(
        "COLMAP",
        &[
            Case {
                kind: "an unknown camera model",
                spoil: |scene| colmap(scene, "cameras.txt", "PINHOLE", "MIRROR"),
                command: TRAIN,
                names: &["cameras.txt", "camera 1", "MIRROR", "image_undistorter"],
            },
            Case {
                kind: "too few parameters for the camera model",
                spoil: |scene| colmap(scene, "cameras.txt", "PINHOLE", "OPENCV"),
                command: TRAIN,
                names: &["cameras.txt", "line 2", "camera 1", "it ends before PARAMS"],
            },
            Case {
                kind: "an image of a camera that is not there",
                spoil: |scene| colmap(scene, "images.txt", " 1 image_0001", " 7 image_0001"),
                command: TRAIN,
                names: &["images.txt", "view `image_0001`", "camera 7"],
            },
            Case {
                kind: "a binary model that ends early",
                spoil: |scene| {
                    convert(scene, "colmap");
                    let model = scene.file("scene/sparse/0");
                    // Two billion cameras are announced, none follows.
                    for name in ["cameras.bin", "images.bin"] {
                        fs::write(model.join(name), 0x7fff_ffff_u64.to_le_bytes()).unwrap();
                    }
                },
                command: TRAIN,
                names: &["cameras.bin", "it ends"],
            },
        ],
    );
}

#[test]
fn other_formats() {
    check(
        "other formats",
        &[
            Case {
                kind: "`cameras.json` with another content",
                spoil: |scene| poses(scene, "cameras.json", b"{\"cameras\": 3}"),
                command: TRAIN,
                names: &["cameras.json is not a valid list of cameras"],
            },
            Case {
                kind: "`meta_data.json` without frames",
                spoil: |scene| poses(scene, "meta_data.json", b"{}"),
                command: TRAIN,
                names: &["meta_data.json", "`frames`"],
            },
            Case {
                kind: "`sfm_data.json` with another content",
                spoil: |scene| poses(scene, "sfm_data.json", b"{\"views\": 3}"),
                command: TRAIN,
                names: &["sfm_data.json is not a valid OpenMVG scene"],
            },
            Case {
                kind: "`scene.mvs` that ends early",
                spoil: |scene| poses(scene, "scene.mvs", b"MVSI\x01\0\0\0"),
                command: TRAIN,
                names: &["scene.mvs", "it ends"],
            },
            Case {
                kind: "`.nvm` without cameras",
                spoil: |scene| poses(scene, "scene.nvm", b"NVM_V3\n"),
                command: TRAIN,
                names: &["scene.nvm holds no view"],
            },
            Case {
                kind: "`bundle.out` without `list.txt`",
                spoil: |scene| poses(scene, "bundle.out", b"# Bundle file v0.3\n"),
                command: TRAIN,
                names: &["list.txt does not exist"],
            },
            Case {
                kind: "`.camera` that ends early",
                spoil: |scene| poses(scene, "images/image_0000.png.camera", b"70 0 24\n"),
                command: TRAIN,
                names: &["image_0000.png.camera", "K"],
            },
        ],
    );
}
