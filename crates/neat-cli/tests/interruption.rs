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

#[test]
fn ctrl_c_leaves_a_checkpoint_to_continue_from() {
    let scene = TestScene::new();
    let run = scene.file("run");
    let mut child = Command::new(env!("CARGO_BIN_EXE_neat"))
        .args(["train", &scene.path("scene"), "--out", &scene.path("run")])
        .args(["--backend", "flex", "--steps", "1000000"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let deadline = Instant::now() + Duration::from_secs(300);
    let trains = || fs::metadata(run.join("metrics.jsonl")).is_ok_and(|file| file.len() > 0);
    while !trains() {
        assert!(Instant::now() < deadline, "no step was done");
        sleep(Duration::from_millis(20));
    }
    let killed = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));

    assert_eq!(manifest(&run)["status"], "interrupted");
    let steps = manifest(&run)["steps"].as_u64().unwrap();
    assert!(steps >= 1);
    let checkpoint = run.join(format!("checkpoints/step-{steps:08}.safetensors"));
    assert!(checkpoint.exists());

    let more = (steps + 1).to_string();
    scene.run("train", &more).arg("--resume").assert().success();
    assert_eq!(manifest(&run)["steps"], steps + 1);
}

/// A limit on the size of files stands in for a full disk: writing a checkpoint
/// fails, everything smaller does not.
#[test]
fn a_full_disk_is_reported_and_loses_nothing() {
    let scene = TestScene::new();
    let script = format!(
        "trap '' XFSZ; ulimit -f 64; exec '{}' train '{}' --out '{}' --backend flex --steps 1",
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
