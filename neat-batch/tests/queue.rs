//! Batches of a program that does what each scene tells it to.
#![cfg(unix)]

use neat_batch::{
    Attempt, Batch, BatchEnd, BatchOptions, Job, JobEvent, JobFolder, JobRecord, JobState, Outcome,
    Retry, StopSwitch, Summary, run,
};
use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Leaves a result; see double.sh.
const GOOD: &str = "finish";

/// A temporary folder with scenes that know what a run of them does, and OUT.
struct Scenes {
    dir: TempDir,
}

impl Scenes {
    fn new(scripts: &[(&str, &str)]) -> Self {
        let scenes = Self {
            dir: tempfile::tempdir().unwrap(),
        };
        for (name, script) in scripts {
            fs::create_dir_all(scenes.scene(name)).unwrap();
            fs::write(scenes.scene(name).join("do.sh"), script).unwrap();
        }
        scenes
    }

    fn scene(&self, name: &str) -> PathBuf {
        self.dir.path().join("scenes").join(name)
    }

    fn out(&self) -> PathBuf {
        self.dir.path().join("out")
    }

    fn batch(&self) -> Batch {
        Batch::from_folders(&[self.scene("*").to_string_lossy().into_owned()]).unwrap()
    }

    fn folder(&self, name: &str) -> JobFolder {
        let batch = self.batch();
        let job = batch.jobs().iter().find(|job| job.name == name).unwrap();
        JobFolder::new(&self.out(), job)
    }

    fn record(&self, name: &str) -> JobRecord {
        self.folder(name).read_record().unwrap().unwrap()
    }

    fn outcomes(&self, name: &str) -> Vec<Outcome> {
        let attempts = self.record(name).attempts.into_iter();
        attempts.map(|attempt: Attempt| attempt.outcome).collect()
    }

    fn log(&self, name: &str) -> String {
        fs::read_to_string(self.out().join(name).join("log.txt")).unwrap()
    }

    /// How often double.sh counted an attempt at this scene.
    fn tried(&self, name: &str) -> usize {
        let text = fs::read_to_string(self.scene(name).join("tried"));
        text.map_or(0, |text| text.lines().count())
    }

    /// Runs all of them.
    fn run(&self) -> (BatchEnd, Vec<(String, JobEvent)>) {
        self.run_with(&self.batch(), &options(), &StopSwitch::default())
    }

    fn run_with(
        &self,
        batch: &Batch,
        options: &BatchOptions,
        stop: &StopSwitch,
    ) -> (BatchEnd, Vec<(String, JobEvent)>) {
        let mut events = Vec::new();
        let end = run(batch, &self.out(), options, stop, &mut |job, event| {
            events.push((job.name.clone(), event));
        });
        (end.unwrap(), events)
    }
}

fn options() -> BatchOptions {
    let double = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/double.sh");
    BatchOptions {
        workers: NonZeroUsize::new(2).unwrap(),
        threads: NonZeroUsize::new(5).unwrap(),
        retry: Retry {
            count: 2,
            first_pause: Duration::from_millis(1),
            longest_pause: Duration::from_millis(2),
        },
        ..BatchOptions::new(double)
    }
}

fn reason(events: &[(String, JobEvent)], name: &str) -> String {
    let mut reasons = events.iter().filter_map(|(job, event)| match event {
        JobEvent::Failed { reason } if job == name => Some(reason.clone()),
        _ => None,
    });
    reasons.next_back().expect("a failure")
}

#[test]
fn every_scene_gets_its_own_folder_and_is_not_run_again() {
    let scenes = Scenes::new(&[("a", GOOD), ("b", GOOD), ("c", GOOD)]);
    let (end, events) = scenes.run();
    assert_eq!((end.finished, end.failed, end.unfinished), (3, 0, 0));
    for name in ["a", "b", "c"] {
        assert_eq!(scenes.record(name).state, JobState::Finished);
        assert_eq!(scenes.outcomes(name), [Outcome::Exited(0)]);
        let log = scenes.log(name);
        let run = scenes.folder(name).run();
        let began = format!(
            "=== attempt 1: reconstruct {} --out {} --resume --threads ",
            scenes.scene(name).display(),
            run.display()
        );
        assert!(log.starts_with(&began), "{log}");
        assert!(log.contains("wireframe: 2 junctions"), "{log}");
        let started = events.iter().any(|(job, event)| {
            job == name
                && matches!(
                    event,
                    JobEvent::Started {
                        attempt: 1,
                        worker: 0 | 1
                    }
                )
        });
        assert!(started, "{events:?}");
    }
    // Five threads for two workers.
    let threads = |count: &str| scenes.log("a").contains(count) || scenes.log("b").contains(count);
    assert!(threads("--threads 3\n") || threads("--threads 2\n"));

    let (end, events) = scenes.run();
    assert_eq!((end.finished, end.skipped), (0, 3));
    assert!(events.iter().all(|(_, event)| *event == JobEvent::Skipped));
    assert_eq!(scenes.outcomes("a").len(), 1);
}

