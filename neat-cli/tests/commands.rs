//! Every command on a tiny scene: the files it leaves, and what it prints.

mod support;

use neat_core::ground_truth::read_wireframe;
use serde_json::Value;
use std::fs;
use std::path::Path;
use support::{TestScene, neat, stderr, stdout, truncate};

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn reconstruct_leaves_every_result() {
    let scene = TestScene::new();
    let assert = scene.run("reconstruct", "2").assert().success();
    assert!(stdout(&assert).contains("wireframe.json"));

    let run = scene.file("run");
    let read = |name: &str| -> toml::Table {
        let text = fs::read_to_string(run.join(name)).unwrap();
        text.parse().unwrap()
    };
    let (asked, plan) = (read("config.toml"), read("plan.toml"));
    for config in [&asked, &plan] {
        assert_eq!(config["train"]["steps"].as_integer(), Some(2));
    }
    assert_eq!(asked["data"]["background"].as_str(), Some("auto"));
    assert_eq!(plan["data"]["background"].as_str(), Some("black"));
    let manifest = json(&run.join("manifest.json"));
    assert_eq!(manifest["status"], "finished");
    assert_eq!(manifest["steps"], 2);
    assert_eq!(manifest["backend"], "flex");
    // One file of cameras, and an image and a wireframe per view.
    assert_eq!(manifest["inputs"].as_object().unwrap().len(), 17);
    let metrics = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    let lines: Vec<Value> = metrics
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 2);
    assert!(lines[1]["losses"]["total"].is_number());
    assert!(run.join("checkpoints/step-00000002.safetensors").exists());

    let wireframe = read_wireframe(&run.join("wireframe.json")).unwrap();
    let obj = fs::read_to_string(run.join("wireframe.obj")).unwrap();
    let vertices = obj.lines().filter(|line| line.starts_with("v ")).count();
    let edges = obj.lines().filter(|line| line.starts_with("l ")).count();
    assert_eq!(
        (vertices, edges),
        (wireframe.junctions.len(), wireframe.edges.len())
    );
    let ply = fs::read_to_string(run.join("wireframe.ply")).unwrap();
    assert!(ply.contains(&format!("element vertex {vertices}\n")));
    assert!(ply.contains(&format!("element edge {edges}\n")));
    image::open(run.join("wireframe.png")).unwrap();
    for i in [0, 1, 2, 5, 6, 7] {
        let overlay = image::open(run.join(format!("overlays/image_000{i}.png"))).unwrap();
        assert_eq!((overlay.width(), overlay.height()), (48, 48));
    }

    // The same once more, on one thread.
    let again = scene.path("again");
    neat(&["reconstruct", &scene.path("scene"), "--out", &again])
        .args(["--config", &scene.path("run/plan.toml")])
        .args(["--backend", "flex", "--threads", "1"])
        .assert()
        .success();
    assert_eq!(
        fs::read_to_string(scene.file("again/metrics.jsonl")).unwrap(),
        metrics
    );
    assert_eq!(
        read_wireframe(&scene.file("again/wireframe.json")).unwrap(),
        wireframe
    );
}

#[test]
fn photographs_are_matched_before_a_field_is_trained() {
    let scene = TestScene::new();
    let manifest = |background: &str| {
        let mut command = scene.run("train", "1");
        command.args(["--overwrite", "--set", "train.dense_points=true", "--set"]);
        let assert = command.arg(format!("data.background={background}"));
        let told = stderr(&assert.assert().success());
        (json(&scene.file("run/manifest.json")), told)
    };
    let (photo, told) = manifest("photo");
    assert!(photo["seconds"]["match"].is_number(), "{photo}");
    assert!(told.contains("points on surfaces by matching"), "{told}");

    let (black, told) = manifest("black");
    assert!(black["seconds"].get("match").is_none(), "{black}");
    assert!(told.contains("train.dense_points: false"), "{told}");
}

