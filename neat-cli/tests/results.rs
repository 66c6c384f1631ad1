//! What happens to results once they are there: exported, looked at, measured, and
//! never replaced by accident. Nothing here trains.

mod support;

use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use support::{neat, stderr, stdout};
use tempfile::TempDir;

/// A temporary folder with a run in it, as far as exports look: a ring of edges of
/// which one is doubtful.
struct TestRun {
    dir: TempDir,
}

impl TestRun {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let run = dir.path().join("run");
        fs::create_dir(&run).unwrap();
        let wireframe = json!({
            "junctions": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]],
            "edges": [[0, 1], [1, 2], [2, 3], [3, 0]],
            "edge_fields": {"probability": [1.0, 1.0, 1.0, 0.5], "supporting_views": [4.0, 4.0, 3.0, 2.0]},
        });
        fs::write(run.join("wireframe.json"), wireframe.to_string()).unwrap();
        for name in [
            "config.toml",
            "wireframe.obj",
            "wireframe.ply",
            "wireframe.png",
        ] {
            fs::write(run.join(name), "of the run").unwrap();
        }
        Self { dir }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn path(&self, name: &str) -> String {
        self.file(name).to_string_lossy().into_owned()
    }

    /// `neat export run ARGUMENTS`, which must be refused; what it says.
    fn refused(&self, arguments: &[&str]) -> String {
        let mut command = neat(&["export", &self.path("run")]);
        stderr(&command.args(arguments).assert().code(2))
    }
}

#[test]
fn an_export_never_replaces_what_it_reads_nor_results_of_the_run() {
    let run = TestRun::new();
    let before = fs::read(run.file("run/wireframe.json")).unwrap();
    for format in ["json", "obj", "ply", "png"] {
        let message = run.refused(&["--format", format]);
        assert!(
            message.contains(&format!("wireframe.{format}")),
            "{message}"
        );
        assert!(message.contains("--out"), "{message}");
    }
    let detour = run.path("run/../run/wireframe.json");
    for filter in [None, Some("--min-probability=0.9")] {
        let mut arguments = vec!["--out", &detour];
        arguments.extend(filter);
        assert!(run.refused(&arguments).contains("is what is exported"));
    }

    neat(&["export", &run.path("run"), "--format", "json"])
        .args(["--min-probability", "0.9"])
        .assert()
        .success();
    let filtered = fs::read(run.file("run/wireframe-filtered.json")).unwrap();
    let filtered: Value = serde_json::from_slice(&filtered).unwrap();
    assert_eq!(filtered["edges"].as_array().unwrap().len(), 3);

    assert_eq!(fs::read(run.file("run/wireframe.json")).unwrap(), before);
    for ending in ["obj", "ply", "png"] {
        let result = fs::read(run.file("run/wireframe").with_extension(ending)).unwrap();
        assert_eq!(result, b"of the run");
    }
}

#[test]
fn an_export_takes_every_probability() {
    let run = TestRun::new();
    let assert = neat(&["export", &run.path("run"), "--format", "dxf"])
        .args(["--min-probability", "0"])
        .assert()
        .success();
    assert!(stdout(&assert).contains("4 edges"));
    assert!(run.file("run/wireframe-filtered.dxf").exists());
    let message = run.refused(&["--format", "dxf", "--min-probability", "1.5"]);
    assert!(message.contains("from 0 to 1"), "{message}");
}

