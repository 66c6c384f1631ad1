//! Faces in the exports: a block with a round hole, a sheet, an edge and an arc on their own.

use nalgebra::Vector3;
use neat_export::{EdgeFilter, ExportOptions, Format, export};
use neat_wireframe::export::{WireframeDocument, read_json, write_json};
use neat_wireframe::faces::Surface;
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

fn document() -> WireframeDocument {
    read_json(Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/data/solid.json"
    )))
    .unwrap()
}

fn exported(document: &WireframeDocument, format: Format, filter: EdgeFilter) -> String {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("w");
    let options = ExportOptions {
        filter,
        ..ExportOptions::default()
    };
    export(document, &path, format, &options).unwrap();
    fs::read_to_string(path).unwrap()
}

fn count(text: &str, entity: &str) -> usize {
    text.matches(&format!("={entity}(")).count()
}

#[test]
fn a_closed_shell_is_a_solid_in_step() {
    let step = exported(&document(), Format::Step, EdgeFilter::default());
    assert_eq!(count(&step, "MANIFOLD_SOLID_BREP"), 1);
    assert_eq!(count(&step, "CLOSED_SHELL"), 1);
    assert_eq!(count(&step, "SHELL_BASED_SURFACE_MODEL"), 1);
    assert_eq!(count(&step, "ADVANCED_FACE"), 8);
    assert_eq!(count(&step, "PLANE"), 7);
    assert_eq!(count(&step, "CYLINDRICAL_SURFACE"), 1);
    // The two faces with the hole have a loop for it.
    assert_eq!(count(&step, "FACE_OUTER_BOUND"), 8);
    assert_eq!(count(&step, "FACE_BOUND"), 2);
    // What bounds no face is a wireframe.
    assert_eq!(count(&step, "CONNECTED_EDGE_SET"), 2);
    // In a closed shell every edge is used twice, once in each direction; the seam of the
    // cylinder by one face.
    let mut uses: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for line in step.lines().filter(|line| line.contains("=ORIENTED_EDGE(")) {
        let (_, arguments) = line.split_once("*,*,").unwrap();
        let (edge, sense) = arguments.split_once(',').unwrap();
        uses.entry(edge).or_default().push(sense);
    }
    let both = uses
        .values()
        .filter(|senses| senses.len() == 2 && senses[0] != senses[1]);
    let single = uses.values().filter(|senses| senses.len() == 1);
    assert_eq!((both.count(), single.count()), (12 + 2 + 1, 4));
}

#[test]
fn a_shell_without_an_edge_is_a_sheet() {
    let mut document = document();
    let mut probability = vec![1.0; document.edges.len()];
    probability[0] = 0.1;
    document.edge_fields.probability = Some(probability);
    let filter = EdgeFilter {
        min_probability: Some(0.5),
        ..EdgeFilter::default()
    };
    let kept = filter.apply(&document).unwrap();
    kept.check(Path::new("w")).unwrap();
    let faces: Vec<(bool, usize)> = (kept.shells.iter())
        .map(|shell| (shell.closed, shell.faces.len()))
        .collect();
    assert_eq!(faces, [(false, 5), (false, 1)]);
    let step = exported(&document, Format::Step, filter);
    assert_eq!(count(&step, "MANIFOLD_SOLID_BREP"), 0);
    assert_eq!(count(&step, "OPEN_SHELL"), 2);
}

#[test]
fn triangles_of_a_solid_share_their_sides() {
    let document = document();
    let sides = |triangles: Vec<[usize; 3]>| -> Vec<[usize; 2]> {
        let sides = |[a, b, c]: [usize; 3]| [[a, b], [b, c], [c, a]];
        triangles.into_iter().flat_map(sides).collect()
    };
    let corners = |text: &str, start: &str, from: usize| -> Vec<[usize; 3]> {
        let rows = text.lines().filter_map(|line| line.strip_prefix(start));
        let numbers = |row: &str| -> Vec<usize> {
            row.split_whitespace()
                .map(|word| word.parse().unwrap())
                .collect()
        };
        let rows = rows.map(numbers).filter(|row| row.len() == 3);
        rows.map(|row| [row[0] - from, row[1] - from, row[2] - from])
            .collect()
    };
    let obj = exported(&document, Format::Obj, EdgeFilter::default());
    let ply = exported(&document, Format::Ply, EdgeFilter::default());
    let (_, body) = ply.split_once("end_header\n").unwrap();
    let triangles = corners(&obj, "f ", 1);
    assert_eq!(triangles, corners(body, "3 ", 0));
    let sides = sides(triangles);
    let open = sides.iter().filter(|[a, b]| !sides.contains(&[*b, *a]));
    // Those around the sheet.
    assert_eq!(open.count(), 4);
    let gltf = exported(&document, Format::Gltf, EdgeFilter::default());
    assert!(gltf.contains("\"name\":\"faces\""));
}

#[test]
fn what_has_no_faces_says_so() {
    let dir = tempfile::tempdir().unwrap();
    for (format, remarks) in [(Format::Dxf, 1), (Format::Step, 0)] {
        let path = dir.path().join(format.name());
        let options = ExportOptions::default();
        let written = export(&document(), &path, format, &options).unwrap();
        assert_eq!(written.remarks.len(), remarks, "{:?}", written.remarks);
        let said = |remark: &String| remark == "dxf has no faces: 8 left out";
        assert!(written.remarks.iter().all(said));
    }
}

#[test]
fn shells_read_back_and_broken_ones_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("w.json");
    let document = document();
    write_json(&path, &document).unwrap();
    assert_eq!(read_json(&path).unwrap(), document);
    let text = fs::read_to_string(&path).unwrap();
    for (sound, broken) in [
        ("\"edge\":3", "\"edge\":99"),
        ("\"arc\":0", "\"arc\":2"),
        ("\"reversed\":true", "\"reversed\":false"),
        ("\"normal\":[", "\"normal\":[7e0,"),
    ] {
        assert!(text.contains(sound));
        fs::write(&path, text.replacen(sound, broken, 1)).unwrap();
        assert!(read_json(&path).is_err(), "{broken}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Surfaces of another program may have nothing to do with their curves.
    #[test]
    fn wrong_surfaces_are_written_as_numbers(
        normal in prop::sample::select(vec![Vector3::x(), -Vector3::y(), Vector3::z()]),
        offset in -2.0..2.0,
        convex: bool,
    ) {
        let mut document = document();
        for face in document.shells.iter_mut().flat_map(|shell| &mut shell.faces) {
            face.surface = match face.surface {
                Surface::Plane { .. } => Surface::Plane { normal, offset },
                Surface::Cylinder { radius, .. } => Surface::Cylinder {
                    point: document.arcs[0].center,
                    axis: normal,
                    radius,
                    convex,
                },
            };
        }
        for format in [Format::Step, Format::Obj, Format::Gltf] {
            let text = exported(&document, format, EdgeFilter::default());
            prop_assert!(!text.contains("NaN") && !text.contains("inf"), "{format:?}");
        }
    }
}
