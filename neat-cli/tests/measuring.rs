//! `neat measure`: dimensions of a wireframe that is known.

mod support;

use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use support::{neat, stderr, stdout};
use tempfile::TempDir;

/// A rectangle of 4 by 3 whose last junction is not determined, and an edge with a free end.
struct Rectangle {
    dir: TempDir,
}

impl Rectangle {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let sure = json!([1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4]);
        let wireframe = json!({
            "junctions": [[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0], [6, 0, 0]],
            "edges": [[0, 1], [1, 2], [2, 3], [3, 0], [1, 4]],
            "junction_covariances": [sure, sure, sure, null, sure],
        });
        fs::write(dir.path().join("wireframe.json"), wireframe.to_string()).unwrap();
        Self { dir }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn run(&self) -> String {
        self.dir.path().to_string_lossy().into_owned()
    }

    fn measured(&self, arguments: &[&str]) -> String {
        let mut command = neat(&["measure", &self.run()]);
        stdout(&command.args(arguments).assert().success())
    }

    fn json(&self, arguments: &[&str]) -> Value {
        let text = self.measured(&[arguments, &["--json"]].concat());
        serde_json::from_str(&text).unwrap()
    }

    fn refused(&self, arguments: &[&str]) -> String {
        let mut command = neat(&["measure", &self.run()]);
        stderr(&command.args(arguments).assert().code(2))
    }
}

#[test]
fn all_lengths_are_listed_and_what_is_not_determined_says_so() {
    let text = Rectangle::new().measured(&[]);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 6, "{text}");
    assert!(lines[0].contains("unit of your files"), "{text}");
    // 1.96 √2 · 0.01
    assert!(
        lines[1].contains("4.000") && lines[1].contains("3.972 to 4.028"),
        "{text}"
    );
    assert!(lines[3].contains("not determined"), "{text}");
    assert!(lines[5].contains("free end"), "{text}");
    assert!(!lines[1].contains("free end"), "{text}");
}

#[test]
fn selections_and_scale_reach_the_numbers() {
    let rectangle = Rectangle::new();
    let found = rectangle.json(&[
        "--edge=1",
        "--between=0-2",
        "--angle=0,1",
        "--scale",
        "0-1=8m±0.2",
    ]);
    assert_eq!(found["unit"], "m");
    let values: Vec<f64> = (found["dimensions"].as_array().unwrap().iter())
        .map(|d| d["value"].as_f64().unwrap())
        .collect();
    for (value, expected) in values.iter().zip([6.0, 10.0, 90.0]) {
        assert!((value - expected).abs() < 1e-9, "{found}");
    }
    // The scale is the larger part: 0.2 of 8 m, with 95 %, is 0.15 of 6 m.
    let [low, high] = [0, 1].map(|k| found["dimensions"][0]["interval"][k].as_f64().unwrap());
    assert!((0.15..0.17).contains(&(0.5 * (high - low))), "{found}");
    let exact = rectangle.json(&["--between=0-1", "--scale=0-1=10ft"]);
    assert!(
        exact["dimensions"][0]["sigma"].as_f64().unwrap() < 1e-6,
        "{exact}"
    );
}

#[test]
fn areas_of_faces_are_in_the_square_of_the_unit() {
    let rectangle = Rectangle::new();
    let path = rectangle.file("wireframe.json");
    let mut wireframe: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let steps: Vec<Value> = (0..4).map(|edge| json!({"edge": edge})).collect();
    let plane = json!({"normal": [0.0, 0.0, 1.0], "offset": 0.0});
    wireframe["shells"] = json!([{
        "closed": false,
        "faces": [{"plane": plane, "loops": [steps]}],
    }]);
    wireframe["junction_covariances"][3] = wireframe["junction_covariances"][0].clone();
    fs::write(&path, wireframe.to_string()).unwrap();
    let all = rectangle.measured(&[]);
    assert!(all.lines().last().unwrap().contains("area 0"), "{all}");
    let text = rectangle.measured(&["--area=0", "--scale=0-1=8m"]);
    assert!(text.contains("48.") && text.contains(" m²"), "{text}");
    let found = rectangle.json(&["--area=0"]);
    let area = &found["dimensions"][0];
    assert!(
        (area["value"].as_f64().unwrap() - 12.0).abs() < 1e-9,
        "{found}"
    );
    // Each corner by half its diagonal of 5.
    let sigma = area["sigma"].as_f64().unwrap();
    assert!((sigma - 0.01 * 5.0).abs() < 1e-6, "{found}");
    assert!(rectangle.refused(&["--area=1"]).contains("no face 1"));
}

#[test]
fn parallel_edges_are_found_and_written_as_csv() {
    let rectangle = Rectangle::new();
    let text = rectangle.measured(&["--parallel", "--csv"]);
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0].len(), 9, "{text}");
    let gaps: Vec<[&str; 4]> = rows[1..].iter().map(|r| [r[0], r[1], r[2], r[3]]).collect();
    assert_eq!(
        gaps,
        [["gap", "0", "2", "3"], ["gap", "1", "3", "4"]],
        "{text}"
    );
    assert!(rows[1][4].is_empty(), "{text}");
    let one = rectangle.measured(&["--parallel", "--most=1", "--csv"]);
    assert_eq!(one.lines().count(), 2);
}

#[test]
fn wireframes_without_covariances_are_measured_with_a_warning() {
    let rectangle = Rectangle::new();
    let path = rectangle.file("truth.json");
    fs::write(
        &path,
        r#"{"junctions": [[0,0,0],[2,0,0]], "lines": [[0,1]]}"#,
    )
    .unwrap();
    let assert = neat(&["measure", &path.to_string_lossy()])
        .assert()
        .success();
    assert!(stdout(&assert).contains("2.00000"));
    assert!(stderr(&assert).contains("no covariances"));
}

#[test]
fn bad_input_ends_with_2_and_a_sentence() {
    let rectangle = Rectangle::new();
    for (arguments, part) in [
        (["--edge=5"].as_slice(), "no edge 5"),
        (&["--between=0-9"], "no junction 9"),
        (&["--between=0-0"], "named twice"),
        (&["--between=0"], "two numbers"),
        (&["--angle=1-2"], "two numbers"),
        (&["--edge=-1"], "--edge"),
        (&["--scale=0-1=3.2"], "mm, cm, m, in or ft"),
        (&["--scale=0-7=3.2m"], "no junction 7"),
        (&["--most=3"], "--parallel"),
        (&["--json", "--csv"], "--csv"),
    ] {
        let message = rectangle.refused(arguments);
        assert!(message.contains(part), "{arguments:?}: {message}");
    }
    for (name, content) in [
        ("empty.json", ""),
        ("cut.json", r#"{"junctions": [[0,0"#),
        ("edge.json", r#"{"junctions": [[0,0,0]], "edges": [[0,3]]}"#),
    ] {
        fs::write(rectangle.file(name), content).unwrap();
        let path = rectangle.file(name).to_string_lossy().into_owned();
        let message = stderr(&neat(&["measure", &path]).assert().code(2));
        assert!(message.contains(name), "{message}");
    }
    let missing = rectangle.file("nothing").to_string_lossy().into_owned();
    let message = stderr(&neat(&["measure", &missing]).assert().code(2));
    assert!(message.contains("nothing"), "{message}");
    fs::write(
        rectangle.file("none.json"),
        r#"{"junctions": [], "edges": []}"#,
    )
    .unwrap();
    let none = rectangle.file("none.json").to_string_lossy().into_owned();
    neat(&["measure", &none]).assert().success();
}