#[test]
fn bad_input_fails_at_once_and_stops_nobody_else() {
    let bad = "count; echo 'error: no such scene' >&2; echo 'hint: look' >&2; exit 2";
    let scenes = Scenes::new(&[("a", bad), ("b", GOOD), ("c", "exit 0")]);
    let (end, events) = scenes.run();
    assert_eq!((end.finished, end.failed), (1, 2));
    assert_eq!(scenes.tried("a"), 1);
    assert_eq!(reason(&events, "a"), "exit code 2: no such scene");
    assert_eq!(scenes.record("a").state, JobState::Failed);
    // A good end without a result is none, and may be a matter of luck.
    assert!(reason(&events, "c").contains("without a wireframe.json"));
    assert_eq!(scenes.outcomes("c").len(), 3);
}

#[test]
fn failures_and_kills_are_tried_again_and_continue() {
    let scenes = Scenes::new(&[
        (
            "a",
            "test $(count) = 3 && finish || { echo 'error: lost' >&2; exit 1; }",
        ),
        ("b", "test $(count) = 2 && finish || kill -KILL $$"),
        ("c", "count; exit 1"),
        // Somebody else's request to end is no end of the job.
        ("d", "test $(count) = 2 && finish || exit 130"),
    ]);
    let (end, events) = scenes.run();
    assert_eq!((end.finished, end.failed), (3, 1));
    let good = Outcome::Exited(0);
    let (lost, killed) = (Outcome::Exited(1), Outcome::Killed(9));
    assert_eq!(
        scenes.outcomes("a"),
        [lost.clone(), lost.clone(), good.clone()]
    );
    assert_eq!(scenes.outcomes("b"), [killed, good.clone()]);
    assert_eq!(scenes.outcomes("c"), [lost.clone(), lost.clone(), lost]);
    assert_eq!(scenes.outcomes("d"), [Outcome::Exited(130), good]);
    let pauses: Vec<u128> = events
        .iter()
        .filter_map(|(name, event)| match event {
            JobEvent::Retrying { pause, .. } if name == "a" => Some(pause.as_millis()),
            _ => None,
        })
        .collect();
    assert_eq!(pauses, [1, 2]);
    // Every call of a batch has its own attempts.
    let (end, _) = scenes.run();
    assert_eq!((end.skipped, end.failed, scenes.tried("c")), (3, 1, 6));
}

#[test]
fn a_program_that_is_not_there_is_named() {
    let scenes = Scenes::new(&[("a", GOOD)]);
    let options = BatchOptions {
        program: "/no/such/neat".into(),
        ..options()
    };
    let (end, events) = scenes.run_with(&scenes.batch(), &options, &StopSwitch::default());
    assert_eq!(end.failed, 1);
    assert!(reason(&events, "a").contains("could not be started"));
}

#[test]
fn a_job_with_other_arguments_is_another_job() {
    let scenes = Scenes::new(&[("a", "count; finish; echo $arguments")]);
    scenes.run();
    let changed = scenes.batch().with_arguments(&["--seed=1".into()]).unwrap();
    let never = StopSwitch::default();
    let (end, events) = scenes.run_with(&changed, &options(), &never);
    assert_eq!((end.failed, scenes.tried("a")), (1, 1));
    let text = reason(&events, "a");
    assert!(text.contains("were none and are now `--seed=1`"), "{text}");
    // What is there is untouched and still known for what it is.
    assert_eq!(scenes.run().0.skipped, 1);
    let summary = Summary::read(&changed, &scenes.out());
    assert!(
        summary.jobs[0]
            .error
            .as_ref()
            .unwrap()
            .contains("of another job")
    );

    let keepsake = scenes.folder("a").run().join("old");
    fs::write(&keepsake, "").unwrap();
    let options = BatchOptions {
        restart_changed: true,
        ..options()
    };
    let (end, _) = scenes.run_with(&changed, &options, &never);
    assert_eq!((end.finished, scenes.tried("a")), (1, 2));
    assert!(!keepsake.exists());
    assert!(scenes.log("a").contains("--seed=1"));
    assert_eq!(scenes.run_with(&changed, &options, &never).0.skipped, 1);
}

