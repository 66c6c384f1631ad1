//! From images and poses alone: detection, examination, conversion, and the flags
//! that say how a scene is to be read.

mod support;

use neat_core::npz::{NpyArray, NpzReader, write_npz};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use support::{TestScene, neat, stderr, stdout, truncate};

/// A scene with enough views for its poses to be judged, without 2D wireframes.
fn photos() -> TestScene {
    let scene = TestScene::with(&["--solid", "l-prism", "--views", "24", "--image-size", "256"]);
    fs::remove_dir_all(scene.file("scene/hawp")).unwrap();
    scene
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// Changes every pose in `cameras.npz`, 4×4 row by row.
fn change_poses(scene: &TestScene, change: impl Fn(&mut [f64])) {
    let path = scene.file("scene/cameras.npz");
    let mut npz = NpzReader::open(&path, "").unwrap();
    let intrinsics = npz.array("intrinsics").unwrap();
    let mut extrinsics = npz.array("extrinsics").unwrap();
    extrinsics.values.chunks_exact_mut(16).for_each(change);
    let arrays: BTreeMap<&str, NpyArray> =
        BTreeMap::from([("intrinsics", intrinsics), ("extrinsics", extrinsics)]);
    write_npz(&path, &arrays).unwrap();
}

/// As cameras that look along −z, y up.
fn opengl(pose: &mut [f64]) {
    for row in 0..3 {
        for column in 1..3 {
            pose[4 * row + column] *= -1.0;
        }
    }
}

#[test]
fn a_scene_without_wireframes_gets_them_once() {
    let scene = photos();
    let cache = scene.path("cache");
    let assert = scene
        .run("reconstruct", "2")
        .env("NEAT_CACHE", &cache)
        .assert()
        .success();
    assert!(stderr(&assert).contains("detect "), "{}", stderr(&assert));
    let manifest = json(&scene.file("run/manifest.json"));
    for stage in ["load", "detect", "examine", "train"] {
        assert!(
            manifest["seconds"][stage].is_number(),
            "{stage}: {manifest}"
        );
    }
    assert_eq!(manifest["sphere"]["source"], "file");
    assert_eq!(
        fs::read_dir(scene.file("run/detections")).unwrap().count(),
        24
    );
    assert_eq!(fs::read_dir(&cache).unwrap().count(), 24);

    // From the cache, from the folder of the run, and not from the cache: the same.
    let wireframe = fs::read(scene.file("run/wireframe.json")).unwrap();
    let again = |arguments: &[&str]| {
        fs::remove_dir_all(scene.file("run")).unwrap();
        let mut run = scene.run("reconstruct", "2");
        run.env("NEAT_CACHE", &cache).args(arguments);
        run.assert().success();
        assert_eq!(
            fs::read(scene.file("run/wireframe.json")).unwrap(),
            wireframe
        );
    };
    again(&[]);
    again(&["--no-cache"]);
    assert_eq!(fs::read_dir(&cache).unwrap().count(), 24);
    fs::rename(scene.file("run/detections"), scene.file("scene/hawp")).unwrap();
    again(&["--no-cache"]);
    assert!(!scene.file("run/detections").exists());
}

#[test]
fn images_need_no_field_and_get_one_on_request() {
    let scene = TestScene::new();
    let run = scene.path("run");
    let reconstruct = || {
        let mut command = neat(&["reconstruct", &scene.path("scene"), "--out", &run]);
        command.args(["--backend", "flex", "--steps", "2"]);
        command
    };
    let told = stderr(&reconstruct().assert().success());
    assert!(told.contains("distill.field: none"), "{told}");
    assert!(
        told.contains("train.steps = 2 has no effect: no field"),
        "{told}"
    );
    let manifest = json(&scene.file("run/manifest.json"));
    assert!(manifest["seconds"].get("train").is_none(), "{manifest}");
    assert!(!scene.file("run/metrics.jsonl").exists());
    let wireframe = fs::read(scene.file("run/wireframe.json")).unwrap();

    // What asks the field says how to get one.
    for command in [
        "render",
        "export --mesh",
        "distill --set distill.back_end=paper",
    ] {
        let mut words = command.split(' ');
        let mut command = neat(&[words.next().unwrap(), &run]);
        let message = stderr(&command.args(words).assert().code(2));
        assert!(message.contains("--train"), "{message}");
    }
    // What does not goes on.
    neat(&["distill", &run, "--backend", "flex"])
        .assert()
        .success();
    assert_eq!(
        fs::read(scene.file("run/wireframe.json")).unwrap(),
        wireframe
    );
    reconstruct().arg("--resume").assert().success();

    let mut trained = scene.run("reconstruct", "2");
    let told = stderr(&trained.arg("--overwrite").assert().success());
    assert!(!told.contains("no effect"), "{told}");
    neat(&["render", &run, "--downscale", "16", "--backend", "flex"])
        .assert()
        .success();
    scene
        .run("train", "2")
        .arg("--overwrite")
        .assert()
        .success();
    assert!(
        scene
            .file("run/checkpoints/step-00000002.safetensors")
            .exists()
    );
}

#[test]
fn detect_writes_wireframes_and_pictures() {
    let scene = photos();
    let out = scene.path("out");
    let assert = neat(&["detect", &scene.path("scene/images"), "--out", &out])
        .assert()
        .success();
    assert!(
        stdout(&assert).starts_with("24 images"),
        "{}",
        stdout(&assert)
    );
    let found = json(&scene.file("out/image_0003.json"));
    assert!(found["edges"].as_array().unwrap().len() > 5);
    assert_eq!(found["width"], 256);
    let picture = image::open(scene.file("out/overlays/image_0003.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (256, 256));

    // Fewer with a setting, none of them in a file that is not understood.
    let fewer = scene.path("fewer");
    neat(&["detect", &scene.path("scene/images"), "--out", &fewer])
        .args(["--set", "min_length=200", "--no-overlays"])
        .assert()
        .success();
    let edges = |folder: &str| {
        let path = scene.file(&format!("{folder}/image_0003.json"));
        json(&path)["edges"].as_array().unwrap().len()
    };
    assert!(edges("fewer") < edges("out"));
    assert!(!scene.file("fewer/overlays").exists());
    let bad = |arguments: &[&str], fragment: &str| {
        let assert = neat(&["detect", &scene.path("scene/images"), "--out", &fewer])
            .args(arguments)
            .assert()
            .code(2);
        assert!(stderr(&assert).contains(fragment), "{}", stderr(&assert));
    };
    bad(&["--set", "min_lenght=60"], "min_length");
    bad(&["--set", "min_length=-1"], "min_length");
    bad(&["--segments", &scene.path("nowhere")], "image_0000.npz");
    let segments = scene.file("segments");
    fs::create_dir(&segments).unwrap();
    fs::write(segments.join("image_0000.txt"), "1 2 3\n").unwrap();
    bad(&["--segments", &scene.path("segments")], "image_0000.txt");
}

#[test]
fn the_doctor_names_the_flag_that_repairs_a_scene() {
    let scene = photos();
    let doctor = |arguments: &[&str]| {
        let mut command = neat(&["doctor", &scene.path("scene"), "--backend", "flex"]);
        command.args(arguments).arg("--no-cache").assert()
    };
    let good = stdout(&doctor(&[]).success());
    assert!(good.contains("Verdict: ready"), "{good}");
    assert!(good.contains("--preset fast"), "{good}");
    assert!(good.contains("neat reconstruct"), "{good}");

    change_poses(&scene, opengl);
    let bad = stdout(&doctor(&[]).code(2));
    assert!(bad.contains("--camera-axes right-up-back"), "{bad}");
    let report: Value = serde_json::from_str(&stdout(&doctor(&["--json"]).code(2))).unwrap();
    assert_eq!(report["verdict"], "not-ready");
    let repaired = stdout(&doctor(&["--camera-axes", "right-up-back"]).success());
    assert!(
        repaired.contains("--out RUN --camera-axes right-up-back"),
        "{repaired}"
    );

    // A run says the same before it begins, and leaves nothing.
    let assert = scene
        .run("reconstruct", "2")
        .arg("--no-cache")
        .assert()
        .code(2);
    assert!(stderr(&assert).contains("--camera-axes right-up-back"));
    assert!(!scene.file("run").exists());
    let mut told = scene.run("reconstruct", "2");
    told.args(["--no-cache", "--camera-axes", "right-up-back"]);
    told.assert().success();
    let config = fs::read_to_string(scene.file("run/config.toml")).unwrap();
    assert!(config.contains("right-up-back"), "{config}");
    fs::remove_dir_all(scene.file("run")).unwrap();
    let mut forced = scene.run("train", "1");
    forced
        .args(["--no-cache", "--no-doctor"])
        .assert()
        .success();
}

#[test]
fn the_doctor_explains_what_cannot_be_read() {
    let scene = photos();
    truncate(&scene.file("scene/cameras.npz"));
    let assert = neat(&["doctor", &scene.path("scene"), "--no-cache"])
        .assert()
        .code(2);
    assert!(
        stdout(&assert).contains("cameras.npz"),
        "{}",
        stdout(&assert)
    );
    assert!(stdout(&assert).contains("truncated"), "{}", stdout(&assert));
}

#[test]
fn converted_scenes_are_read_again() {
    let scene = TestScene::new();
    for (format, file) in [
        ("colmap", "sparse/0/images.txt"),
        ("cameras-npz", "cameras.npz"),
        ("transforms-json", "transforms.json"),
        ("abc", "cameras.npz"),
    ] {
        let out = scene.path(format);
        neat(&["convert", &scene.path("scene"), "--to", format])
            .args(["--out", &out, "--no-cache"])
            .assert()
            .success();
        assert!(scene.file(format).join(file).exists(), "{format}");
        let info = stdout(&neat(&["info", &out]).assert().success());
        assert!(info.contains("48×48"), "{info}");
        // What is there is not replaced.
        let assert = neat(&["convert", &scene.path("scene"), "--to", format])
            .args(["--out", &out, "--no-cache"])
            .assert()
            .code(2);
        assert!(
            stderr(&assert).contains("new or an empty folder"),
            "{}",
            stderr(&assert)
        );
    }
}

#[test]
fn images_are_scaled_and_spheres_placed_as_asked_for() {
    let scene = TestScene::new();
    let info = |arguments: &[&str]| {
        let mut command = neat(&["info", &scene.path("scene")]);
        stdout(&command.args(arguments).assert().success())
    };
    let scaled = info(&["--max-image-size", "24"]);
    assert!(scaled.contains("24×24"), "{scaled}");
    let placed = info(&["--scene-sphere", "-0.1,0.2,0,2.5"]);
    assert!(
        placed.contains("radius 2.5000, from the given numbers"),
        "{placed}"
    );
    let cameras = info(&["--scene-sphere", "cameras"]);
    assert!(cameras.contains("what the cameras look at"), "{cameras}");
    for (arguments, fragment) in [
        (["--scene-sphere", "masks"], "no mask for every view"),
        (["--scene-sphere", "points"], "sparse points"),
        (["--scene-sphere", "1,2,3"], "four numbers"),
        (["--camera-axes", "right-left-up"], "right-down-forward"),
        (["--poses", "upside-down"], "camera-to-world"),
        (["--focal-scale", "0"], "above 0"),
    ] {
        let mut command = neat(&["info", &scene.path("scene")]);
        let assert = command.args(arguments).assert().code(2);
        assert!(stderr(&assert).contains(fragment), "{}", stderr(&assert));
    }
}
