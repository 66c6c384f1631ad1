//! Damaged files of a run folder: checkpoints, configuration, manifest and logs are
//! read or refused, and nothing else.

#[path = "../../neat-core/src/mutation.rs"]
mod mutation;

use burn::tensor::TensorData;
use mutation::{CASES, damaged};
use neat_pipeline::config::Preset;
use neat_pipeline::manifest::{Manifest, Status, utc_now};
use neat_pipeline::run_dir::{Existing, RunDir, RunDirError};
use neat_tensor::checkpoint::{Checkpoint, CheckpointError};
use neat_train::step_log::{JunctionsLine, read_log};
use proptest::prelude::*;
use proptest::test_runner::{TestCaseResult, TestRunner};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

fn checkpoint() -> Checkpoint {
    let mut checkpoint = Checkpoint::default();
    let weights = TensorData::new(vec![1.0_f32, -2.5, 3.0, 1e-30, 0.0, 7.0], [2, 3]);
    checkpoint.tensors.insert("layer.weight".into(), weights);
    let bias = TensorData::new(vec![0.5_f32], [1]);
    checkpoint.tensors.insert("layer.bias".into(), bias);
    checkpoint.metadata.insert("iteration".into(), "12".into());
    checkpoint
}

/// A folder with the files of a run, but for its results.
fn run() -> (TempDir, RunDir) {
    let folder = tempfile::tempdir().unwrap();
    let (run, _lock) = RunDir::create(folder.path(), Existing::Refuse).unwrap();
    run.write_config(&Preset::Fast.config()).unwrap();
    let manifest = Manifest {
        neat: "0.1.0".into(),
        compiler: "rustc".into(),
        target: "x86_64".into(),
        command_line: vec!["neat".into(), "reconstruct".into()],
        preset: "fast".into(),
        backend: "flex".into(),
        device: "CPU".into(),
        threads: 2,
        seed: 0,
        scene: "scene".into(),
        sphere: None,
        inputs: [("cameras.npz".to_owned(), "ab12".to_owned())].into(),
        decisions: Vec::new(),
        warnings: Vec::new(),
        status: Status::Interrupted,
        steps: 12,
        started: utc_now(),
        updated: utc_now(),
        seconds: Default::default(),
    };
    run.write_manifest(&manifest).unwrap();
    let line = r#"{"iteration": 3, "junctions": [[0.5, -1.0, 2.0]]}"#;
    fs::write(run.junctions(), format!("{line}\n{line}\n")).unwrap();
    (folder, run)
}

/// Puts damaged versions of a file in its place, and back what it was.
fn damage(path: &Path, cases: u32, mut read: impl FnMut(&[u8]) -> TestCaseResult) {
    let whole = fs::read(path).unwrap();
    let mut runner = TestRunner::new(ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    });
    let read = std::cell::RefCell::new(&mut read);
    let outcome = runner.run(&damaged(whole.clone()), |bytes| {
        fs::write(path, &bytes).unwrap();
        (read.borrow_mut())(&bytes)
    });
    assert_eq!(outcome, Ok(()));
    fs::write(path, whole).unwrap();
}

#[test]
fn damaged_checkpoints_are_refused_or_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("step-00000012.safetensors");
    checkpoint().write(&path).unwrap();
    damage(&path, CASES / 2, |bytes| {
        match Checkpoint::read(&path) {
            Ok(read) => {
                let numbers = read.tensors.values().map(|data| data.num_elements());
                prop_assert!(4 * numbers.sum::<usize>() <= bytes.len());
            }
            Err(CheckpointError::Damaged { .. }) => {}
            Err(other) => return Err(TestCaseError::fail(other.to_string())),
        }
        Ok(())
    });
    assert_eq!(
        Checkpoint::read(&path).unwrap().metadata,
        checkpoint().metadata
    );
}

#[test]
fn headers_of_checkpoints_are_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.safetensors");
    let file = |length: u64, header: &str| [&length.to_le_bytes(), header.as_bytes()].concat();
    let tensor = |shape: &str, end: &str| {
        let header =
            format!(r#"{{"a":{{"dtype":"F32","shape":{shape},"data_offsets":[0,{end}]}}}}"#);
        file(header.len() as u64, &header)
    };
    for bytes in [
        file(u64::MAX, "{}"),
        file(1 << 40, "{}"),
        file(99_999_999, "{}"),
        tensor("[4611686018427387904,4]", "0"),
        tensor("[4294967296,4294967296]", "0"),
        tensor("[1000000000000]", "4000000000000"),
        tensor("[2]", "18446744073709551615"),
        tensor("[-1]", "4"),
        file(1 << 20, &"[".repeat(1 << 20)),
    ] {
        fs::write(&path, &bytes).unwrap();
        let error = Checkpoint::read(&path).unwrap_err();
        assert!(matches!(error, CheckpointError::Damaged { .. }), "{error}");
        assert!(error.to_string().contains("a.safetensors"), "{error}");
    }
}

#[test]
fn damaged_configurations_and_manifests_are_named() {
    let (folder, run) = run();
    let good = (run.config().unwrap(), run.manifest().unwrap());
    // Unreadable, or another value in the place of one.
    let check = |result: Option<RunDirError>, name: &str| {
        let named = result.is_none_or(|error| error.to_string().contains(name));
        prop_assert!(named);
        Ok(())
    };
    damage(&folder.path().join("config.toml"), CASES / 10, |_| {
        check(run.config().err(), "config.toml")
    });
    damage(&folder.path().join("manifest.json"), CASES / 10, |_| {
        check(run.manifest().err(), "manifest.json")
    });
    assert_eq!((run.config().unwrap(), run.manifest().unwrap()), good);
    // Nesting that would exhaust the stack of a parser without a limit.
    for (open, close) in [("[", "]"), ("{a=", "}")] {
        let text = format!("a = {}0{}", open.repeat(200_000), close.repeat(200_000));
        fs::write(folder.path().join("config.toml"), text).unwrap();
        assert!(
            run.config()
                .unwrap_err()
                .to_string()
                .contains("config.toml")
        );
    }
    fs::write(folder.path().join("manifest.json"), "[".repeat(1 << 20)).unwrap();
    assert!(
        run.manifest()
            .unwrap_err()
            .to_string()
            .contains("manifest.json")
    );
}

#[test]
fn damaged_lines_of_logs_are_passed_over() {
    let (_folder, run) = run();
    damage(&run.junctions(), CASES / 10, |bytes| {
        let lines: Vec<JunctionsLine> = read_log(&run.junctions()).unwrap();
        prop_assert!(lines.len() <= 1 + bytes.iter().filter(|byte| **byte == b'\n').count());
        Ok(())
    });
    let lines: Vec<JunctionsLine> = read_log(&run.junctions()).unwrap();
    assert_eq!(lines.len(), 2);
}