/// Runs the batch and asks it to stop, twice with `now`, as soon as a job says that
/// it is ready.
fn run_and_stop(scenes: &Scenes, now: bool) -> BatchEnd {
    let stop = StopSwitch::default();
    let options = BatchOptions {
        workers: NonZeroUsize::MIN,
        ..options()
    };
    let on_event = &mut |_: &Job, event| {
        if matches!(event, JobEvent::Progress { .. }) {
            stop.request();
            if now {
                stop.request();
            }
        }
    };
    run(&scenes.batch(), &scenes.out(), &options, &stop, on_event).unwrap()
}

#[test]
fn a_stop_lets_jobs_save_their_work_and_the_next_batch_goes_on() {
    let slow = "
        test -e $run/checkpoint && { finish; exit; }
        mkdir -p $run
        trap 'touch $run/checkpoint; exit 130' TERM
        echo ready
        while :; do sleep 0.02; done";
    let scenes = Scenes::new(&[("a", slow), ("b", GOOD)]);
    let end = run_and_stop(&scenes, false);
    assert_eq!((end.finished, end.failed, end.unfinished), (0, 0, 2));
    let record = scenes.record("a");
    assert_eq!((record.state, record.error), (JobState::Interrupted, None));
    assert_eq!(scenes.outcomes("a"), [Outcome::Exited(130)]);
    let states = Summary::read(&scenes.batch(), &scenes.out()).totals;
    assert_eq!((states.interrupted, states.pending), (1, 1));
    assert_eq!(scenes.run().0.finished, 2);
    assert_eq!(
        scenes.outcomes("a"),
        [Outcome::Exited(130), Outcome::Exited(0)]
    );
}

#[test]
fn a_second_request_kills_what_does_not_end() {
    let deaf = "trap '' TERM; echo ready; while :; do sleep 0.02; done";
    let scenes = Scenes::new(&[("a", deaf)]);
    assert_eq!(run_and_stop(&scenes, true).unfinished, 1);
    assert_eq!(scenes.outcomes("a"), [Outcome::Killed(9)]);
    assert_eq!(scenes.record("a").state, JobState::Interrupted);
}

#[test]
fn two_batches_share_the_work_and_wait_for_each_other() {
    let slow = "count; sleep 0.3; finish";
    let names: Vec<String> = (0..6).map(|number| format!("s{number}")).collect();
    let scripts: Vec<_> = names.iter().map(|name| (name.as_str(), slow)).collect();
    let scenes = Scenes::new(&scripts);
    let ends = std::thread::scope(|scope| {
        let batches = [(); 2].map(|()| scope.spawn(|| scenes.run().0));
        batches.map(|batch| batch.join().unwrap())
    });
    for end in ends {
        assert_eq!((end.finished + end.skipped, end.failed), (6, 0));
    }
    assert_eq!(ends[0].finished + ends[1].finished, 6);
    assert!(names.iter().all(|name| scenes.tried(name) == 1));
}