#[test]
fn programs_read_what_is_decided_and_what_has_no_effect() {
    let scene = TestScene::new();
    let mut command = scene.run("reconstruct", "1");
    command.args(["--progress", "json"]);
    command.args(["--set", "distill.paper.visibility.min_views=6"]);
    let assert = command.assert().success();
    let events: Vec<Value> = stderr(&assert)
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let has = |event: &str, key: &str, value: &str| {
        let is = |told: &Value| told["event"] == event && told[key] == value;
        events.iter().any(is)
    };
    assert!(has("stage_started", "stage", "train"), "{events:?}");
    assert!(has("stage_finished", "stage", "export"), "{events:?}");
    assert!(has("decision", "setting", "data.background"), "{events:?}");
    assert!(has("decision", "setting", "scene sphere"), "{events:?}");
    assert!(has("warning", "kind", "no_effect"), "{events:?}");
    let manifest = json(&scene.file("run/manifest.json"));
    let warnings = manifest["warnings"].as_array().unwrap();
    let warning = warnings.iter().find(|w| w["kind"] == "no_effect").unwrap();
    let message = warning["message"].as_str().unwrap();
    assert!(
        message.contains("distill.paper.visibility.min_views"),
        "{message}"
    );
    let decisions = manifest["decisions"].as_array().unwrap();
    let black = decisions.iter().find(|d| d["setting"] == "data.background");
    assert_eq!(black.unwrap()["value"], "black");
}

#[test]
fn a_run_whose_configuration_leaves_nothing_open_needs_no_plan() {
    let scene = TestScene::new();
    scene.run("train", "1").assert().success();
    // There what was settled was in config.toml, and a warning was its text.
    let plan = scene.file("run/plan.toml");
    let settled = fs::read(&plan).unwrap();
    fs::rename(&plan, scene.file("run/config.toml")).unwrap();
    let mut manifest = json(&scene.file("run/manifest.json"));
    manifest.as_object_mut().unwrap().remove("decisions");
    manifest["warnings"] = serde_json::json!(["a warning"]);
    fs::write(scene.file("run/manifest.json"), manifest.to_string()).unwrap();

    neat(&["distill", &scene.path("run"), "--backend", "flex"])
        .assert()
        .success();
    // As if it had not ended.
    let mut manifest = json(&scene.file("run/manifest.json"));
    assert_eq!(manifest["warnings"][0]["message"], "a warning");
    manifest["status"] = "interrupted".into();
    fs::write(scene.file("run/manifest.json"), manifest.to_string()).unwrap();
    let resume = || scene.run("reconstruct", "1").arg("--resume").assert();
    resume().success();
    assert_eq!(fs::read(&plan).unwrap(), settled);
    assert_eq!(fs::read(scene.file("run/config.toml")).unwrap(), settled);
}

#[test]
fn a_trained_run_can_be_distilled_rendered_and_continued() {
    let scene = TestScene::new();
    scene.run("train", "1").assert().success();
    let run = scene.path("run");
    assert!(!scene.file("run/wireframe.json").exists());

    neat(&["distill", &run, "--backend", "flex"])
        .assert()
        .success();
    read_wireframe(&scene.file("run/wireframe.json")).unwrap();

    let render = neat(&["render", &run, "--backend", "flex"])
        .args(["--view", "image_0002", "--downscale", "4"])
        .assert()
        .success();
    assert!(stdout(&render).contains("image_0002: PSNR"));
    for kind in ["color", "depth", "normal"] {
        let path = scene.file(&format!("run/renders/image_0002-{kind}.png"));
        assert_eq!(image::open(path).unwrap().width(), 12);
    }
    let comparison = scene.file("run/renders/image_0002-comparison.png");
    assert_eq!(image::open(comparison).unwrap().width(), 24);
    let unknown = neat(&["render", &run, "--view", "nowhere"])
        .assert()
        .code(2);
    assert!(stderr(&unknown).contains("`nowhere`"));
    assert!(stderr(&unknown).contains("image_0003"));

    let other = scene.run("train", "5").arg("--resume").assert().code(2);
    assert!(stderr(&other).contains("train.steps: 1 then, 5 now"));
    let resume = || scene.run("reconstruct", "1").arg("--resume").assert();
    let distilled = stdout(&resume().success());
    let written = fs::metadata(scene.file("run/wireframe.json")).unwrap();
    // Nothing is left to do: the result is told once more.
    assert_eq!(stdout(&resume().success()), distilled);
    let now = fs::metadata(scene.file("run/wireframe.json")).unwrap();
    assert_eq!(now.modified().unwrap(), written.modified().unwrap());
    let metrics = fs::read_to_string(scene.file("run/metrics.jsonl")).unwrap();
    assert_eq!(metrics.lines().count(), 1, "{metrics}");

    truncate(&scene.file("run/checkpoints/step-00000001.safetensors"));
    let damaged = neat(&["distill", &run]).assert().code(2);
    assert!(stderr(&damaged).contains("step-00000001.safetensors"));

    scene
        .run("train", "1")
        .arg("--overwrite")
        .assert()
        .success();
    assert!(!scene.file("run/wireframe.json").exists());
}

