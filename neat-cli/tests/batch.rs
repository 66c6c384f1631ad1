//! Many scenes: `neat batch` with the real program, tiny scenes, and trouble.
#![cfg(unix)]

mod support;

use neat_batch::{JobRecord, JobState, Outcome, Summary};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use support::{neat, stderr, stdout};
use tempfile::TempDir;

/// A temporary folder with tiny scenes, `scenes/NAME`.
struct Scenes {
    dir: TempDir,
}

impl Scenes {
    fn new(solids: &[&str]) -> Self {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let scenes = Self { dir };
        for solid in solids {
            neat(&["synth", "--out", &scenes.text(&format!("scenes/{solid}"))])
                .args(["--solid", solid, "--views", "8", "--image-size", "48"])
                .args(["--detection-rate", "1"])
                .assert()
                .success();
        }
        scenes
    }

    fn file(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.file(name).to_string_lossy().into_owned()
    }

    /// `neat batch 'scenes/*' --out out` with few steps, and options of the batch.
    fn batch(&self, options: &[&str], steps: &str) -> assert_cmd::Command {
        let mut command = neat(&["batch", &self.text("scenes/*"), "--out", &self.text("out")]);
        command.args(options).args(method(steps));
        // Whatever the machine of the test belongs to.
        for name in ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX", "NEAT_SHARDS"] {
            command.env_remove(name);
        }
        command
    }

    /// The same in the background.
    fn spawn(&self, options: &[&str], steps: &str) -> Child {
        std::process::Command::new(env!("CARGO_BIN_EXE_neat"))
            .args(["batch", &self.text("scenes/*"), "--out", &self.text("out")])
            .args(options)
            .args(method(steps))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap()
    }

    /// The result of `neat reconstruct` alone.
    fn single(&self, name: &str, steps: &str) -> Vec<u8> {
        let run = self.text(&format!("single/{name}"));
        neat(&[
            "reconstruct",
            &self.text(&format!("scenes/{name}")),
            "--out",
            &run,
        ])
        .args(&method(steps)[1..])
        .assert()
        .success();
        fs::read(Path::new(&run).join("wireframe.json")).unwrap()
    }

    fn result(&self, name: &str) -> Vec<u8> {
        fs::read(self.file(&format!("out/{name}/run/wireframe.json"))).unwrap()
    }

    fn record(&self, name: &str) -> JobRecord {
        let text = fs::read(self.file(&format!("out/{name}/job.json"))).unwrap();
        serde_json::from_slice(&text).unwrap()
    }

    fn summary(&self) -> Summary {
        serde_json::from_slice(&fs::read(self.file("out/summary.json")).unwrap()).unwrap()
    }

    fn wait_until_it_trains(&self, name: &str) {
        let metrics = self.file(&format!("out/{name}/run/metrics.jsonl"));
        let deadline = Instant::now() + Duration::from_secs(300);
        while !fs::metadata(&metrics).is_ok_and(|file| file.len() > 0) {
            assert!(Instant::now() < deadline, "no step was done");
            sleep(Duration::from_millis(20));
        }
    }
}

/// Arguments for every scene.
fn method(steps: &str) -> [&str; 7] {
    [
        "--",
        "--train",
        "--backend",
        "flex",
        "--no-cache",
        "--steps",
        steps,
    ]
}

fn signal(name: &str, process: u32) {
    let status = std::process::Command::new("kill")
        .args([name, &process.to_string()])
        .status()
        .unwrap();
    assert!(status.success());
}

#[test]
fn two_workers_give_the_bytes_of_single_runs_past_a_scene_that_fails() {
    let scenes = Scenes::new(&["box", "l-prism", "wedge"]);
    fs::create_dir(scenes.file("scenes/empty")).unwrap();
    let assert = scenes.batch(&["--workers", "2"], "20").assert().code(1);
    let said = stderr(&assert);
    assert!(said.contains("empty: failed: exit code 2: "), "{said}");
    assert!(said.contains("1 of 4 jobs are not finished"), "{said}");
    assert!(stdout(&assert).starts_with("3 of 4 jobs finished, 1 failed\n"));
    // Bad input is not worth another attempt.
    assert_eq!(scenes.record("empty").attempts.len(), 1);
    for name in ["box", "l-prism", "wedge"] {
        assert!(scenes.result(name) == scenes.single(name, "20"), "{name}");
    }
    let summary = scenes.summary();
    let figures = summary.jobs[0].figures.as_ref().unwrap();
    assert!(figures.evaluation.is_some(), "the scene has its truth");
    assert_eq!((figures.steps, figures.backend.as_str()), (20, "flex"));

    fs::remove_dir(scenes.file("scenes/empty")).unwrap();
    let assert = scenes.batch(&["--workers", "2"], "20").assert().success();
    assert_eq!(stderr(&assert).matches(": finished before\n").count(), 3);
    assert_eq!(scenes.record("box").attempts.len(), 1);

    // Other arguments would give another result: it is not passed off as that.
    let assert = scenes.batch(&[], "21").assert().code(1);
    let said = stderr(&assert);
    assert!(said.contains("--steps 20` and are now"), "{said}");
    assert!(said.contains("--restart-changed"), "{said}");
}

/// The only child of a process.
#[cfg(target_os = "linux")]
fn child_of(process: u32) -> Option<u32> {
    let parent = format!("PPid:\t{process}\n");
    let mut processes = fs::read_dir("/proc").unwrap().filter_map(|entry| {
        let name = entry.ok()?.file_name();
        let id: u32 = name.to_str()?.parse().ok()?;
        let status = fs::read_to_string(format!("/proc/{id}/status")).ok()?;
        status.contains(&parent).then_some(id)
    });
    processes.next()
}

