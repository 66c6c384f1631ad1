//! Checkpoints that are cut off, changed, or something else.

use crate::support::{TestScene, assert_same_results, checkpoints, contents, copy_folder, stderr};
use std::fs;
use std::path::Path;

/// A way to damage a checkpoint.
type Damage = fn(&Path);

fn cut(path: &Path, length: impl FnOnce(usize) -> usize) {
    let bytes = fs::read(path).unwrap();
    fs::write(path, &bytes[..length(bytes.len())]).unwrap();
}

fn flip_bit(path: &Path, index: impl FnOnce(usize) -> usize) {
    let mut bytes = fs::read(path).unwrap();
    let index = index(bytes.len());
    bytes[index] ^= 0x10;
    fs::write(path, bytes).unwrap();
}

const DAMAGES: [(&str, Damage); 9] = [
    ("empty", |path| cut(path, |_| 0)),
    ("cut in the length of the header", |path| cut(path, |_| 5)),
    ("cut in the header", |path| cut(path, |_| 100)),
    ("cut in the middle", |path| cut(path, |length| length / 2)),
    ("cut by a byte", |path| cut(path, |length| length - 1)),
    ("a bit of the header", |path| flip_bit(path, |_| 50)),
    ("a bit of the tensors", |path| {
        flip_bit(path, |length| length * 3 / 4)
    }),
    ("zeros, as after the power went", |path| {
        let length = fs::metadata(path).unwrap().len();
        fs::write(path, vec![0; length as usize]).unwrap();
    }),
    ("a folder of that name", |path| {
        fs::remove_file(path).unwrap();
        fs::create_dir(path).unwrap();
    }),
];

#[test]
fn the_checkpoint_before_a_damaged_one_is_used() {
    let scene = TestScene::new();
    scene.resume("reference").assert().success();
    scene.kill_when("killed", |run| checkpoints(run).len() >= 2);
    let names = checkpoints(&scene.file("killed"));
    let last = names.last().unwrap();
    for (what, damage) in DAMAGES {
        let run = scene.file("run");
        copy_folder(&scene.file("killed"), &run);
        damage(&run.join("checkpoints").join(last));
        let message = stderr(&scene.resume("run").arg("--quiet").assert().success());
        assert!(message.starts_with("warning: "), "{what}: {message}");
        assert!(message.contains(last.as_str()), "{what}: {message}");
        // What was damaged stays for a look at it, under another name.
        for entry in fs::read_dir(run.join("checkpoints")).unwrap() {
            let path = entry.unwrap().path();
            if path.to_string_lossy().ends_with(".damaged") {
                fs::remove_file(&path)
                    .or_else(|_| fs::remove_dir(&path))
                    .unwrap();
            }
        }
        assert_same_results(&run, &scene.file("reference"));
        fs::remove_dir_all(run).unwrap();
    }
}

#[test]
fn without_any_usable_checkpoint_nothing_is_begun_anew_by_itself() {
    let scene = TestScene::new();
    scene.kill_when("run", |run| checkpoints(run).len() >= 2);
    let run = scene.file("run");
    for name in checkpoints(&run) {
        cut(&run.join("checkpoints").join(name), |length| length / 2);
    }
    let before = contents(&run);
    let message = stderr(&scene.resume("run").arg("--quiet").assert().code(2));
    assert!(message.contains("none of the checkpoints"), "{message}");
    assert!(message.contains("--overwrite"), "{message}");
    let lost: Vec<_> = before
        .iter()
        .filter(|(name, bytes)| {
            name.starts_with("checkpoints") && contents(&run).get(*name) != Some(bytes)
        })
        .collect();
    assert!(lost.is_empty(), "checkpoints were changed");
}
