//! Faces in the exports: a block with a round hole, a sheet, an edge and an arc on their own.

use nalgebra::Vector3;
use neat_core::CircularArc;
use neat_export::{EdgeFilter, ExportOptions, Format, export};
use neat_wireframe::dimensions::Dimensions;
use neat_wireframe::export::{WireframeDocument, read_json, write_json};
use neat_wireframe::faces::{CurveIndex, ShellGeometry, Surface, find_shells};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fs;
use std::path::Path;

fn document(name: &str) -> WireframeDocument {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data"));
    read_json(&data.join(name)).unwrap()
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

fn add_shells(document: &mut WireframeDocument) {
    let wireframe = document.wireframe();
    let shells = find_shells(&document.graph(&wireframe), &[], &[]);
    document.shells = shells;
}

fn count(text: &str, entity: &str) -> usize {
    text.matches(&format!("={entity}(")).count()
}

#[test]
fn a_closed_shell_is_a_solid_in_step() {
    let step = exported(&document("solid.json"), Format::Step, EdgeFilter::default());
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
    let mut document = document("solid.json");
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
    let document = document("solid.json");
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
        let written = export(&document("solid.json"), &path, format, &options).unwrap();
        assert_eq!(written.remarks.len(), remarks, "{:?}", written.remarks);
        let said = |remark: &String| remark == "dxf has no faces: 8 left out";
        assert!(written.remarks.iter().all(said));
    }
}

#[test]
fn shells_read_back_and_broken_ones_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("w.json");
    let document = document("solid.json");
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

#[test]
fn patches_with_odd_sides_are_refused_or_written_as_numbers() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("w.json");
    let document = document("lofted.json");
    write_json(&path, &document).unwrap();
    assert_eq!(read_json(&path).unwrap(), document);
    let text = fs::read_to_string(&path).unwrap();
    let sound = "\"sides\":[1,1,1,1]";
    assert!(text.contains(sound));
    for broken in [
        "[4,0,0,0]",
        "[1,1,1,2]",
        "[1,1,1,0]",
        "[1,1,1]",
        "[18446744073709551615,1,1,3]",
    ] {
        fs::write(&path, text.replace(sound, &format!("\"sides\":{broken}"))).unwrap();
        assert!(read_json(&path).is_err(), "{broken}");
    }
    for odd in [
        "[2,2,0,0]",
        "[2,0,2,0]",
        "[0,1,3,0]",
        "[1,2,1,0]",
        "[0,0,1,3]",
    ] {
        fs::write(&path, text.replace(sound, &format!("\"sides\":{odd}"))).unwrap();
        let document = read_json(&path).unwrap();
        let step = exported(&document, Format::Step, EdgeFilter::default());
        assert!(!step.contains("NaN") && !step.contains("inf"), "{odd}");
        let points = document.drawn().junctions;
        assert!(points.iter().flatten().all(|x| x.is_finite()), "{odd}");
        assert!(!document.drawn_triangles().is_empty());
        assert!(
            (Dimensions::new(&document, None).unwrap().areas().iter())
                .all(|area| area.value.is_finite()),
            "{odd}"
        );
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
        half_angle in prop::option::of(0.01..1.5),
    ) {
        let mut document = document("solid.json");
        for face in document.shells.iter_mut().flat_map(|shell| &mut shell.faces) {
            face.surface = match face.surface {
                Surface::Plane { .. } => Surface::Plane { normal, offset },
                _ => match half_angle {
                    Some(half_angle) => Surface::Cone {
                        apex: document.arcs[0].center + offset * normal,
                        axis: normal,
                        half_angle,
                        convex,
                    },
                    None => Surface::Cylinder {
                        point: document.arcs[0].center,
                        axis: normal,
                        radius: 0.2,
                        convex,
                    },
                },
            };
        }
        for format in [Format::Step, Format::Obj, Format::Gltf, Format::CityJson] {
            let text = exported(&document, format, EdgeFilter::default());
            prop_assert!(!text.contains("NaN") && !text.contains("inf"), "{format:?}");
        }
    }
}

#[test]
fn a_countersunk_hole_is_a_cone_in_step() {
    let circle = |radius: f64, z: f64| CircularArc {
        center: Vector3::new(0.4, 0.5, z),
        axes: [Vector3::x(), Vector3::y()],
        radius,
        angles: [0.3, 0.3 + std::f64::consts::TAU],
    };
    let corner = |k: usize| [k & 1, k >> 1 & 1, k >> 2].map(|x| x as f64);
    let edges = (0..8).flat_map(|k| [1, 2, 4].map(|bit| [k, k | bit]));
    let mut document = WireframeDocument {
        junctions: (0..8).map(|k| Vector3::from(corner(k))).collect(),
        edges: edges.filter(|[a, b]| a != b).collect(),
        arcs: vec![circle(0.1, 0.0), circle(0.1, 0.7), circle(0.3, 1.0)],
        ..WireframeDocument::default()
    };
    add_shells(&mut document);
    let step = exported(&document, Format::Step, EdgeFilter::default());
    assert_eq!(count(&step, "MANIFOLD_SOLID_BREP"), 1);
    assert_eq!(count(&step, "CONICAL_SURFACE"), 1);
    assert_eq!(count(&step, "CYLINDRICAL_SURFACE"), 1);
    // Its radius where it begins, and its angle.
    let cone = step.lines().find(|line| line.contains("CONICAL")).unwrap();
    let numbers: Vec<f64> = (cone.trim_end_matches([')', ';']).split(','))
        .filter_map(|word| word.parse().ok())
        .collect();
    assert!(
        numbers.len() == 2 && (numbers[1] - (0.2_f64 / 0.3).atan()).abs() < 1e-9,
        "{cone}"
    );
    let is_rim = |radius: f64| (numbers[0] - radius).abs() < 1e-9;
    assert!(is_rim(0.1) || is_rim(0.3), "{cone}");
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("w.json");
    write_json(&path, &document).unwrap();
    assert_eq!(read_json(&path).unwrap(), document);
}

