//! Hostile surroundings: limits of the system, too many threads, closed terminals, texts that
//! would take over a terminal.
#![cfg(unix)]

mod support;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use support::{TestScene, neat, stderr};

const NEAT: &str = env!("CARGO_BIN_EXE_neat");

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn is_root() -> bool {
    let output = Command::new("id").arg("-u").output().unwrap();
    output.stdout == b"0\n"
}

/// Runs `neat` below a shell that first does something else.
fn after(preparation: &str, arguments: &str) -> Output {
    let script = format!("{preparation}; exec '{NEAT}' {arguments}");
    Command::new("sh").args(["-c", &script]).output().unwrap()
}

#[test]
fn more_threads_than_the_machine_has_use_for_become_fewer() {
    let scene = TestScene::new();
    let info = format!("info {}", scene.path("scene"));
    for output in [
        after("true", &format!("{info} --threads 65535")),
        after("export RAYON_NUM_THREADS=100000", &info),
    ] {
        assert!(output.status.success(), "{}", said(&output));
        assert!(said(&output).contains("4 for each of"), "{}", said(&output));
    }
    let output = after("true", &format!("{info} --threads 2"));
    assert_eq!(said(&output), "");
}

/// For root no limit on processes holds: it becomes somebody else, where it can.
#[test]
#[expect(clippy::print_stderr, reason = "a skipped test must be seen")]
fn a_system_that_starts_no_threads_is_survived() {
    let scene = TestScene::new();
    let all = fs::Permissions::from_mode(0o777);
    let root = scene.file("scene").parent().unwrap().to_owned();
    fs::set_permissions(&root, all).unwrap();
    let limited = |command: &str| {
        let script = format!("ulimit -u 1; exec {command}");
        let mut shell = match is_root() {
            true => Command::new("setpriv"),
            false => Command::new("bash"),
        };
        if is_root() {
            shell.args(["--reuid", "54321", "--clear-groups", "bash"]);
        }
        shell.args(["-c", &script]).output()
    };
    match limited(&format!("test -x '{NEAT}'")) {
        Ok(output) if output.status.success() => {}
        _ => return eprintln!("skipped: the program cannot be run as somebody else"),
    }
    let output = limited(&format!(
        "'{NEAT}' reconstruct '{}' --out '{}' --no-cache",
        scene.path("scene"),
        scene.path("run")
    ));
    let message = said(&output.unwrap());
    assert!(message.contains("the system starts 0 of"), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    assert!(scene.file("run/wireframe.json").exists(), "{message}");
}

/// A training that goes on until it is told to end.
fn training(scene: &TestScene, preparation: &str) -> Child {
    let script = format!(
        "{preparation}; exec '{NEAT}' train '{}' --out '{}' --backend flex --steps 100000",
        scene.path("scene"),
        scene.path("run")
    );
    let mut shell = Command::new("sh");
    let child = shell.args(["-c", &script]).stderr(Stdio::null()).spawn();
    let metrics = scene.file("run/metrics.jsonl");
    let deadline = Instant::now() + Duration::from_secs(300);
    while !fs::metadata(&metrics).is_ok_and(|file| file.len() > 0) {
        assert!(Instant::now() < deadline, "no step was done");
        sleep(Duration::from_millis(2));
    }
    child.unwrap()
}

fn signal(child: &Child, name: &str) {
    let id = child.id().to_string();
    let sent = Command::new("kill").args([name, &id]).status().unwrap();
    assert!(sent.success());
}

fn is_interrupted(run: &Path) -> bool {
    let manifest = fs::read_to_string(run.join("manifest.json")).unwrap();
    manifest.contains(r#""status": "interrupted""#)
}

/// Whether these tests run below `nohup`, and so everything that they start.
fn is_hangup_ignored() -> bool {
    let script = "kill -HUP $$; exit 7";
    let status = Command::new("sh").args(["-c", script]).status();
    status.unwrap().code() == Some(7)
}

#[test]
#[expect(clippy::print_stderr, reason = "a skipped test must be seen")]
fn a_closed_terminal_saves() {
    if is_hangup_ignored() {
        return eprintln!("skipped: closed terminals are to be ignored here");
    }
    let scene = TestScene::new();
    let mut child = training(&scene, "true");
    signal(&child, "-HUP");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(is_interrupted(&scene.file("run")));
    assert!(!support::checkpoints(&scene.file("run")).is_empty());
}

#[test]
fn a_closed_terminal_is_ignored_where_asked() {
    // As below `nohup`.
    let scene = TestScene::new();
    let mut child = training(&scene, "trap '' HUP");
    signal(&child, "-HUP");
    sleep(Duration::from_millis(300));
    assert!(child.try_wait().unwrap().is_none(), "it ended");
    signal(&child, "-TERM");
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn names_of_others_do_not_reach_the_terminal_raw() {
    let dir = tempfile::tempdir().unwrap();
    let model = dir.path().join("sparse/0");
    fs::create_dir_all(&model).unwrap();
    fs::create_dir(dir.path().join("images")).unwrap();
    let name = "\u{1b}[2J\u{7}\u{9b}31mimage.png";
    fs::write(model.join("cameras.txt"), "1 PINHOLE 8 8 8 8 4 4\n").unwrap();
    fs::write(
        model.join("images.txt"),
        format!("1 1 0 0 0 0 0 4 1 {name}\n\n"),
    )
    .unwrap();
    fs::write(model.join("points3D.txt"), "").unwrap();
    for command in ["info", "doctor", "reconstruct"] {
        let mut neat = neat(&[command, &dir.path().to_string_lossy()]);
        if command == "reconstruct" {
            neat.args(["--out", &dir.path().join("run").to_string_lossy()]);
        }
        let assert = neat.assert().failure();
        let output = assert.get_output();
        let text = [output.stderr.as_slice(), &output.stdout].concat();
        let text = String::from_utf8(text).unwrap();
        let is_raw = |c: char| c.is_control() && c != '\n';
        assert!(!text.contains(is_raw), "{command}: {text:?}");
        assert!(text.contains(r"\u{1b}[2J"), "{command}: {text:?}");
    }
}

#[test]
fn an_empty_wireframe_has_a_reason() {
    let scene = TestScene::new();
    let run = scene.path("run");
    let reconstruct = || {
        let mut neat = neat(&["reconstruct", &scene.path("scene"), "--out", &run]);
        neat.args(["--set", "distill.assembler.min_evidence=1e9"]);
        neat
    };
    let assert = reconstruct().assert().code(3);
    let message = stderr(&assert);
    let reason = "the wireframe has no edges: of ";
    assert!(message.contains(reason), "{message}");
    assert!(message.contains("neat doctor SCENE"), "{message}");
    assert!(scene.file("run/report.html").exists());
    // Said again by those who come later; with less asked of a line there are edges.
    reconstruct().arg("--resume").assert().code(3);
    neat(&["distill", &run]).assert().code(3);
    let set = ["--set", "distill.assembler.min_evidence=3"];
    neat(&["distill", &run]).args(set).assert().success();
}

#[test]
fn a_scene_sphere_without_room_for_an_edge_is_refused() {
    let scene = TestScene::new();
    let assert = neat(&[
        "reconstruct",
        &scene.path("scene"),
        "--out",
        &scene.path("run"),
    ])
    .args(["--scene-sphere", "0,0,0,1e-6"])
    .assert()
    .code(2);
    let message = stderr(&assert);
    assert!(message.contains("pixels large in the images"), "{message}");
    assert!(message.contains("--scene-sphere"), "{message}");
}