#[test]
fn an_export_refuses_options_without_effect() {
    let run = TestRun::new();
    let cases: [(&[&str], &str); 14] = [
        (
            &["--format", "dxf", "--view", "top"],
            "--view has no meaning for dxf",
        ),
        (
            &["--format", "step", "--width", "800"],
            "--width has no meaning for step",
        ),
        (
            &["--format", "svg", "--unit", "m"],
            "--unit has no meaning for svg",
        ),
        (
            &["--format", "geojson", "--up", "-y"],
            "--up has no meaning for geojson",
        ),
        (
            &["--format", "cityjson", "--up", "north"],
            "possible values: x, y, z, -x, -y, -z",
        ),
        (&["--format", "dxf", "--backend", "flex"], "--backend"),
        (&["--out", "house.dxf", "--backend", "flex"], "--mesh"),
        (&["--format", "dxf", "--no-cache"], "--no-cache"),
        (&["--out", "house.dxf", "--no-cache"], "--mesh"),
        (&["--format", "dxf", "--resolution", "64"], "--resolution"),
        (&["--mesh", "--view", "top"], "--view"),
        (&["--mesh", "--unit", "m"], "--unit"),
        (&["--mesh", "--up", "y"], "--up"),
        (&["--mesh", "--out", "house.obj"], ".ply"),
    ];
    for (arguments, part) in cases {
        let message = run.refused(arguments);
        assert!(message.contains(part), "{arguments:?}: {message}");
    }
    for arguments in [
        ["--format", "svg", "--width", "800"],
        ["--format", "step", "--unit", "m"],
        ["--format", "cityjson", "--up", "-y"],
    ] {
        neat(&["export", &run.path("run")])
            .args(arguments)
            .assert()
            .success();
    }
}

#[cfg(unix)]
#[test]
fn an_export_that_cannot_be_written_has_failed() {
    let run = TestRun::new();
    let assert = neat(&["export", &run.path("run")])
        .args(["--out", &run.path("nowhere/house.dxf")])
        .assert()
        .code(1);
    assert!(stderr(&assert).contains("house.dxf"));
}

#[test]
fn eval_refuses_a_truth_and_a_seed_that_no_protocol_looks_at() {
    let run = TestRun::new();
    let wireframe = run.path("run/wireframe.json");
    let refused = |arguments: &[&str]| {
        let mut command = neat(&["eval", "--pred", &wireframe, "--gt", &wireframe]);
        stderr(&command.args(arguments).assert().code(2))
    };
    let message = refused(&["--seed", "1"]);
    assert!(
        message.contains("--seed has no meaning for neat-abc"),
        "{message}"
    );
    let points = ["--points", "scan.ply"];
    let message = refused(&[&points[..], &["--protocol", "hss"]].concat());
    assert!(
        message.contains("--points has no meaning for hss"),
        "{message}"
    );
    let message = refused(&[&points[..], &["--protocol", "neat-blended-mvs"]].concat());
    assert!(message.contains("--gt has no meaning"), "{message}");
    neat(&["eval", "--pred", &wireframe, "--gt", &wireframe])
        .args(["--protocol", "hss", "--seed", "1"])
        .assert()
        .success();
}

#[test]
fn view_says_where_the_report_is() {
    let run = TestRun::new();
    let view = || neat(&["view", &run.path("run"), "--print-path"]);
    assert!(stderr(&view().assert().code(2)).contains("neat distill"));
    fs::write(run.file("run/report.html"), "").unwrap();
    let printed = stdout(&view().assert().success());
    assert_eq!(printed.trim_end(), run.path("run/report.html"));
}

#[test]
fn an_ablation_leaves_the_folders_of_others_alone() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_string_lossy().into_owned();
    let ablate = |seed: &str| {
        let mut command = neat(&["ablate", &path("scene"), "--out", &path("out")]);
        command.args(["--backend", "flex", "--seed", seed]);
        stderr(&command.assert().code(2))
    };
    let config = dir.path().join("out/base/config.toml");
    fs::create_dir_all(config.parent().unwrap()).unwrap();
    fs::write(&config, "mine").unwrap();
    let message = ablate("0");
    assert!(
        message.contains("choose another folder, or remove it"),
        "{message}"
    );
    assert_eq!(fs::read(&config).unwrap(), b"mine");

    // Without a scene, a request is all that is left; a run then makes it binding.
    fs::remove_dir_all(dir.path().join("out")).unwrap();
    assert!(ablate("0").contains("scene does not exist"));
    assert!(ablate("1").contains("scene does not exist"));
    fs::create_dir(dir.path().join("out/base")).unwrap();
    let message = ablate("0");
    assert!(
        message.contains("a different seed in ablation.json"),
        "{message}"
    );
}
