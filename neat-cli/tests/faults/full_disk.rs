//! A disk that is full at each write of a run in turn.

use crate::disk::{Disk, PAGE};
use crate::support::{TestScene, assert_same_results, checkpoints, contents, neat, stderr};
use assert_cmd::Command;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Four steps and a checkpoint after every second: no checkpoint is removed, so that
/// the run needs more and more space.
fn reconstruct(scene: &TestScene, run: &str) -> Command {
    let mut neat = neat(&["reconstruct", &scene.path("scene")]);
    neat.args(["--out", &scene.path(run), "--resume", "--quiet", "--train"])
        .args(["--backend", "flex", "--steps", "4"])
        .args(["--set", "train.checkpoint_interval=2"]);
    neat
}

/// The file that an error is about, by its path in the run.
fn named_file(message: &str, run: &Path) -> PathBuf {
    let folder = format!("{}/", run.display());
    let (_, rest) = message.split_once(&folder).unwrap_or_else(|| {
        panic!("no file of the run is named: {message}");
    });
    let end = rest.find([':', ' ', ')']).unwrap_or(rest.len());
    rest[..end].trim_end().into()
}

/// Every file is as in the reference; logs are so as far as they go, and a manifest
/// is whole.
fn assert_no_half_file(run: &Path, reference: &Path) {
    for (name, bytes) in contents(run) {
        let expected = fs::read(reference.join(&name)).unwrap_or_default();
        match name.to_str().unwrap() {
            "manifest.json" => {
                serde_json::from_slice::<serde_json::Value>(&bytes).unwrap();
            }
            "report.html" => assert!(bytes.ends_with(b"</html>\n"), "{name:?} is not whole"),
            "metrics.jsonl" | "junctions.jsonl" => {
                assert!(expected.starts_with(&bytes), "{name:?} has other lines");
            }
            _ => assert!(bytes == expected, "{name:?} is not whole"),
        }
    }
}

#[test]
fn a_full_disk_at_any_write_is_reported_and_loses_nothing() {
    let scene = TestScene::new();
    let reference = scene.file("reference");
    reconstruct(&scene, "reference").assert().success();
    let Some(disk) = Disk::mount(scene.file("disk")) else {
        return;
    };
    let run = disk.path().join("run");

    let mut size = PAGE;
    let mut full_at = BTreeSet::new();
    loop {
        disk.resize(size);
        let assert = reconstruct(&scene, "disk/run").assert();
        if assert.get_output().status.success() {
            break;
        }
        let message = stderr(&assert.code(1));
        let errors = message.matches("error: ").count();
        assert_eq!(errors, 1, "{size} bytes: {message}");
        assert!(message.contains("No space left"), "{message}");
        let file = named_file(&message, &run);
        assert_no_half_file(&run, &reference);
        // Larger disks than those that were full at a checkpoint have space for it.
        let earlier = full_at
            .iter()
            .filter(|path: &&PathBuf| path.starts_with("checkpoints"));
        let earlier = earlier.count();
        assert!(
            checkpoints(&run).len() >= earlier,
            "{file:?}: a checkpoint is lost"
        );
        // The file that had no space gets just as much, the next one none.
        let needed = fs::metadata(reference.join(&file)).map_or(PAGE, |file| file.len());
        let needed = match file.extension() {
            Some(extension) if extension == "jsonl" => PAGE,
            _ => needed.next_multiple_of(PAGE),
        };
        let next = (disk.used() + needed).max(size + PAGE);
        full_at.insert(file);

        disk.make_roomy();
        reconstruct(&scene, "disk/run").assert().success();
        assert_same_results(&run, &reference);
        fs::remove_dir_all(&run).unwrap();
        size = next;
    }
    assert_same_results(&run, &reference);

    let full_at: Vec<&str> = full_at.iter().map(|path| path.to_str().unwrap()).collect();
    for file in [
        "config.toml",
        "plan.toml",
        "manifest.json",
        "metrics.jsonl",
        "junctions.jsonl",
        "checkpoints/step-00000002.safetensors",
        "checkpoints/step-00000004.safetensors",
        "wireframe.json",
        "wireframe.png",
        // Overlays are written side by side: any of them may be the one.
        "overlays/",
        "report.html",
    ] {
        // The smallest disk has a page for the first file, and where the manifest is
        // written anew its old pages are there for the next.
        let path = reference.join(file);
        let has_space = ["plan.toml", "wireframe.json"].contains(&file)
            && fs::metadata(&path).unwrap().len() <= PAGE;
        assert!(
            has_space || full_at.iter().any(|path| path.starts_with(file)),
            "{file} always had space: {full_at:?}"
        );
    }
}