#[test]
fn the_preset_neat_finds_the_edges_by_its_field() {
    let scene = TestScene::with(&["--views", "16", "--image-size", "160"]);
    let (run, truth) = (scene.path("run"), scene.path("scene/gt_wireframe.json"));
    let found = || {
        let scores = neat(&["eval", "--pred", &format!("{run}/wireframe.json")])
            .args(["--gt", &truth, "--format", "json"])
            .assert()
            .success();
        let scores: Value = serde_json::from_str(&stdout(&scores)).unwrap();
        let scores = scores.get(0).unwrap_or(&scores);
        let segments = &scores["scores"]["wireframe"]["segments_max"][1];
        ["precision", "recall"].map(|of| segments[of].as_f64().unwrap())
    };
    let preset = ["--preset", "neat"];
    scene
        .run("reconstruct", "400")
        .args(preset)
        .assert()
        .success();
    let plan = fs::read_to_string(scene.file("run/plan.toml")).unwrap();
    assert!(plan.contains("partners = \"field\""), "{plan}");
    let [precision, recall] = found();
    assert!(precision > 0.9 && recall > 0.9, "{precision} {recall}");
    // By the field and its junctions alone.
    neat(&["distill", &run, "--backend", "flex"])
        .args(["--set", "distill.back_end=paper"])
        .assert()
        .success();
    let [precision, recall] = found();
    assert!(precision > 0.8 && recall > 0.8, "{precision} {recall}");

    let no_field = neat(&["reconstruct", &scene.path("scene")])
        .args(["--out", &scene.path("other"), "--set", "distill.field=none"])
        .args(preset)
        .assert()
        .code(2);
    assert!(stderr(&no_field).contains("distill.partners = field asks"));
}

#[test]
fn eval_prints_and_saves_scores() {
    let scene = TestScene::new();
    let truth = scene.path("scene/gt_wireframe.json");
    let assert = neat(&["eval", "--pred", &truth, "--gt", &truth])
        .args(["--json", &scene.path("scores.json")])
        .assert()
        .success();
    let table = stdout(&assert);
    assert!(
        table.contains("P 0.01") && table.contains("R 0.05"),
        "{table}"
    );
    let scores = json(&scene.file("scores.json"));
    assert_eq!(scores[0]["protocol"], "neat-abc");
    let segments = &scores[0]["scores"]["wireframe"]["segments_max"];
    assert_eq!(segments[0]["recall"], 1.0);
    let all = "neat-abc,emap,curve-gaussian,edge-gaussians,nef,hss,wed";
    let assert = neat(&["eval", "--pred", &truth, "--gt", &truth])
        .args(["--protocol", all, "--format", "markdown"])
        .assert()
        .success();
    let tables = stdout(&assert);
    for protocol in all.split(',') {
        assert!(tables.contains(&format!("{protocol}: ")), "{tables}");
    }

    let cloud = scene.file("cloud.ply");
    let header = "ply\nformat ascii 1.0\nelement vertex 1\n\
                  property float x\nproperty float y\nproperty float z\nend_header\n";
    fs::write(&cloud, format!("{header}0 0 0\n")).unwrap();
    let assert = neat(&[
        "eval",
        "--pred",
        &truth,
        "--points",
        &scene.path("cloud.ply"),
    ])
    .assert()
    .success();
    assert!(stdout(&assert).contains("ACC-L"));
}

#[test]
fn info_describes_a_scene() {
    let scene = TestScene::new();
    let assert = neat(&["info", &scene.path("scene")]).assert().success();
    let text = stdout(&assert);
    for fragment in ["ABC", "views", "48×48", "scene sphere", "0.5"] {
        assert!(text.contains(fragment), "no `{fragment}` in:\n{text}");
    }
    assert_eq!(stderr(&assert), "");

    fs::remove_dir_all(scene.file("scene/hawp")).unwrap();
    let assert = neat(&["info", &scene.path("scene")]).assert().success();
    assert!(stderr(&assert).contains("no 2D wireframes"));
}

