//! Every kind of bad input: one clear sentence that names the file, the view and
//! the remedy, exit code 2, and nothing left behind.

mod support;

use neat_core::npz::{NpyArray, NpzReader, write_npz};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use support::{TestScene, neat, stderr, truncate};

/// Spoils a scene and checks what `neat train` says: exit code 2, one line with
/// all of `fragments`, and no run folder.
fn check(spoil: impl FnOnce(&TestScene), fragments: &[&str]) {
    let scene = TestScene::new();
    spoil(&scene);
    let assert = scene.run("train", "1").arg("--quiet").assert().code(2);
    let message = stderr(&assert);
    assert!(message.starts_with("error: "), "{message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    for fragment in fragments {
        assert!(message.contains(fragment), "no `{fragment}` in: {message}");
    }
    assert!(!scene.file("run").exists(), "a run folder was left behind");
}

/// Rewrites `cameras.npz` with changed poses or intrinsics.
fn change_cameras(scene: &TestScene, change: impl FnOnce(&mut NpyArray, &mut NpyArray)) {
    let path = scene.file("scene/cameras.npz");
    let mut npz = NpzReader::open(&path, "").unwrap();
    let mut intrinsics = npz.array("intrinsics").unwrap();
    let mut extrinsics = npz.array("extrinsics").unwrap();
    change(&mut intrinsics, &mut extrinsics);
    let arrays = BTreeMap::from([("intrinsics", intrinsics), ("extrinsics", extrinsics)]);
    write_npz(&path, &arrays).unwrap();
}

/// Rewrites the 2D wireframe of the second view.
fn change_wireframe(scene: &TestScene, change: impl FnOnce(&mut Value)) {
    let path = scene.file("scene/hawp/image_0001.json");
    let mut json: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut json);
    fs::write(&path, json.to_string()).unwrap();
}

/// Leaves no segment in a 2D wireframe.
fn empty_wireframe(path: &Path) {
    let mut json: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    json["edges"] = json!([]);
    json["edges-weights"] = json!([]);
    fs::write(path, json.to_string()).unwrap();
}

#[test]
fn missing_files() {
    check(
        |scene| fs::remove_dir_all(scene.file("scene")).unwrap(),
        &["scene does not exist", "give the folder of a scene"],
    );
    check(
        |scene| fs::remove_file(scene.file("scene/cameras.npz")).unwrap(),
        &["is not a scene", "cameras.npz", "cameras.json"],
    );
    check(
        |scene| fs::remove_file(scene.file("scene/images/image_0002.png")).unwrap(),
        &["cameras.npz holds 4 poses", "3 images"],
    );
    check(
        |scene| fs::remove_file(scene.file("scene/hawp/image_0001.json")).unwrap(),
        &["image_0001.json does not exist", "`neat detect`"],
    );
}

#[test]
fn empty_and_truncated_files() {
    let files = [
        ("cameras.npz", "cameras.npz"),
        ("images/image_0001.png", "image_0001.png"),
        ("hawp/image_0001.json", "image_0001.json"),
    ];
    for (file, name) in files {
        let path = format!("scene/{file}");
        check(|scene| fs::write(scene.file(&path), "").unwrap(), &[name]);
        check(|scene| truncate(&scene.file(&path)), &[name]);
    }
}

#[test]
fn wrong_shapes_and_numbers_of_cameras() {
    check(
        |scene| {
            change_cameras(scene, |intrinsics, _| {
                intrinsics.shape = vec![4, 9];
            });
        },
        &["cameras.npz", "`intrinsics`", "[4, 9]", "[N, 3, 3]"],
    );
    let poses = "view `image_0000`";
    check(
        |scene| change_cameras(scene, |_, extrinsics| extrinsics.values[3] = f64::NAN),
        &["cameras.npz", "extrinsics", "NaN"],
    );
    check(
        |scene| change_cameras(scene, |_, extrinsics| extrinsics.values[3] = f64::INFINITY),
        &["cameras.npz", "extrinsics", "inf"],
    );
    check(
        |scene| {
            change_cameras(scene, |_, extrinsics| {
                // The first two columns of the rotation become equal.
                for row in 0..3 {
                    extrinsics.values[4 * row + 1] = extrinsics.values[4 * row];
                }
            });
        },
        &["cameras.npz", poses, "singular"],
    );
    check(
        |scene| {
            change_cameras(scene, |_, extrinsics| {
                for row in 0..3 {
                    extrinsics.values[4 * row] *= -1.0;
                }
            });
        },
        &["cameras.npz", poses, "mirrored", "OpenCV axes"],
    );
    check(
        |scene| change_cameras(scene, |intrinsics, _| intrinsics.values[0] = -70.0),
        &["cameras.npz", poses, "focal length"],
    );
}

