//! Written files, read back by a parser that shares nothing with the writer.

use nalgebra::Vector3;
use neat_wireframe::Wireframe3d;
use neat_wireframe::export::{
    ExportError, SupportingSegment, WireframeDocument, read_json, write_json, write_obj, write_ply,
};
use neat_wireframe::validity::WireframeFlaw;
use std::path::Path;

/// Numbers that a careless format would round or misread.
fn awkward() -> Wireframe3d {
    Wireframe3d {
        junctions: vec![
            Vector3::new(0.1, 1.0 / 3.0, -0.0),
            Vector3::new(f64::MIN_POSITIVE, 1e300, 5e-324),
            Vector3::new(-123_456_789.123_456_79, 2.0, 1e-7),
            Vector3::new(f64::EPSILON, f64::MAX, -1e22),
        ],
        edges: vec![[0, 1], [1, 2], [0, 2]],
    }
}

fn bits(wireframe: &Wireframe3d) -> Vec<[u64; 3]> {
    let bits = |p: &Vector3<f64>| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits()];
    wireframe.junctions.iter().map(bits).collect()
}

fn numbers<T: std::str::FromStr<Err: std::fmt::Debug>>(line: &str) -> Vec<T> {
    line.split_whitespace()
        .map(|x| x.parse().unwrap())
        .collect()
}

fn parse_obj(text: &str) -> Wireframe3d {
    let mut wireframe = Wireframe3d::default();
    for line in text.lines() {
        match line.split_once(' ').unwrap() {
            ("v", rest) => wireframe.junctions.push(Vector3::from_vec(numbers(rest))),
            ("l", rest) => {
                let ends: Vec<usize> = numbers(rest);
                wireframe.edges.push([ends[0] - 1, ends[1] - 1]);
            }
            _ => panic!("{line}"),
        }
    }
    wireframe
}

fn parse_ply(text: &str) -> Wireframe3d {
    let (header, body) = text.split_once("end_header\n").unwrap();
    assert!(header.starts_with("ply\nformat ascii 1.0\n"));
    let count = |element: &str| -> usize {
        let line = header
            .lines()
            .find_map(|l| l.strip_prefix(element))
            .unwrap();
        line.trim().parse().unwrap()
    };
    let (vertices, edges) = (count("element vertex"), count("element edge"));
    let lines: Vec<&str> = body.lines().collect();
    assert_eq!(lines.len(), vertices + edges);
    Wireframe3d {
        junctions: lines[..vertices]
            .iter()
            .map(|line| Vector3::from_vec(numbers(line)))
            .collect(),
        edges: lines[vertices..]
            .iter()
            .map(|line| numbers(line).try_into().unwrap())
            .collect(),
    }
}

fn parse_json(text: &str) -> Wireframe3d {
    let value: serde_json::Value = serde_json::from_str(text).unwrap();
    let rows = |key: &str| value[key].as_array().unwrap().clone();
    Wireframe3d {
        junctions: rows("junctions")
            .iter()
            .map(|p| {
                assert_eq!(p.as_array().unwrap().len(), 3);
                Vector3::from_fn(|i, _| p[i].as_f64().unwrap())
            })
            .collect(),
        edges: rows("edges")
            .iter()
            .map(|e| [0, 1].map(|i: usize| e[i].as_u64().unwrap() as usize))
            .collect(),
    }
}

fn write_json_graph(path: &Path, wireframe: &Wireframe3d) -> Result<(), ExportError> {
    write_json(path, &WireframeDocument::from(wireframe))
}

fn write_bare_obj(path: &Path, wireframe: &Wireframe3d) -> Result<(), ExportError> {
    write_obj(path, wireframe, &[])
}

fn write_bare_ply(path: &Path, wireframe: &Wireframe3d) -> Result<(), ExportError> {
    write_ply(path, wireframe, &[])
}

type Write = fn(&Path, &Wireframe3d) -> Result<(), ExportError>;
type Parse = fn(&str) -> Wireframe3d;

const FORMATS: [(&str, Write, Parse); 3] = [
    ("w.json", write_json_graph, parse_json),
    ("w.obj", write_bare_obj, parse_obj),
    ("w.ply", write_bare_ply, parse_ply),
];

#[test]
fn every_format_keeps_every_bit_and_shared_vertices() {
    let dir = tempfile::tempdir().unwrap();
    for (name, write, parse) in FORMATS {
        let path = dir.path().join(name);
        write(&path, &awkward()).unwrap();
        let read = parse(&std::fs::read_to_string(&path).unwrap());
        assert_eq!(bits(&read), bits(&awkward()), "{name}");
        assert_eq!(read.edges, awkward().edges, "{name}");
    }
}

#[test]
fn an_empty_wireframe_is_a_valid_file() {
    let dir = tempfile::tempdir().unwrap();
    for (name, write, parse) in FORMATS {
        let path = dir.path().join(name);
        write(&path, &Wireframe3d::default()).unwrap();
        let read = parse(&std::fs::read_to_string(&path).unwrap());
        assert_eq!(read, Wireframe3d::default(), "{name}");
    }
}

