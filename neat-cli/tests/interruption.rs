//! Runs that cannot go on: a person's Ctrl-C, and a disk without space.
#![cfg(unix)]

mod support;

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use support::TestScene;

fn manifest(run: &Path) -> Value {
    serde_json::from_slice(&fs::read(run.join("manifest.json")).unwrap()).unwrap()
}

/// The last checkpoint of a run of [`STEPS`] steps.
const LAST: &str = "checkpoints/step-00000600.safetensors";
const STEPS: &str = "600";

#[test]
fn ctrl_c_leaves_a_checkpoint_to_continue_from() {
    let scene = TestScene::new();
    scene.run("train", STEPS).assert().success();
    let run = scene.file("run");
    let reference = fs::read(run.join(LAST)).unwrap();
    let metrics = fs::read(run.join("metrics.jsonl")).unwrap();
    fs::remove_dir_all(&run).unwrap();

    let mut child = Command::new(env!("CARGO_BIN_EXE_neat"))
        .args(["train", &scene.path("scene"), "--out", &scene.path("run")])
        .args(["--backend", "flex", "--steps", STEPS])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let deadline = Instant::now() + Duration::from_secs(300);
    let trains = || fs::metadata(run.join("metrics.jsonl")).is_ok_and(|file| file.len() > 0);
    while !trains() {
        assert!(Instant::now() < deadline, "no step was done");
        sleep(Duration::from_millis(2));
    }
    let killed = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));

    assert_eq!(manifest(&run)["status"], "interrupted");
    let steps = manifest(&run)["steps"].as_u64().unwrap();
    assert!((1..600).contains(&steps));
    let checkpoint = run.join(format!("checkpoints/step-{steps:08}.safetensors"));
    assert!(checkpoint.exists());

    scene.run("train", STEPS).arg("--resume").assert().success();
    assert_eq!(manifest(&run)["steps"], 600);
    assert_eq!(fs::read(run.join(LAST)).unwrap(), reference);
    assert_eq!(fs::read(run.join("metrics.jsonl")).unwrap(), metrics);
}

#[test]
fn numbers_that_diverge_are_caught_and_a_state_that_shows_it_is_left() {
    let scene = TestScene::new();
    // Each step overflows, with any of the lower rates too.
    let output = scene
        .run("train", "40")
        .args(["--set", "train.learning_rate=1e30"])
        .assert()
        .code(1);
    let message = support::stderr(&output);
    assert!(
        message.contains("3 tries with lower learning rates"),
        "{message}"
    );
    assert!(message.contains("run/failure"), "{message}");
    assert_eq!(manifest(&scene.file("run"))["status"], "failed");

    // The dump is a run that fails at once.
    let again = support::neat(&[
        "train",
        &scene.path("scene"),
        "--backend",
        "flex",
        "--resume",
    ])
    .args(["--out", &scene.path("run/failure")])
    .assert()
    .code(1);
    assert!(support::stderr(&again).contains("tries with lower learning rates"));
}

/// A limit on the size of files stands in for a full disk: writing a checkpoint
/// fails, everything smaller does not.
#[test]
fn a_full_disk_is_reported_and_loses_nothing() {
    let scene = TestScene::new();
    let script = format!(
        "ulimit -f 64; exec '{}' train '{}' --out '{}' --backend flex --steps 1",
        env!("CARGO_BIN_EXE_neat"),
        scene.path("scene"),
        scene.path("run"),
    );
    let output = Command::new("sh").args(["-c", &script]).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    let errors: Vec<_> = message
        .lines()
        .filter(|line| line.starts_with("error: "))
        .collect();
    assert_eq!(errors.len(), 1, "{message}");
    assert!(errors[0].contains("step-00000001.safetensors"), "{message}");

    let run = scene.file("run");
    assert_eq!(manifest(&run)["status"], "failed");
    assert!(run.join("config.toml").exists());
    assert!(fs::metadata(run.join("metrics.jsonl")).unwrap().len() > 0);
    assert_eq!(fs::read_dir(run.join("checkpoints")).unwrap().count(), 0);
}