#[test]
#[cfg(target_os = "linux")]
fn a_scene_that_is_killed_is_tried_again_and_finishes() {
    let scenes = Scenes::new(&["box"]);
    let mut batch = scenes.spawn(&["--retry-pause", "1s"], "300");
    scenes.wait_until_it_trains("box");
    signal("-KILL", child_of(batch.id()).expect("a child"));
    assert_eq!(batch.wait().unwrap().code(), Some(0));
    let record = scenes.record("box");
    let outcomes: Vec<&Outcome> = record.attempts.iter().map(|a| &a.outcome).collect();
    assert_eq!(outcomes, [&Outcome::Killed(9), &Outcome::Exited(0)]);
    assert!(scenes.result("box") == scenes.single("box", "300"));
}

#[test]
fn a_request_to_terminate_saves_the_work_and_the_same_command_goes_on() {
    let scenes = Scenes::new(&["box", "wedge"]);
    let mut batch = scenes.spawn(&[], "300");
    scenes.wait_until_it_trains("box");
    signal("-TERM", batch.id());
    assert_eq!(batch.wait().unwrap().code(), Some(130));
    let record = scenes.record("box");
    assert_eq!(record.state, JobState::Interrupted);
    assert_eq!(record.attempts[0].outcome, Outcome::Exited(130));
    let totals = scenes.summary().totals;
    assert_eq!((totals.interrupted, totals.pending), (1, 1));

    scenes.batch(&[], "300").assert().success();
    assert!(scenes.result("box") == scenes.single("box", "300"));
    assert!(scenes.summary().is_finished());
}

#[test]
fn shards_share_the_jobs_and_their_results_are_summed_up() {
    let scenes = Scenes::new(&["box", "l-prism", "wedge"]);
    let finished = || scenes.summary().totals.finished;
    scenes.batch(&["--shard", "1/2"], "3").assert().success();
    assert_eq!(finished(), 2);
    assert!(!scenes.file("out/l-prism").exists());
    scenes.batch(&["--summary-only"], "3").assert().code(1);
    // As the second of two tasks of a cluster.
    let mut second = scenes.batch(&[], "3");
    second
        .env("JOB_COMPLETION_INDEX", "1")
        .env("NEAT_SHARDS", "2");
    let said = stderr(&second.assert().success());
    assert!(
        said.contains("shard 2/2, by JOB_COMPLETION_INDEX: 1 of 3 jobs"),
        "{said}"
    );
    assert_eq!(finished(), 3);
    let assert = scenes.batch(&["--summary-only"], "3").assert().success();
    assert!(stdout(&assert).starts_with("3 of 3 jobs finished\n"));

    let mut unclear = scenes.batch(&[], "3");
    unclear.env("JOB_COMPLETION_INDEX", "2");
    let said = stderr(&unclear.assert().code(2));
    assert!(said.contains("NEAT_SHARDS is not"), "{said}");
}

#[test]
fn mistakes_are_found_before_anything_is_run() {
    let scenes = Scenes::new(&["box"]);
    let manifest = scenes.text("jobs.toml");
    for (text, parts) in [
        (
            "[[job]]\nscene = \"scenes/box\"\nsteps = 3\n",
            ["line 3", "steps"],
        ),
        (
            "[[job]]\nscene = \"scenes/box\"\nseed = \"x\"\n",
            ["line 3", "string"],
        ),
        (
            "[[job]]\nscene = \"a/x\"\n[[job]]\nscene = \"b/x\"\n",
            ["line 3", "`name`"],
        ),
        (
            "[[job]]\nscene = \"a\"\nargs = [\"--out\", \"b\"]\n",
            ["line 1", "--out"],
        ),
        (
            "[[job]]\nscene = \"a\"\npreset = \"none\"\n",
            ["job `a`", "none"],
        ),
        (
            "[[job]]\nscene = \"a\"\nargs = [\"--sped\"]\n",
            ["job `a`", "--sped"],
        ),
        (
            "[[job]]\nscene = \"a\"\nset = [\"train.stepz=3\"]\n",
            ["job `a`", "`train.steps`"],
        ),
        (
            "[[job]]\nscene = \"a\"\nconfig = \"no.toml\"\n",
            ["job `a`", "no.toml"],
        ),
        ("# nothing\n", ["jobs.toml", "[[job]]"]),
    ] {
        fs::write(&manifest, text).unwrap();
        let assert = neat(&["batch", &manifest, "--out", &scenes.text("out")])
            .assert()
            .code(2);
        let said = stderr(&assert);
        assert!(parts.iter().all(|part| said.contains(part)), "{text}{said}");
    }
    let none = scenes.text("none-*");
    for inputs in [
        vec![none.as_str()],
        vec!["missing.toml"],
        vec!["a.toml", "b"],
    ] {
        let out = scenes.text("out");
        neat(&["batch", "--out", &out])
            .args(inputs)
            .assert()
            .code(2);
    }
    scenes.batch(&["--shard", "3/2"], "3").assert().code(2);

    let assert = scenes.batch(&["--dry-run"], "3").assert().success();
    let said = stdout(&assert);
    assert!(said.starts_with("box: neat reconstruct "), "{said}");
    assert!(
        said.contains(" --resume --train --backend flex --no-cache --steps 3"),
        "{said}"
    );
    assert!(!scenes.file("out").exists());
}