#[test]
fn broken_wireframes_leave_the_old_file_alone() {
    let dir = tempfile::tempdir().unwrap();
    let mut nan = awkward();
    nan.junctions[1].z = f64::NAN;
    let mut dangling = awkward();
    dangling.edges.push([0, 4]);
    for (name, write, parse) in FORMATS {
        let path = dir.path().join(name);
        write(&path, &awkward()).unwrap();
        let flaws = [&nan, &dangling].map(|broken| match write(&path, broken) {
            Err(ExportError::Invalid {
                path: named,
                source,
            }) => (named == path, source),
            other => panic!("{other:?}"),
        });
        let edge = WireframeFlaw::EdgeOutOfRange {
            edge: 3,
            ends: [0, 4],
            junctions: 4,
        };
        let junction = WireframeFlaw::NonFiniteJunction { junction: 1 };
        assert_eq!(flaws, [(true, junction), (true, edge)]);
        let read = parse(&std::fs::read_to_string(&path).unwrap());
        assert_eq!(bits(&read), bits(&awkward()));
    }
}

#[test]
fn replacing_leaves_one_file_and_a_missing_folder_is_named() {
    let dir = tempfile::tempdir().unwrap();
    for (name, write, parse) in FORMATS {
        let path = dir.path().join(name);
        write(&path, &awkward()).unwrap();
        write(&path, &Wireframe3d::default()).unwrap();
        let read = parse(&std::fs::read_to_string(&path).unwrap());
        assert_eq!(read, Wireframe3d::default());

        let error = write(&dir.path().join("missing").join(name), &awkward()).unwrap_err();
        assert!(error.to_string().contains("missing"), "{error}");
    }
    assert_eq!(
        std::fs::read_dir(dir.path()).unwrap().count(),
        FORMATS.len()
    );
}

#[test]
fn fields_and_metadata_read_back() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("wireframe.json");
    let mut document = WireframeDocument::from(&awkward());
    document.metadata.insert("scene".into(), "toy".into());
    document.metadata.insert("seed".into(), 42.into());
    let votes = vec![7.0, 0.1, 3.0, 1e-9];
    document.junction_fields.other.insert("votes".into(), votes);
    let views = vec![5.0, 6.0, 7.0];
    document
        .edge_fields
        .other
        .insert("visible_views".into(), views);
    document.junction_covariances = vec![None; 4];
    document.junction_covariances[1] = Some([1e-6, 0.1, -3e-9, 2.0, 0.0, 4.0]);
    document.views = vec!["0000".into(), "0001".into()];
    document.edge_support = vec![Vec::new(); 3];
    document.edge_support[2].push(SupportingSegment {
        view: 1,
        segment: [0.1, -2.0, 1e3, 7.0],
        residual: 0.25,
    });
    write_json(&path, &document).unwrap();
    let read = read_json(&path).unwrap();
    assert_eq!(read, document);
    assert_eq!(read.wireframe(), awkward());

    for bad in [vec![1.0], vec![1.0, 2.0, f64::NAN]] {
        document.edge_fields.other.insert("score".into(), bad);
        let error = write_json(&path, &document).unwrap_err().to_string();
        assert!(
            error.contains("`score`") && error.contains("3 entries"),
            "{error}"
        );
    }
    document.edge_fields.other.remove("score");

    let mut without_view = document.clone();
    without_view.views.pop();
    let mut too_short = document.clone();
    too_short.junction_covariances.pop();
    let mut infinite = document.clone();
    infinite.junction_covariances[0] = Some([f64::INFINITY; 6]);
    for bad in [without_view, too_short, infinite] {
        write_json(&path, &bad).unwrap_err();
    }
    write_json(&path, &document).unwrap();
}

#[test]
fn ground_truth_with_lines_and_curves_reads_too() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("gt_wireframe.json");
    let text = r#"{"junctions": [[0, 0, 0], [1, 2, 3]], "lines": [[0, 1]], "curves": [[]]}"#;
    std::fs::write(&path, text).unwrap();
    let read = read_json(&path).unwrap();
    assert_eq!(read.junctions[1], Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(read.edges, [[0, 1]]);
}

#[test]
fn bad_files_are_errors_that_name_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("bad.json");
    let missing = read_json(&path).unwrap_err().to_string();
    assert!(missing.contains("bad.json"), "{missing}");
    for text in [
        "",
        "{",
        "[]",
        r#"{"edges": []}"#,
        r#"{"junctions": [[0, 0]]}"#,
        r#"{"junctions": [[0, 0, 0, 0]]}"#,
        r#"{"junctions": [[0, 0, null]]}"#,
        r#"{"junctions": [[0, 0, 1e999]]}"#,
        r#"{"junctions": [[0, 0, 0]], "edges": [[0, 1]]}"#,
        r#"{"junctions": [[0, 0, 0]], "edges": [[0, -1]]}"#,
        r#"{"junctions": [[0, 0, 0]], "edges": [[0, 0, 0]]}"#,
        r#"{"junctions": [[0, 0, 0]], "junction_fields": {"votes": []}}"#,
    ] {
        std::fs::write(&path, text).unwrap();
        let error = read_json(&path).expect_err(text).to_string();
        assert!(error.contains("bad.json"), "{text}: {error}");
    }
}