#[test]
fn demo_goes_all_the_way() {
    let scene = TestScene::new();
    let out = scene.path("demo");
    let demo = || {
        let mut command = neat(&["demo", "--out", &out, "--backend", "flex"]);
        command.args([
            "--views",
            "8",
            "--image-size",
            "48",
            "--train",
            "--steps",
            "1",
        ]);
        command
    };
    let assert = demo().assert().success();
    assert!(stdout(&assert).contains("junctions"));
    assert!(scene.file("demo/scene/gt_wireframe.json").exists());
    assert!(scene.file("demo/run/wireframe.json").exists());
    assert!(scene.file("demo/run/metrics.jsonl").exists());
    assert!(json(&scene.file("demo/evaluation.json"))["scores"]["wireframe"].is_object());

    demo().assert().code(2);
    demo().arg("--overwrite").assert().success();
}

#[test]
fn backends_are_compared() {
    let scene = TestScene::new();
    let out = scene.path("comparison");
    neat(&["compare-backends", &scene.path("scene"), "--out", &out])
        .args(["--backends", "flex,ndarray", "--steps", "2"])
        .assert()
        .success();
    let table = fs::read_to_string(scene.file("comparison/comparison.md")).unwrap();
    assert!(
        table.contains("flex") && table.contains("ndarray"),
        "{table}"
    );
    assert!(json(&scene.file("comparison/comparison.json")).is_object());
}

#[test]
fn bench_prints_consistent_numbers() {
    for (plain, options) in [(false, &[][..]), (true, &["--plain"])] {
        let assert = neat(&["bench", "--preset", "fast", "--seconds", "0.1", "--json"])
            .args(["--backend", "flex"])
            .args(options)
            .assert()
            .success();
        let bench: Value = serde_json::from_str(&stdout(&assert)).unwrap();
        assert_eq!(bench["backend"], "flex");
        assert_eq!(bench["fused"], !plain);
        let yardstick = bench["yardstick"].as_f64().unwrap();
        assert!(yardstick > 0.0 && bench["yardstick_again"].as_f64().unwrap() > 0.0);
        let presets = bench["presets"].as_array().unwrap();
        assert_eq!(presets.len(), 1);
        assert_eq!(presets[0]["preset"], "fast");
        let mut names = Vec::new();
        for part in presets[0]["parts"].as_array().unwrap() {
            let number = |key: &str| part[key].as_f64().unwrap();
            let name = part["name"].as_str().unwrap();
            names.push(name);
            let (seconds, flops) = (number("seconds"), number("flops"));
            // Junctions are matched in every second step; a slow machine takes one.
            assert!(seconds > 0.0 || name == "assignment", "{part}");
            // A few steps may do without a look at the sampler's grid.
            if ["forward", "backward", "step"].contains(&name) {
                assert!(flops > 0.0, "{part}");
            }
            let share = flops / seconds / 1e9 / yardstick;
            assert!((number("share") - share).abs() <= 1e-9 * share, "{part}");
        }
        let all = [
            "rays",
            "sampler",
            "forward",
            "assignment",
            "backward",
            "optimiser",
            "step",
            "distance with gradient, alone",
        ];
        assert_eq!(names, all);
    }
}

#[test]
fn bench_prints_a_table() {
    let assert = neat(&["bench", "--preset", "fast", "--seconds", "0.1", "--plain"])
        .args(["--backend", "flex"])
        .assert()
        .success();
    let text = stdout(&assert);
    for fragment in ["Backend flex", "off", "Yardstick", "fast (", "| step |"] {
        assert!(text.contains(fragment), "no `{fragment}` in:\n{text}");
    }
}

#[test]
fn help_teaches() {
    let text = stdout(&neat(&["--help"]).assert().success());
    assert!(text.contains("Exit codes") && text.contains("130"));
    for command in [
        "reconstruct",
        "train",
        "distill",
        "eval",
        "render",
        "synth",
        "info",
        "demo",
        "compare-backends",
        "bench",
    ] {
        let text = stdout(&neat(&[command, "--help"]).assert().success());
        assert!(text.contains("Examples:") || command == "info", "{command}");
    }
}