/// A block with a rounded corner, whose cylinder goes on as planes.
fn rounded() -> WireframeDocument {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.7], [0.7, 1.0], [0.0, 1.0]];
    let at = |z: f64| corners.map(|[x, y]| Vector3::new(x, y, z));
    let arc = |z: f64| CircularArc {
        center: Vector3::new(0.7, 0.7, z),
        axes: [Vector3::x(), Vector3::y()],
        radius: 0.3,
        angles: [0.0, std::f64::consts::FRAC_PI_2],
    };
    let level = |k: usize| [[k, k + 1], [k + 1, k + 2], [k + 3, k + 4], [k + 4, k]];
    let mut document = WireframeDocument {
        junctions: [at(0.0), at(0.8)].concat(),
        edges: [&level(0)[..], &level(5)[..], &[[0, 5], [1, 6], [4, 9]]].concat(),
        arcs: vec![arc(0.0), arc(0.8)],
        ..WireframeDocument::default()
    };
    add_shells(&mut document);
    document
}

#[test]
fn walls_are_extruded_and_cylinders_have_holes() {
    // A pin between two ellipses, and a cylinder on which another one ends.
    let document = document("curved.json");
    let mut found = document.clone();
    add_shells(&mut found);
    assert_eq!(found.shells.len(), document.shells.len());
    assert!(document.shells.len() == 2 && document.shells.iter().all(|shell| shell.closed));
    let step = exported(&document, Format::Step, EdgeFilter::default());
    assert_eq!(count(&step, "MANIFOLD_SOLID_BREP"), 2);
    assert_eq!(count(&step, "SURFACE_OF_LINEAR_EXTRUSION"), 1);
    assert_eq!(count(&step, "CYLINDRICAL_SURFACE"), 2);
    // The wall is cut open along a line; the cylinder with the hole has its loops.
    assert_eq!(count(&step, "LINE"), 1);
    assert_eq!(count(&step, "FACE_BOUND"), 3);
    let again: WireframeDocument =
        serde_json::from_str(&exported(&document, Format::Json, EdgeFilter::default())).unwrap();
    assert_eq!(again.shells, document.shells);
}

#[test]
fn a_loft_with_a_hole_is_a_patch() {
    let document = document("lofted.json");
    let mut found = document.clone();
    add_shells(&mut found);
    let [shell] = &found.shells[..] else {
        panic!("{} shells", found.shells.len());
    };
    assert!(shell.closed && shell.faces.len() == 10);
    assert_eq!(found.shells, document.shells);
    // By another program, from what the two arcs say.
    let geometry = ShellGeometry::new(shell, &document.graph(&document.wireframe()));
    assert!((geometry.volume(shell) / 1.982_808_58 - 1.0).abs() < 1e-4);
    let step = exported(&document, Format::Step, EdgeFilter::default());
    assert_eq!(count(&step, "MANIFOLD_SOLID_BREP"), 1);
    assert_eq!(count(&step, "B_SPLINE_SURFACE_WITH_KNOTS"), 1);
    assert_watertight(&document);
    let points = document.drawn().junctions;
    let flux = |[a, b, c]: [usize; 3]| points[a].dot(&points[b].cross(&points[c])) / 6.0;
    let volume: f64 = document.drawn_triangles().into_iter().map(flux).sum();
    assert!((volume / 1.982_808_58 - 1.0).abs() < 2e-3, "{volume}");
    // All of its faces have an area, the patch too.
    let areas = Dimensions::new(&document, None).unwrap().areas();
    assert_eq!(areas.len(), 10);
    for (face, area) in shell.faces.iter().zip(&areas) {
        assert!((area.value / geometry.area(face) - 1.0).abs() < 1e-4);
    }
}

