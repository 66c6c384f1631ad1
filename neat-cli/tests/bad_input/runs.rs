//! Run folders that cannot be used or continued.

use crate::case::{Case, TRAIN, check};
use crate::support::{TestScene, checkpoints};
use std::fs;

/// What continues the run of [`killed`].
const RESUME: &str = "reconstruct scene --out run --train --resume --backend flex --steps 40 --set train.checkpoint_interval=4";

/// A run that was killed after its first checkpoint.
fn killed(scene: &TestScene) {
    scene.kill_when("run", |run| !checkpoints(run).is_empty());
}

/// A run that was killed, and a file of it or of the scene with another content.
fn killed_and(scene: &TestScene, file: &str, change: impl FnOnce(String) -> String) {
    killed(scene);
    let path = scene.file(file);
    let text = fs::read_to_string(&path).unwrap();
    let changed = change(text.clone());
    assert_ne!(changed, text, "{file} is as it was");
    fs::write(path, changed).unwrap();
}

#[test]
fn run_folders() {
    check(
        "run folders",
        &[
            Case {
                kind: "a folder with files in it",
                spoil: |scene| {
                    fs::create_dir(scene.file("run")).unwrap();
                    fs::write(scene.file("run/notes.txt"), "mine").unwrap();
                },
                command: TRAIN,
                names: &["run is not empty", "--overwrite"],
            },
            Case {
                kind: "`--resume` in a folder with other files",
                spoil: |scene| {
                    fs::create_dir(scene.file("run")).unwrap();
                    fs::write(scene.file("run/notes.txt"), "mine").unwrap();
                },
                command: RESUME,
                names: &["run is not the folder of a run"],
            },
            Case {
                kind: "a file instead of a folder",
                spoil: |scene| fs::write(scene.file("run"), "mine").unwrap(),
                command: TRAIN,
                names: &["run is not a folder", "another path"],
            },
            Case {
                kind: "`--resume` with a file instead of a folder",
                spoil: |scene| fs::write(scene.file("run"), "mine").unwrap(),
                command: RESUME,
                names: &["run is not a folder", "another path"],
            },
            Case {
                kind: "a run without `config.toml`",
                spoil: |scene| {
                    killed(scene);
                    fs::remove_file(scene.file("run/config.toml")).unwrap();
                },
                command: RESUME,
                names: &["no config.toml", "put it back", "--overwrite"],
            },
            Case {
                kind: "a run without `manifest.json`",
                spoil: |scene| {
                    killed(scene);
                    fs::remove_file(scene.file("run/manifest.json")).unwrap();
                },
                command: RESUME,
                names: &["no manifest.json", "put it back", "--overwrite"],
            },
            Case {
                kind: "a damaged `config.toml`",
                spoil: |scene| {
                    killed_and(scene, "run/config.toml", |text| text[..100].to_owned());
                },
                command: RESUME,
                names: &["config.toml", "--overwrite"],
            },
            Case {
                kind: "a damaged `manifest.json`",
                spoil: |scene| {
                    killed_and(scene, "run/manifest.json", |text| text[..100].to_owned());
                },
                command: RESUME,
                names: &["manifest.json", "--overwrite"],
            },
        ],
    );
}

#[test]
fn changes_since_a_run_began() {
    check(
        "changes",
        &[
            Case {
                kind: "other values of the configuration",
                spoil: killed,
                command: "reconstruct scene --out run --train --resume --backend flex --steps 50 --set train.rays=128",
                names: &[
                    "train.steps: 40 then, 50 now",
                    "train.rays: 256 then, 128 now",
                    "--overwrite",
                ],
            },
            Case {
                kind: "another seed",
                spoil: killed,
                command: "reconstruct scene --out run --train --resume --backend flex --seed 5",
                names: &["seed: 0 then, 5 now"],
            },
            Case {
                kind: "another preset",
                spoil: killed,
                command: "reconstruct scene --out run --train --resume --backend flex --preset paper-abc",
                names: &[
                    "data.scene_radius: none then, 3.0 now",
                    "more",
                    "--overwrite",
                ],
            },
            Case {
                kind: "a changed file of the scene",
                spoil: |scene| {
                    killed_and(scene, "scene/hawp/image_0001.json", |text| text + "\n");
                },
                command: RESUME,
                names: &["hawp/image_0001.json: has changed"],
            },
            Case {
                kind: "a file of the scene that is gone",
                spoil: |scene| {
                    killed(scene);
                    fs::remove_dir_all(scene.file("scene/hawp")).unwrap();
                },
                command: RESUME,
                names: &["hawp/image_0000.json: is not there any more"],
            },
            Case {
                kind: "a scene that is gone",
                spoil: |scene| {
                    killed(scene);
                    fs::remove_dir_all(scene.file("scene")).unwrap();
                },
                command: RESUME,
                names: &["scene does not exist"],
            },
        ],
    );
}
