//! Runs the real binary on tiny scenes in temporary folders.

// Every test program has a copy of this module, and uses a part of it.
#![allow(dead_code)]

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
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
    /// Eight views of a box, 48 × 48 pixels, everything detected.
    pub fn new() -> Self {
        Self::of_views("8")
    }

    /// Half as many: too few for an edge, and enough for what never comes so far.
    pub fn without_edges() -> Self {
        Self::of_views("4")
    }

    fn of_views(views: &str) -> Self {
        let size = ["--image-size", "48", "--detection-rate", "1"];
        Self::with(&[["--solid", "box", "--views", views].as_slice(), &size].concat())
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

    /// `neat COMMAND scene --out run` with few steps of training.
    pub fn run(&self, command: &str, steps: &str) -> Command {
        let mut neat = neat(&[command, &self.path("scene")]);
        if command == "reconstruct" {
            neat.arg("--train");
        }
        neat.args(["--out", &self.path("run")]);
        neat.args(["--backend", "flex", "--steps", steps]);
        neat
    }

    /// `neat reconstruct scene --out RUN --resume`: begins or continues a training of
    /// forty steps with a checkpoint after every fourth.
    pub fn resume(&self, run: &str) -> Command {
        let mut neat = neat(&["reconstruct", &self.path("scene")]);
        neat.args(["--out", &self.path(run), "--resume", "--train"])
            .args(["--backend", "flex", "--steps", "40"])
            .args(["--set", "train.checkpoint_interval=4"]);
        neat
    }

    /// Begins what [`Self::resume`] does and kills it as soon as `RUN` meets the
    /// condition.
    pub fn kill_when(&self, run: &str, condition: impl Fn(&Path) -> bool) {
        let folder = self.file(run);
        let deadline = Instant::now() + Duration::from_secs(300);
        loop {
            let mut child = spawn(&self.resume(run));
            while child.try_wait().expect("a process").is_none() && !condition(&folder) {
                assert!(Instant::now() < deadline, "the run does not get that far");
                sleep(Duration::from_millis(1));
            }
            child.kill().expect("a process to kill");
            if !child.wait().expect("a process").success() {
                return;
            }
            // It was faster than we looked.
            fs::remove_dir_all(&folder).expect("a run to remove");
        }
    }
}

/// Starts a command in the background.
fn spawn(command: &Command) -> Child {
    let mut process = std::process::Command::new(command.get_program());
    process
        .args(command.get_args())
        .stderr(Stdio::null())
        .stdout(Stdio::null());
    process.spawn().expect("the program under test")
}

/// Files and folders below a folder, by their paths in it, with what is in them.
pub fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut result = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(parent) = folders.pop() {
        for entry in fs::read_dir(&parent).expect("a folder to read") {
            let path = entry.expect("an entry of a folder").path();
            let name = path.strip_prefix(folder).expect("a path below the folder");
            let bytes = match path.is_dir() {
                true => Vec::new(),
                false => fs::read(&path).expect("a file to read"),
            };
            result.insert(name.to_owned(), bytes);
            if path.is_dir() {
                folders.push(path);
            }
        }
    }
    result
}

/// What a run must bring about again: all its files, but of those that hold times only
/// that they are there.
pub fn results(run: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut results = contents(run);
    for name in ["manifest.json", "report.html"] {
        if let Some(content) = results.get_mut(Path::new(name)) {
            content.clear();
        }
    }
    results
}

/// Asserts that two runs came to the same, and names the files that differ.
pub fn assert_same_results(run: &Path, reference: &Path) {
    let (found, expected) = (results(run), results(reference));
    let names: Vec<_> = expected.keys().chain(found.keys()).collect();
    let different: Vec<_> = names
        .into_iter()
        .filter(|name| found.get(*name) != expected.get(*name))
        .collect();
    assert!(different.is_empty(), "{}: {different:?}", run.display());
}

/// The names of the checkpoints of a run, in the order of their steps.
pub fn checkpoints(run: &Path) -> Vec<String> {
    let Ok(entries) = fs::read_dir(run.join("checkpoints")) else {
        return Vec::new();
    };
    let mut names: Vec<String> = entries
        .map(|entry| entry.expect("an entry of a folder").file_name())
        .map(|name| name.to_string_lossy().into_owned())
        .filter(|name| name.starts_with("step-") && name.ends_with(".safetensors"))
        .collect();
    names.sort();
    names
}

/// Copies a folder with all that is in it.
pub fn copy_folder(from: &Path, to: &Path) {
    for (name, bytes) in contents(from) {
        let target = to.join(&name);
        match from.join(&name).is_dir() {
            true => fs::create_dir_all(&target).expect("a folder to make"),
            false => {
                let parent = target.parent().expect("a file in a folder");
                fs::create_dir_all(parent).expect("a folder to make");
                fs::write(&target, bytes).expect("a file to write");
            }
        }
    }
}

/// Cuts a file to the first half.
pub fn truncate(path: &Path) {
    let bytes = fs::read(path).expect("a file to truncate");
    fs::write(path, &bytes[..bytes.len() / 2]).expect("a writable file");
}
