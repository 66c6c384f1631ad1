//! `--memory-limit`: the same results with images in a temporary file, and clear words
//! where it is too little.

mod support;

use std::fs;
use std::path::{Path, PathBuf};
use support::{TestScene, neat, stderr};

/// Eight views of 512 × 512 pixels: six megabytes.
fn scene() -> TestScene {
    let scene = TestScene::with(&["--solid", "box", "--views", "8", "--image-size", "512"]);
    // Segments are detected, which looks at whole images.
    fs::remove_dir_all(scene.file("scene/hawp")).unwrap();
    scene
}

fn only_checkpoint(run: &Path) -> PathBuf {
    let files = fs::read_dir(run.join("checkpoints")).unwrap();
    let mut files: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    files.sort();
    assert_eq!(files.len(), 1, "{files:?}");
    files.remove(0)
}

#[test]
fn results_do_not_depend_on_it() {
    let scene = scene();
    let reconstruct = |out: &str, more: &[&str]| {
        let mut command = neat(&["reconstruct", &scene.path("scene")]);
        command.args(["--out", &scene.path(out), "--no-cache", "--train"]);
        command.args(["--backend", "flex", "--steps", "4"]);
        let assert = command.args(more).assert().success();
        (scene.file(out), stderr(&assert))
    };
    let (plenty, said) = reconstruct("plenty", &["--memory-limit", "4GiB"]);
    assert!(!said.contains("temporary file"), "{said}");
    // A quarter of it is less than the images take; work on a single one fits.
    let (little, said) = reconstruct("little", &["--memory-limit", "20MB"]);
    assert!(said.contains("8 images"), "{said}");
    assert!(said.contains("temporary file"), "{said}");

    let same = |a: &Path, b: &Path| {
        let [a, b] = [a, b].map(|path| fs::read(path).unwrap());
        assert!(a == b, "{} bytes and {} bytes", a.len(), b.len());
    };
    same(&only_checkpoint(&plenty), &only_checkpoint(&little));
    for file in [
        "wireframe.json",
        "wireframe.png",
        "config.toml",
        "plan.toml",
    ] {
        same(&plenty.join(file), &little.join(file));
    }
    for folder in ["detections", "overlays"] {
        let files = fs::read_dir(plenty.join(folder)).unwrap();
        let names: Vec<_> = files.map(|file| file.unwrap().file_name()).collect();
        assert!(!names.is_empty(), "{folder}");
        for name in names {
            same(
                &plenty.join(folder).join(&name),
                &little.join(folder).join(&name),
            );
        }
    }
}

#[test]
fn too_little_for_one_image_says_how_much_is_needed() {
    let scene = scene();
    let mut command = scene.run("train", "1");
    let assert = command.args(["--memory-limit", "2MB"]).assert().code(2);
    let message = stderr(&assert);
    for part in ["reading an image", "512×512", "--memory-limit", "MiB"] {
        assert!(message.contains(part), "no `{part}` in: {message}");
    }
    assert!(!scene.file("run").exists());

    let images = scene.path("scene/images");
    let mut detect = neat(&["detect", &images, "--out", &scene.path("found")]);
    let assert = detect.args(["--memory-limit", "2MB"]).assert().code(2);
    let message = stderr(&assert);
    assert!(message.contains("detecting segments"), "{message}");
}

#[test]
fn sizes_that_are_none_are_refused() {
    let scene = TestScene::new();
    for size in ["8apples", "0", "-1GiB", "12"] {
        let mut command = scene.run("train", "1");
        let assert = command
            .arg(format!("--memory-limit={size}"))
            .assert()
            .code(2);
        let message = stderr(&assert);
        assert!(message.contains("a size such as 8GiB"), "{message}");
    }
}