#[test]
fn an_orphan_keeps_its_lock_and_leaves_none_behind() {
    let scenes = Scenes::new(&[("a", GOOD)]);
    let folder = scenes.folder("a");
    let lock = folder.lock().unwrap().unwrap();
    let mut orphan = Command::new("sleep")
        .arg("60")
        .stdin(lock.standard_input().unwrap())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    // As if the batch had been killed.
    drop(lock);
    assert!(folder.lock().unwrap().is_none());
    orphan.kill().unwrap();
    orphan.wait().unwrap();
    // A process that another test starts right now has the lock, too, until it runs
    // its program.
    let deadline = Instant::now() + Duration::from_secs(30);
    while folder.lock().unwrap().is_none() {
        assert!(Instant::now() < deadline, "the lock outlives the orphan");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_batch_that_was_killed_is_continued() {
    let scenes = Scenes::new(&[("a", GOOD)]);
    let batch = scenes.batch();
    let folder = scenes.folder("a");
    drop(folder.lock().unwrap());
    let mut record = JobRecord::new(&batch.jobs()[0]);
    record.state = JobState::Running;
    record.attempts.push(Attempt {
        started: 1,
        seconds: 0.0,
        outcome: Outcome::Unknown,
    });
    folder.write_record(&record).unwrap();
    let state = || Summary::read(&batch, &scenes.out()).jobs[0].state;
    assert_eq!(state(), JobState::Interrupted);
    let lock = folder.lock().unwrap();
    assert_eq!(state(), JobState::Running);
    drop(lock);
    scenes.run();
    assert_eq!(scenes.outcomes("a"), [Outcome::Unknown, Outcome::Exited(0)]);
}

#[test]
fn a_damaged_record_fails_its_job_only() {
    let scenes = Scenes::new(&[("a", GOOD), ("b", GOOD)]);
    fs::create_dir_all(scenes.out().join("a")).unwrap();
    fs::write(scenes.out().join("a/job.json"), "{").unwrap();
    let (end, events) = scenes.run();
    assert_eq!((end.finished, end.failed), (1, 1));
    assert!(reason(&events, "a").contains("job.json"));
    let summary = Summary::write(&scenes.batch(), &scenes.out()).unwrap();
    assert!(summary.jobs[0].error.as_ref().unwrap().contains("job.json"));
}

#[test]
fn the_summary_has_the_results_of_all_shards_and_measures_them() {
    let scenes = Scenes::new(&[
        ("a", GOOD),
        ("b", "finish '[[0, 0, 0], [2, 0, 0]]'"),
        ("c", GOOD),
    ]);
    let truth = r#"{"junctions": [[0, 0, 0], [2, 0, 0]], "lines": [[0, 1]]}"#;
    for name in ["a", "b"] {
        fs::write(scenes.scene(name).join("gt_wireframe.json"), truth).unwrap();
    }
    let batch = scenes.batch();
    let never = StopSwitch::default();
    for shard in ["1/2", "2/2"] {
        let part = batch.shard(shard.parse().unwrap());
        scenes.run_with(&part, &options(), &never);
        Summary::write(&batch, &scenes.out()).unwrap();
        let done = Summary::read(&batch, &scenes.out()).totals.finished;
        assert_eq!(done, if shard == "1/2" { 2 } else { 3 });
    }
    let text = fs::read(scenes.out().join("summary.json")).unwrap();
    let summary: Summary = serde_json::from_slice(&text).unwrap();
    assert!(summary.is_finished());
    let figures = |position: usize| summary.jobs[position].figures.clone().unwrap();
    assert_eq!(
        (figures(0).junctions, figures(0).edges, figures(0).steps),
        (2, 1, 7)
    );
    assert_eq!(figures(0).warnings, ["a warning"]);
    assert_eq!(figures(2).evaluation, None);
    let means = summary.totals.means;
    assert_eq!(
        (means.junction_recall, means.segment_recall),
        (Some(0.75), Some(0.5))
    );
    assert_eq!(means.explained_length_share, Some(0.5));
    let markdown = fs::read_to_string(scenes.out().join("summary.md")).unwrap();
    assert!(markdown.starts_with("3 of 3 jobs finished\n"), "{markdown}");
    assert!(
        fs::read_to_string(scenes.out().join("summary.csv"))
            .unwrap()
            .lines()
            .count()
            == 4
    );
}

#[test]
fn runs_that_no_batch_has_made_are_summed_up_as_well() {
    let scenes = Scenes::new(&[("a", GOOD), ("b", GOOD)]);
    scenes.run();
    fs::remove_file(scenes.out().join("a/job.json")).unwrap();
    fs::remove_dir_all(scenes.out().join("b")).unwrap();
    let summary = Summary::read(&scenes.batch(), &scenes.out());
    let first = &summary.jobs[0];
    assert_eq!(
        (first.state, first.attempts, first.seconds),
        (JobState::Finished, 0, 2.0)
    );
    assert_eq!(first.figures.as_ref().map(|figures| figures.edges), Some(1));
    assert_eq!(summary.jobs[1].state, JobState::Pending);
}
