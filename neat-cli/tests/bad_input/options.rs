//! Options and configurations that make no sense.

use crate::case::{Case, check};
use crate::support::TestScene;
use std::fs;

/// A case whose scene is as it should be.
const fn option(kind: &'static str, command: &'static str, names: &'static [&'static str]) -> Case {
    Case {
        kind,
        spoil: |_| (),
        command,
        names,
    }
}

fn configuration(scene: &TestScene, text: &str) {
    fs::write(scene.file("config.toml"), text).unwrap();
}

#[test]
fn options_of_runs() {
    check(
        "options",
        &[
            option(
                "an unknown command",
                "reconstrukt scene --out run",
                &["'reconstrukt'", "'reconstruct'"],
            ),
            option(
                "an unknown preset",
                "train scene --out run --preset fats",
                &["'fats'", "fast"],
            ),
            option(
                "an unknown backend",
                "train scene --out run --backend cuda",
                &["'cuda'", "wgpu"],
            ),
            option(
                "an unknown key of the configuration",
                "train scene --out run --set train.stepz=1",
                &["`train.stepz`", "`train.steps`"],
            ),
            option(
                "a word where a number is expected",
                "train scene --out run --set train.rays=many",
                &["`train.rays`", "`many`"],
            ),
            option(
                "a key without a value",
                "train scene --out run --set train.rays",
                &["train.rays", "key.path=value"],
            ),
            option(
                "a value that is not finite",
                "train scene --out run --set train.learning_rate=nan",
                &["`train.learning_rate`", "`nan`", "finite"],
            ),
            option(
                "a value out of range",
                "train scene --out run --backend flex --set train.rays=0",
                &["train.rays", "positive"],
            ),
            option(
                "more rays than any machine holds",
                "train scene --out run --backend flex --set train.rays=100000000000",
                &["train.rays", "the most that neat takes is 67108864"],
            ),
            option(
                "no steps",
                "train scene --out run --steps 0",
                &["'0'", "--steps"],
            ),
            option(
                "two numbers of steps",
                "train scene --out run --steps 50 --set train.steps=100",
                &["--steps 50", "train.steps=100", "give one of them"],
            ),
            option(
                "two detectors",
                "train scene --out run --detector own --set detect.detector=mlsd",
                &[
                    "--detector own",
                    "--set detect.detector=mlsd",
                    "give one of them",
                ],
            ),
            option(
                "two detectors for a folder",
                "detect scene/images --out run --detector mlsd --set detector=own",
                &[
                    "--detector mlsd",
                    "--set detect.detector=own",
                    "give one of them",
                ],
            ),
            option(
                "two numbers of views",
                "train scene --out run --max-views 4 --set data.max_views=5",
                &[
                    "--max-views 4",
                    "--set data.max_views=5",
                    "give one of them",
                ],
            ),
            option(
                "a field, and none",
                "reconstruct scene --out run --train --set distill.field=none",
                &["--train", "--set distill.field=none", "give one of them"],
            ),
            option(
                "a time that is none",
                "train scene --out run --time-budget soon",
                &["'soon'", "10m"],
            ),
            option(
                "a scene sphere that is none",
                "train scene --out run --scene-sphere 1,2,x",
                &["'1,2,x'", "x,y,z,radius"],
            ),
            option(
                "a single view",
                "train scene --out run --max-views 1",
                &["'1'", "--max-views"],
            ),
            option(
                "options that contradict each other",
                "train scene --out run --resume --overwrite",
                &["--resume", "--overwrite", "cannot be used with"],
            ),
            option(
                "no file of configuration",
                "train scene --out run --config no.toml",
                &["no.toml", "does not exist"],
            ),
            Case {
                kind: "an unknown key in a file of configuration",
                spoil: |scene| configuration(scene, "[train]\nstepz = 3\n"),
                command: "train scene --out run --config config.toml",
                names: &["config.toml", "line 2", "`stepz`", "`steps`"],
            },
            Case {
                kind: "a file of configuration that ends early",
                spoil: |scene| configuration(scene, "[train]\nsteps = [\n"),
                command: "train scene --out run --config config.toml",
                names: &["config.toml", "line 2", "unclosed"],
            },
        ],
    );
}

#[test]
fn options_of_benchmarks() {
    check(
        "benchmarks",
        &[
            option(
                "an unknown preset among others",
                "bench --preset fast,papper-abc",
                &["'papper-abc'", "paper-abc"],
            ),
            option(
                "an unknown backend",
                "bench --backend cuda",
                &["'cuda'", "wgpu"],
            ),
            option("no time", "bench --seconds 0", &["'0'", "above 0"]),
            option(
                "infinite time",
                "bench --seconds inf",
                &["'inf'", "above 0"],
            ),
            option(
                "a time that is no number",
                "bench --seconds soon",
                &["'soon'", "above 0"],
            ),
        ],
    );
}

#[test]
fn options_of_synthetic_scenes() {
    check(
        "synthetic scenes",
        &[
            option("no views", "synth --out new --views 0", &["views"]),
            option(
                "cameras inside the object",
                "synth --out new --distance 0.1",
                &["camera_distance"],
            ),
            option(
                "noise that is no number",
                "synth --out new --noise nan",
                &["noise_in_pixels"],
            ),
            option(
                "a share above 1",
                "synth --out new --detection-rate 2",
                &["detection_rate"],
            ),
            option(
                "a folder with files in it",
                "synth --out scene",
                &["scene is not empty", "choose another folder"],
            ),
        ],
    );
}
