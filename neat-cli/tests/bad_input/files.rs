//! Files that are missing, empty, cut off, or something else.

use crate::case::{Case, TRAIN, check};
use crate::support::truncate;
use std::fs;

#[test]
fn files_of_scenes() {
    check(
        "files",
        &[
            Case {
                kind: "no such folder",
                spoil: |scene| fs::remove_dir_all(scene.file("scene")).unwrap(),
                command: TRAIN,
                names: &["scene does not exist", "give the folder of a scene"],
            },
            Case {
                kind: "a file in place of the folder",
                spoil: |scene| {
                    fs::remove_dir_all(scene.file("scene")).unwrap();
                    fs::write(scene.file("scene"), "?").unwrap();
                },
                command: TRAIN,
                names: &[
                    "scene is a file, not a folder",
                    "give the folder of a scene",
                ],
            },
            Case {
                kind: "no file of poses",
                spoil: |scene| fs::remove_file(scene.file("scene/cameras.npz")).unwrap(),
                command: TRAIN,
                names: &["is not a scene", "cameras.npz", "cameras.json"],
            },
            Case {
                kind: "an empty file of poses",
                spoil: |scene| fs::write(scene.file("scene/cameras.npz"), "").unwrap(),
                command: TRAIN,
                names: &["cameras.npz is empty", "download it again"],
            },
            Case {
                kind: "a file of poses that ends early",
                spoil: |scene| truncate(&scene.file("scene/cameras.npz")),
                command: TRAIN,
                names: &["cameras.npz"],
            },
            Case {
                kind: "an image too few",
                spoil: |scene| fs::remove_file(scene.file("scene/images/image_0002.png")).unwrap(),
                command: TRAIN,
                names: &["cameras.npz holds 4 poses", "3 images"],
            },
            Case {
                kind: "an empty image",
                spoil: |scene| fs::write(scene.file("scene/images/image_0001.png"), "").unwrap(),
                command: TRAIN,
                names: &["image_0001.png"],
            },
            Case {
                kind: "an image that ends early",
                spoil: |scene| truncate(&scene.file("scene/images/image_0001.png")),
                command: TRAIN,
                names: &["image_0001.png", "replace it by a valid PNG or JPEG"],
            },
            Case {
                kind: "an image that is none",
                spoil: |scene| {
                    let page = "<html>404 Not Found</html>";
                    fs::write(scene.file("scene/images/image_0001.png"), page).unwrap();
                },
                command: TRAIN,
                names: &["image_0001.png", "replace it by a valid PNG or JPEG"],
            },
            Case {
                kind: "a 2D wireframe too few",
                spoil: |scene| fs::remove_file(scene.file("scene/hawp/image_0001.json")).unwrap(),
                command: TRAIN,
                names: &["image_0001.json does not exist", "`neat detect`"],
            },
            Case {
                kind: "an empty 2D wireframe file",
                spoil: |scene| fs::write(scene.file("scene/hawp/image_0001.json"), "").unwrap(),
                command: TRAIN,
                names: &["image_0001.json is empty"],
            },
            Case {
                kind: "a 2D wireframe that ends early",
                spoil: |scene| truncate(&scene.file("scene/hawp/image_0001.json")),
                command: TRAIN,
                names: &["image_0001.json", "may be truncated"],
            },
        ],
    );
}