#[test]
fn pins_with_round_ends_are_solids_with_spheres() {
    let document = document("domed.json");
    let mut found = document.clone();
    add_shells(&mut found);
    assert_eq!(found.shells, document.shells);
    let volumes: Vec<f64> = (document.shells.iter())
        .map(|shell| {
            assert!(shell.closed && shell.faces.len() == 3);
            let geometry = ShellGeometry::new(shell, &document.graph(&document.wireframe()));
            geometry.volume(shell)
        })
        .collect();
    let cylinder = PI * 0.16 * 0.7;
    let round = cylinder + 2.0 / 3.0 * PI * 0.064;
    // The ball lacks a cap 0.2 high.
    let ball = cylinder + 4.0 / 3.0 * PI * 0.125 - PI * 0.04 * (0.5 - 0.2 / 3.0);
    for (volume, truth) in volumes.iter().zip([round, ball]) {
        assert!((volume / truth - 1.0).abs() < 1e-9, "{volumes:?}");
    }
    let step = exported(&document, Format::Step, EdgeFilter::default());
    assert_eq!(count(&step, "MANIFOLD_SOLID_BREP"), 2);
    assert_eq!(count(&step, "SPHERICAL_SURFACE"), 2);
    // Where the round end touches the pin nothing is observed.
    assert_eq!(step.matches("EDGE_CURVE('inferred',").count(), 1);
    assert_watertight(&document);
    let dimensions = Dimensions::new(&document, None).unwrap().areas();
    let areas = document.shells.iter().flat_map(|shell| {
        let geometry = ShellGeometry::new(shell, &document.graph(&document.wireframe()));
        let areas: Vec<f64> = shell.faces.iter().map(|face| geometry.area(face)).collect();
        areas
    });
    assert_eq!(dimensions.len(), 6);
    for (dimension, area) in dimensions.iter().zip(areas) {
        assert!((dimension.value / area - 1.0).abs() < 1e-6);
    }
    // A sphere without its circle, or with two, and a rim of no dome.
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("w.json");
    write_json(&path, &document).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    for (sound, broken) in [
        ("\"rim\":0", "\"rim\":2"),
        ("\"reach\":1.5707963267948966", "\"reach\":3.2"),
        ("\"reach\":1.5707963267948966", "\"reach\":0"),
    ] {
        assert!(text.contains(sound), "{sound}");
        fs::write(&path, text.replacen(sound, broken, 1)).unwrap();
        assert!(read_json(&path).is_err(), "{broken}");
    }
}

/// Every side has two triangles.
fn assert_watertight(document: &WireframeDocument) {
    let mut sides: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    for triangle in document.drawn_triangles() {
        for [a, b] in [[0, 1], [1, 2], [2, 0]].map(|side| side.map(|k| triangle[k])) {
            *sides.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    assert!(sides.values().all(|count| *count == 2));
}

#[test]
fn inferred_lines_bound_faces_of_solids_and_are_no_edges() {
    let document = rounded();
    assert!(document.shells[0].closed);
    let step = exported(&document, Format::Step, EdgeFilter::default());
    assert_eq!(count(&step, "MANIFOLD_SOLID_BREP"), 1);
    assert_eq!(count(&step, "ADVANCED_FACE"), 7);
    // Eleven edges, two arcs and two inferred lines, which say so.
    assert_eq!(count(&step, "EDGE_CURVE"), 15);
    assert_eq!(step.matches("EDGE_CURVE('inferred',").count(), 2);
    let json = exported(&document, Format::Json, EdgeFilter::default());
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(value["edges"].as_array().unwrap().len(), 11);
    assert_eq!(json.matches("\"smooth\"").count(), 4);
    let again: WireframeDocument = serde_json::from_str(&json).unwrap();
    assert_eq!(again.shells, document.shells);
    assert_watertight(&document);
}

#[test]
fn edges_that_no_image_shows_say_so_too() {
    let mut document = rounded();
    let mut inferred = vec![false; document.edges.len()];
    inferred[2] = true;
    document.edge_fields.inferred = Some(inferred);
    let step = exported(&document, Format::Step, EdgeFilter::default());
    assert_eq!(step.matches("EDGE_CURVE('inferred',").count(), 3);
    let json = exported(&document, Format::Json, EdgeFilter::default());
    let again: WireframeDocument = serde_json::from_str(&json).unwrap();
    assert_eq!(again.edge_fields, document.edge_fields);
}

#[test]
fn inferred_lines_follow_their_junctions_through_a_filter() {
    let mut document = rounded();
    document.junctions.insert(0, Vector3::new(5.0, 5.0, 5.0));
    document
        .edges
        .iter_mut()
        .for_each(|edge| *edge = edge.map(|end| end + 1));
    let faces = document
        .shells
        .iter_mut()
        .flat_map(|shell| &mut shell.faces);
    for step in faces.flat_map(|face| &mut face.loops).flatten() {
        if let CurveIndex::Smooth(ends) = &mut step.curve {
            *ends = ends.map(|end| end + 1);
        }
    }
    document.check(Path::new("w")).unwrap();
    let mut fields = BTreeMap::new();
    fields.insert("probability".to_owned(), vec![1.0; document.edges.len()]);
    document.edge_fields = serde_json::from_value(serde_json::json!(fields)).unwrap();
    let filter = EdgeFilter {
        min_probability: Some(0.5),
        ..EdgeFilter::default()
    };
    // The lonely junction goes, and all others are counted anew.
    let kept = filter.apply(&document).unwrap();
    kept.check(Path::new("w")).unwrap();
    assert_eq!(kept.shells, rounded().shells);
}