#[test]
fn images_and_wireframes_that_disagree() {
    check(
        |scene| {
            let path = scene.file("scene/images/image_0001.png");
            image::RgbImage::new(40, 48).save(path).unwrap();
        },
        &["view `image_0001`", "48×48", "40×48", "wireframe"],
    );
    check(
        |scene| change_wireframe(scene, |json| json["edges-weights"] = json!([0.5])),
        &["image_0001", "edges"],
    );
    check(
        |scene| change_wireframe(scene, |json| json["edges"][0] = json!([0, 4096])),
        &["image_0001", "edge 0", "4096"],
    );
    check(
        |scene| change_wireframe(scene, |json| json["vertices"][0] = json!(["x", 1])),
        &["image_0001.json"],
    );
}

#[test]
fn no_view_and_no_usable_view() {
    check(
        |scene| {
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
        &["holds no view", "images and their poses"],
    );
    check(
        |scene| {
            for i in 0..4 {
                empty_wireframe(&scene.file(&format!("scene/hawp/image_000{i}.json")));
            }
        },
        &["none of the 4 views", "0.05", "detect 2D wireframes"],
    );
}

#[test]
fn a_view_without_segments_is_skipped_with_a_warning() {
    let scene = TestScene::new();
    empty_wireframe(&scene.file("scene/hawp/image_0001.json"));
    let assert = scene.run("train", "1").arg("--quiet").assert().success();
    let message = stderr(&assert);
    assert!(
        message.starts_with("warning: view `image_0001`"),
        "{message}"
    );
    let manifest = fs::read_to_string(scene.file("run/manifest.json")).unwrap();
    assert!(manifest.contains("view `image_0001`"), "{manifest}");
}

#[test]
fn run_folders_that_cannot_be_used() {
    let scene = TestScene::new();
    let run = scene.file("run");
    fs::create_dir(&run).unwrap();
    fs::write(run.join("notes.txt"), "mine").unwrap();
    let refused = scene.run("train", "1").assert().code(2);
    assert!(stderr(&refused).contains("run is not empty"));
    assert!(stderr(&refused).contains("--overwrite"));
    assert_eq!(fs::read_to_string(run.join("notes.txt")).unwrap(), "mine");

    let not_a_run = scene.run("train", "1").arg("--resume").assert().code(2);
    assert!(stderr(&not_a_run).contains("no config.toml"));
    let distill = neat(&["distill", &scene.path("run")]).assert().code(2);
    assert!(stderr(&distill).contains("no config.toml"));

    fs::remove_dir_all(&run).unwrap();
    fs::write(&run, "a file").unwrap();
    let not_a_folder = scene.run("train", "1").assert().code(2);
    assert!(stderr(&not_a_folder).contains("not a folder"));

    let scene_folder = neat(&["synth", "--out", &scene.path("scene")])
        .assert()
        .code(2);
    assert!(stderr(&scene_folder).contains("scene is not empty"));
}

#[cfg(unix)]
#[test]
#[expect(clippy::print_stderr, reason = "a skipped test must say so")]
fn read_only_folders() {
    use std::os::unix::fs::PermissionsExt;
    let scene = TestScene::new();
    let run = scene.file("run");
    fs::create_dir(&run).unwrap();
    fs::set_permissions(&run, fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(run.join("probe"), "").is_ok() {
        eprintln!("skipped: this user may write anywhere");
        return;
    }
    let assert = scene.run("train", "1").assert().code(2);
    assert!(stderr(&assert).contains("no run can be written to"));
}

#[test]
fn wrong_options() {
    let scene = TestScene::new();
    for (arguments, fragments) in [
        (["--preset", "fats"], ["'fats'", "fast"]),
        (["--backend", "cuda"], ["'cuda'", "wgpu"]),
        (
            ["--set", "train.stepz=1"],
            ["`train.stepz`", "`train.steps`"],
        ),
        (["--set", "train.rays=many"], ["`train.rays`", "`many`"]),
        (["--set", "train.rays"], ["train.rays", "key.path=value"]),
        (["--time-budget", "soon"], ["'soon'", "10m"]),
        (["--config", "no.toml"], ["no.toml", "does not exist"]),
    ] {
        let mut command = neat(&["train", &scene.path("scene")]);
        command.args(["--out", &scene.path("run")]).args(arguments);
        let message = stderr(&command.assert().code(2));
        for fragment in fragments {
            assert!(message.contains(fragment), "no `{fragment}` in: {message}");
        }
    }
    scene.run("train", "0").assert().code(2);
    assert!(!scene.file("run").exists());
}

#[test]
fn wrong_benchmarks() {
    for (arguments, fragments) in [
        (
            ["--preset", "fast,papper-abc"],
            ["'papper-abc'", "paper-abc"],
        ),
        (["--backend", "cuda"], ["'cuda'", "wgpu"]),
        (["--seconds", "0"], ["'0'", "above 0"]),
        (["--seconds", "inf"], ["'inf'", "above 0"]),
        (["--seconds", "soon"], ["'soon'", "above 0"]),
    ] {
        let message = stderr(&neat(&["bench"]).args(arguments).assert().code(2));
        for fragment in fragments {
            assert!(message.contains(fragment), "no `{fragment}` in: {message}");
        }
    }
}

#[test]
fn wrong_synthetic_scenes() {
    let scene = TestScene::new();
    for (option, value, name) in [
        ("--views", "0", "views"),
        ("--distance", "0.1", "camera_distance"),
        ("--noise", "nan", "noise_in_pixels"),
        ("--detection-rate", "2", "detection_rate"),
    ] {
        let mut command = neat(&["synth", "--out", &scene.path("new"), option, value]);
        let message = stderr(&command.assert().code(2));
        assert!(message.contains(name), "{message}");
        assert!(!scene.file("new").exists());
    }
}

#[test]
fn wrong_files_for_evaluation() {
    let scene = TestScene::new();
    let truth = scene.path("scene/gt_wireframe.json");
    let bad = scene.file("bad.json");
    let eval = |name: &str| {
        let assert = neat(&["eval", "--pred", &scene.path(name), "--gt", &truth]).assert();
        stderr(&assert.code(2))
    };
    assert!(eval("none.json").contains("none.json does not exist"));
    for content in [
        "",
        "{\"junctions\": [[0, 0, 0]",
        "{\"junctions\": [[0, 0, 0]], \"edges\": [[0, 1]]}",
        "{\"junctions\": [[0, 0, null]], \"edges\": []}",
        "[]",
    ] {
        fs::write(&bad, content).unwrap();
        let message = eval("bad.json");
        assert!(message.contains("bad.json"), "{content}: {message}");
    }
    let ply = scene.file("cloud.ply");
    fs::write(&ply, "ply\nformat ascii 1.0\nelement vertex 2\n").unwrap();
    let mut command = neat(&[
        "eval",
        "--pred",
        &truth,
        "--points",
        &scene.path("cloud.ply"),
    ]);
    assert!(stderr(&command.assert().code(2)).contains("cloud.ply"));
    neat(&["eval", "--pred", &truth]).assert().code(2);
    let eval = |arguments: &[&str]| {
        let mut command = neat(&["eval", "--pred", &truth, "--gt", &truth]);
        stderr(&command.args(arguments).assert().code(2))
    };
    assert!(eval(&["--protocol", "best"]).contains("neat-abc"));
    assert!(eval(&["--protocol", "limap-tnt"]).contains("--points"));
    assert!(eval(&["--plane", "Plane24.mat"]).contains("no meaning for neat-abc"));
}
