//! Images and 2D wireframes that disagree, and scenes with nothing to see.

use crate::cameras::change_cameras;
use crate::case::{Case, TRAIN, check};
use crate::support::{TestScene, stderr};
use serde_json::{Value, json};
use std::fs;

/// Rewrites the 2D wireframe of a view.
fn change_wireframe(scene: &TestScene, view: usize, change: impl FnOnce(&mut Value)) {
    let path = scene.file(&format!("scene/hawp/image_000{view}.json"));
    let mut json: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut json);
    fs::write(path, json.to_string()).unwrap();
}

/// Leaves no segment in a 2D wireframe.
fn remove_segments(scene: &TestScene, view: usize) {
    change_wireframe(scene, view, |json| {
        json["edges"] = json!([]);
        json["edges-weights"] = json!([]);
    });
}

#[test]
fn views() {
    check(
        "views",
        &[
            Case {
                kind: "an image of another size than those that share its intrinsics",
                spoil: |scene| {
                    let path = scene.file("scene/images/image_0001.png");
                    image::RgbImage::new(4800, 4800).save(path).unwrap();
                },
                command: "train scene --out run --max-image-size 48",
                names: &["view `image_0001`", "48×48", "4800×4800", "camera"],
            },
            Case {
                kind: "images of another size than their 2D wireframes",
                spoil: |scene| {
                    for view in 0..4 {
                        let path = scene.file(&format!("scene/images/image_000{view}.png"));
                        image::RgbImage::new(40, 48).save(path).unwrap();
                    }
                },
                command: TRAIN,
                names: &["view `image_0000`", "48×48", "40×48", "wireframe"],
            },
            Case {
                kind: "fewer scores than 2D segments",
                spoil: |scene| {
                    change_wireframe(scene, 1, |json| json["edges-weights"] = json!([0.5]));
                },
                command: TRAIN,
                names: &["image_0001", "edges"],
            },
            Case {
                kind: "a 2D segment to a junction that is not there",
                spoil: |scene| {
                    change_wireframe(scene, 1, |json| json["edges"][0] = json!([0, 4096]));
                },
                command: TRAIN,
                names: &["image_0001", "edge 0", "4096"],
            },
            Case {
                kind: "a 2D junction far outside of the image",
                spoil: |scene| {
                    change_wireframe(scene, 1, |json| json["vertices"][0] = json!([1e30, 1]));
                },
                command: TRAIN,
                names: &["image_0001", "vertex number 0", "1e30"],
            },
            Case {
                kind: "a score that is no confidence",
                spoil: |scene| {
                    change_wireframe(scene, 1, |json| json["edges-weights"][2] = json!(1e308));
                },
                command: TRAIN,
                names: &["image_0001", "edge number 2", "1e308", "from 0 to 1"],
            },
            Case {
                kind: "a 2D junction that is no number",
                spoil: |scene| {
                    change_wireframe(scene, 1, |json| json["vertices"][0] = json!(["x", 1]));
                },
                command: TRAIN,
                names: &["image_0001.json"],
            },
            Case {
                kind: "no view",
                spoil: |scene| {
                    let images = scene.file("scene/images");
                    fs::remove_dir_all(&images).unwrap();
                    fs::create_dir(&images).unwrap();
                    change_cameras(scene, |intrinsics, extrinsics| {
                        for array in [intrinsics, extrinsics] {
                            array.shape[0] = 0;
                            array.values.clear();
                        }
                    });
                },
                command: TRAIN,
                names: &["holds no view", "images and their poses"],
            },
            Case {
                kind: "no 2D segment in any view",
                spoil: |scene| (0..4).for_each(|view| remove_segments(scene, view)),
                command: TRAIN,
                names: &["none of the 4 views", "0.05", "detect 2D wireframes"],
            },
        ],
    );
}

#[test]
fn a_view_without_segments_is_skipped_with_a_warning() {
    let scene = TestScene::without_edges();
    remove_segments(&scene, 1);
    let assert = scene.run("train", "1").arg("--quiet").assert().success();
    let message = stderr(&assert);
    assert!(
        message.starts_with("warning: view `image_0001`"),
        "{message}"
    );
    let manifest = fs::read_to_string(scene.file("run/manifest.json")).unwrap();
    assert!(manifest.contains("view `image_0001`"), "{manifest}");
}
