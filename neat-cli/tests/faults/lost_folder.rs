//! Folders that vanish, and folders that have to be made.

use crate::support::{TestScene, checkpoints, stderr};
use std::fs;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

#[test]
fn a_run_whose_folder_vanishes_ends_with_an_error() {
    let scene = TestScene::new();
    let run = scene.file("run");
    let child = Command::new(env!("CARGO_BIN_EXE_neat"))
        .args(["train", &scene.path("scene"), "--out", &scene.path("run")])
        .args(["--backend", "flex", "--steps", "1000000", "--quiet"])
        .args(["--set", "train.checkpoint_interval=4"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let deadline = Instant::now() + Duration::from_secs(300);
    while checkpoints(&run).is_empty() {
        assert!(Instant::now() < deadline, "no checkpoint was written");
        sleep(Duration::from_millis(1));
    }
    // A file may be written into a folder that is just being removed.
    while fs::remove_dir_all(&run).is_err() && run.exists() {
        assert!(Instant::now() < deadline, "the folder cannot be removed");
    }
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_eq!(message.matches("error: ").count(), 1, "{message}");
    let named = format!("cannot write {}/", run.display());
    assert!(message.contains(&named), "{message}");
    assert!(!run.exists(), "a part of the folder is there again");
}

#[test]
fn parents_of_a_run_are_made() {
    let scene = TestScene::new();
    scene.resume("some/where/run").assert().success();
    assert!(scene.file("some/where/run/wireframe.json").exists());
    fs::write(scene.file("file"), "mine").unwrap();
    let assert = scene.resume("file/run").assert().code(2);
    assert!(stderr(&assert).contains("file/run"));
    assert_eq!(fs::read(scene.file("file")).unwrap(), b"mine");
}
