//! Runs the real binary on tiny scenes in temporary folders.

// Every test program has a copy of this module, and uses a part of it.
#![allow(dead_code)]

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The program under test, on one backend that every machine has.
pub fn neat(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_neat"));
    command.args(arguments);
    command
}

/// What a command wrote to the standard error.
pub fn stderr(assert: &Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stderr).into_owned()
}

/// What a command wrote to the standard output.
pub fn stdout(assert: &Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stdout).into_owned()
}

/// A temporary folder with a tiny synthetic scene in it.
pub struct TestScene {
    dir: TempDir,
}

impl TestScene {
    /// Four views of a box, 48 × 48 pixels, everything detected.
    pub fn new() -> Self {
        Self::with(&[
            "--solid",
            "box",
            "--views",
            "4",
            "--image-size",
            "48",
            "--detection-rate",
            "1",
        ])
    }

    /// What `neat synth` makes with these arguments.
    pub fn with(arguments: &[&str]) -> Self {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let scene = Self { dir };
        let mut synth = neat(&["synth", "--out", &scene.path("scene")]);
        synth.args(arguments).assert().success();
        scene
    }

    /// A path in the folder; the scene is `scene`.
    pub fn path(&self, name: &str) -> String {
        self.file(name).to_string_lossy().into_owned()
    }

    /// A path in the folder; the scene is `scene`.
    pub fn file(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// `neat COMMAND scene --out run` with few steps.
    pub fn run(&self, command: &str, steps: &str) -> Command {
        let mut neat = neat(&[command, &self.path("scene")]);
        neat.args(["--out", &self.path("run")]);
        neat.args(["--backend", "flex", "--steps", steps]);
        neat
    }
}

/// Cuts a file to the first half.
pub fn truncate(path: &Path) {
    let bytes = fs::read(path).expect("a file to truncate");
    fs::write(path, &bytes[..bytes.len() / 2]).expect("a writable file");
}
