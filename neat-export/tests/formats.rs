//! Every format, read back by a parser that shares nothing with its writer.

mod parsers;

use nalgebra::Vector3;
use neat_core::file;
use neat_export::{
    EdgeFilter, ExportError, ExportOptions, Format, LengthUnit, ViewDirection, export,
};
use neat_wireframe::Wireframe3d;
use neat_wireframe::export::WireframeDocument;
use parsers::parse;
use proptest::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};

/// Formats whose files hold every bit of every coordinate.
const EXACT: [Format; 8] = [
    Format::Json,
    Format::Obj,
    Format::Ply,
    Format::Dxf,
    Format::Step,
    Format::GeoJson,
    Format::Npz,
    Format::Colmap,
];

/// The formats that need nothing but a graph: LIMAP's tracks are made of 2D segments, and CityJSON
/// of faces.
fn of_a_graph() -> impl Iterator<Item = Format> {
    let all = Format::ALL.into_iter();
    all.filter(|format| !matches!(format, Format::Limap | Format::CityJson))
}

fn write(document: &WireframeDocument, path: &Path, format: Format) -> Result<(), ExportError> {
    export(document, path, format, &ExportOptions::default()).map(|_| ())
}

/// A fresh place for a file or, for COLMAP, a folder.
fn place(dir: &tempfile::TempDir, format: Format) -> PathBuf {
    dir.path().join(format!("wireframe.{}", format.name()))
}

/// A pyramid far from the origin, as of UTM coordinates in metres, with edges of all
/// classes and a name that means to break things.
fn document() -> WireframeDocument {
    let corners = [
        [0.0, 0.0, 0.0],
        [4.25, 0.1, 0.0],
        [4.0, 1.0 / 3.0, 1e-7],
        [0.0, 3.0, -0.0],
        [2.0, 1.5, 7.5],
    ];
    let utm = Vector3::new(500_000.0, 5_400_000.0, 312.5);
    let mut document = WireframeDocument {
        junctions: corners.iter().map(|p| utm + Vector3::from(*p)).collect(),
        edges: vec![
            [0, 1],
            [1, 2],
            [3, 2],
            [3, 0],
            [0, 4],
            [4, 1],
            [2, 4],
            [4, 3],
        ],
        ..WireframeDocument::default()
    };
    let probabilities = vec![1.0, 0.9, 0.89, 0.5, 0.49, 0.0, 0.95, 0.7];
    document.edge_fields.probability = Some(probabilities);
    let hostile = "</title><script>alert('x')&\"]]>\\\0\n\u{7}#99=ä😀\u{ffff}";
    document.metadata.insert("scene".into(), hostile.into());
    document
}

fn of(junctions: Vec<Vector3<f64>>, edges: Vec<[usize; 2]>) -> WireframeDocument {
    WireframeDocument::from(&Wireframe3d { junctions, edges })
}

/// The graph that a format can hold of a document: STEP has no vertices without edges
/// and no edges without length.
fn held(document: &WireframeDocument, format: Format) -> Wireframe3d {
    let mut wireframe = document.wireframe();
    if format == Format::Step {
        let all = wireframe.junctions.clone();
        wireframe.edges.retain(|[a, b]| all[*a] != all[*b]);
    }
    wireframe
}

fn bits(points: &[Vector3<f64>]) -> Vec<[u64; 3]> {
    points
        .iter()
        .map(|p| [p.x, p.y, p.z].map(f64::to_bits))
        .collect()
}

/// The ends of every edge in space, sorted: DXF knows positions only, and glTF sorts
/// edges by confidence.
fn positions(wireframe: &Wireframe3d) -> Vec<[Vec<f64>; 2]> {
    let position = |end: usize| wireframe.junctions[end].as_slice().to_vec();
    let mut edges: Vec<_> = wireframe
        .edges
        .iter()
        .map(|ends| ends.map(position))
        .collect();
    edges.sort_by(|a, b| a.partial_cmp(b).unwrap());
    edges
}

fn sorted(mut edges: Vec<[usize; 2]>) -> Vec<[usize; 2]> {
    edges.sort_unstable();
    edges
}

#[test]
fn exact_formats_keep_every_bit_and_shared_vertices() {
    let far = of(
        vec![
            Vector3::new(0.1, 1.0 / 3.0, -0.0),
            Vector3::new(f64::MIN_POSITIVE, 1e300, 5e-324),
            Vector3::new(-123_456_789.123_456_79, 2.0, 1e-7),
            Vector3::new(f64::EPSILON, f64::MAX, -1e22),
        ],
        vec![[0, 1], [1, 2], [2, 3], [0, 2]],
    );
    for document in [document(), far] {
        for format in EXACT {
            let dir = tempfile::tempdir().unwrap();
            let path = place(&dir, format);
            write(&document, &path, format).unwrap();
            let read = parse(&path, format);
            assert_eq!(
                bits(&read.junctions),
                bits(&document.junctions),
                "{format:?}"
            );
            assert_eq!(read.edges, document.edges, "{format:?}");
        }
    }
}

#[test]
fn gltf_is_accurate_far_from_the_origin() {
    let dir = tempfile::tempdir().unwrap();
    for format in [Format::Gltf, Format::Glb] {
        let path = place(&dir, format);
        write(&document(), &path, format).unwrap();
        let read = parse(&path, format);
        assert_eq!(sorted(read.edges), sorted(document().edges));
        for (read, junction) in read.junctions.iter().zip(&document().junctions) {
            assert!((read - junction).norm() < 1e-6, "{read} {junction}");
        }
    }
}

#[test]
fn pictures_show_the_projection() {
    let dir = tempfile::tempdir().unwrap();
    for direction in ViewDirection::ALL {
        let options = ExportOptions {
            direction,
            width: 400,
            ..ExportOptions::default()
        };
        let [svg, png] = ["w.svg", "w.png"].map(|name| dir.path().join(name));
        export(&document(), &svg, Format::Svg, &options).unwrap();
        export(&document(), &png, Format::Png, &options).unwrap();
        let view = parsers::svg(&svg);
        let [right, up] = direction.right_and_up();
        let projected = |p: &Vector3<f64>| [right.dot(p), up.dot(p)];
        assert_eq!(view.lines.len(), document().edges.len());
        for (line, edge) in view.lines.iter().zip(&document().edges) {
            for (found, junction) in line.iter().zip(edge) {
                let expected = projected(&document().junctions[*junction]);
                for (found, expected) in found.iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-6, "{direction:?}");
                }
            }
        }
        let image = image::open(&png).unwrap().into_rgb8();
        assert_eq!(image.dimensions(), (view.width, view.height));
        assert_eq!(image.get_pixel(0, 0).0, [255; 3]);
        for [x, y] in view.circles {
            assert!(image.get_pixel(x as u32, y as u32).0[2] < 100);
        }
    }
}

#[test]
fn hostile_names_stay_text() {
    let dir = tempfile::tempdir().unwrap();
    for format in [Format::Svg, Format::Step, Format::Dxf, Format::Json] {
        write(&document(), &place(&dir, format), format).unwrap();
    }
    let svg = fs::read_to_string(place(&dir, Format::Svg)).unwrap();
    let title = "<title>&lt;/title&gt;&lt;script&gt;alert('x')&amp;\"]]&gt;\\\u{fffd} \u{fffd}#99=ä😀\u{fffd}</title>";
    assert!(svg.contains(title) && !svg.contains("<script"), "{svg}");
    let step = fs::read_to_string(place(&dir, Format::Step)).unwrap();
    assert!(step.is_ascii());
    assert!(step.contains("alert(''x'')&\"]]>\\\\  "));
    // A line per entity, still.
    assert!(step.lines().all(|line| !line.starts_with("#99=\\")));
    let dxf = fs::read_to_string(place(&dir, Format::Dxf)).unwrap();
    assert!(!dxf.contains("script"));
}

#[test]
fn empty_wireframes_and_lonely_junctions_are_valid_files() {
    let nothing = WireframeDocument::default();
    let lonely = of(vec![Vector3::new(1.0, 2.0, 3.0), Vector3::zeros()], vec![]);
    let degenerate = of(
        vec![
            Vector3::repeat(1.0),
            Vector3::repeat(2.0),
            Vector3::repeat(1.0),
        ],
        vec![[0, 1], [1, 1], [0, 2]],
    );
    for document in [nothing, lonely, degenerate] {
        for format in of_a_graph() {
            let dir = tempfile::tempdir().unwrap();
            let path = place(&dir, format);
            write(&document, &path, format).unwrap();
            match format {
                Format::Svg => {
                    let view = parsers::svg(&path);
                    assert_eq!(view.lines.len(), document.edges.len());
                    assert_eq!(view.circles.len(), document.junctions.len());
                }
                Format::Png => {
                    image::open(&path).unwrap();
                }
                _ => {
                    let read = parse(&path, format);
                    let held = held(&document, format);
                    assert_eq!(read.junctions, held.junctions, "{format:?}");
                    assert_eq!(positions(&read), positions(&held), "{format:?}");
                }
            }
        }
    }
}

#[test]
fn what_step_lacks_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("w.step");
    let document = of(
        vec![Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()],
        vec![[0, 1], [2, 2]],
    );
    let options = ExportOptions {
        unit: LengthUnit::Metre,
        ..ExportOptions::default()
    };
    let written = export(&document, &path, Format::Step, &options).unwrap();
    assert_eq!((written.junctions, written.edges), (4, 2));
    assert_eq!(written.files, std::slice::from_ref(&path));
    let [edges, vertices] = &written.remarks[..] else {
        panic!("{:?}", written.remarks);
    };
    assert!(edges.ends_with("edges without length: 1 left out"));
    // The junction of that edge is alone, too.
    assert!(vertices.ends_with("junctions without edges: 2 left out"));
    assert!(
        fs::read_to_string(path)
            .unwrap()
            .contains("SI_UNIT($,.METRE.)")
    );
}

#[test]
fn layers_and_properties_tell_the_confidence() {
    let dir = tempfile::tempdir().unwrap();
    let classes = [
        "HIGH", "HIGH", "MEDIUM", "MEDIUM", "LOW", "LOW", "HIGH", "MEDIUM",
    ];
    let path = place(&dir, Format::Dxf);
    write(&document(), &path, Format::Dxf).unwrap();
    assert_eq!(
        parsers::dxf_layers(&path),
        classes.map(|c| format!("CONFIDENCE_{c}"))
    );

    let path = place(&dir, Format::GeoJson);
    write(&document(), &path, Format::GeoJson).unwrap();
    let value: serde_json::Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    for (edge, class) in classes.iter().enumerate() {
        let properties = &value["features"][edge]["properties"];
        assert_eq!(properties["confidence"], class.to_lowercase());
        assert_eq!(
            properties["probability"],
            document().edge_fields.named()["probability"][edge]
        );
    }
}

#[test]
fn the_filter_acts_in_every_format() {
    let options = ExportOptions {
        filter: EdgeFilter {
            min_probability: Some(0.9),
            ..EdgeFilter::default()
        },
        ..ExportOptions::default()
    };
    for format in EXACT {
        let dir = tempfile::tempdir().unwrap();
        let path = place(&dir, format);
        let written = export(&document(), &path, format, &options).unwrap();
        assert_eq!((written.junctions, written.edges), (4, 3));
        let read = parse(&path, format);
        // Junction 3 is gone.
        assert_eq!(read.edges, [[0, 1], [1, 2], [2, 3]]);
        assert_eq!(read.junctions[3], document().junctions[4]);
    }
}

#[test]
fn bad_documents_and_options_write_nothing() {
    let mut nan = document();
    nan.junctions[1].z = f64::NAN;
    let mut dangling = document();
    dangling.edges.push([0, 5]);
    let mut short = document();
    short.junction_fields.sigma = Some(vec![1.0]);
    for format in Format::ALL {
        let dir = tempfile::tempdir().unwrap();
        let path = place(&dir, format);
        if !format.is_folder() {
            fs::write(&path, "old").unwrap();
        }
        for bad in [&nan, &dangling, &short] {
            let error = write(bad, &path, format).unwrap_err();
            assert!(error.to_string().contains("wireframe."), "{error}");
        }
        for width in [0, 15, 8193, u32::MAX] {
            let options = ExportOptions {
                width,
                ..ExportOptions::default()
            };
            let error = export(&document(), &path, format, &options).unwrap_err();
            assert!(error.to_string().contains("16 to 8192"), "{error}");
        }
        match format {
            _ if format.is_folder() => assert!(!path.exists()),
            _ => assert_eq!(fs::read(&path).unwrap(), b"old"),
        }
        let nowhere = dir.path().join("missing/below/file");
        if !format.is_folder() {
            let error = write(&document(), &nowhere, format).unwrap_err();
            assert!(error.to_string().contains("missing"), "{error}");
        }
    }
}

#[test]
fn a_folder_with_files_is_not_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("model");
    write(&document(), &path, Format::Colmap).unwrap();
    let error = write(&document(), &path, Format::Colmap).unwrap_err();
    assert!(error.to_string().contains("empty folder"), "{error}");
}

#[test]
fn writing_twice_gives_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        if format.is_folder() {
            continue;
        }
        let bytes = ["a", "b"].map(|name| {
            let path = dir.path().join(name);
            write(&document(), &path, format).unwrap();
            file::read(&path, "").unwrap()
        });
        assert_eq!(bytes[0], bytes[1], "{format:?}");
    }
}

#[test]
fn extents_beyond_a_format_are_errors() {
    let dir = tempfile::tempdir().unwrap();
    let spread = |x: f64| of(vec![Vector3::repeat(-x), Vector3::repeat(x)], vec![[0, 1]]);
    for (x, format, fits) in [
        (f64::MAX, Format::Svg, false),
        (f64::MAX, Format::Png, false),
        (f64::MAX, Format::Glb, false),
        (1e200, Format::Gltf, false),
        (1e-40, Format::Glb, false),
        (1e37, Format::Glb, true),
        (1e-29, Format::Gltf, true),
        (1e200, Format::Svg, true),
        (1e-200, Format::Png, true),
    ] {
        let result = write(&spread(x), &place(&dir, format), format);
        match result {
            Ok(()) => assert!(fits, "{x} {format:?}"),
            Err(error) => {
                assert!(
                    !fits && matches!(error, ExportError::OutOfRange { .. }),
                    "{x} {error}"
                );
            }
        }
    }
}

/// Any finite wireframe.
fn any_wireframe() -> impl Strategy<Value = WireframeDocument> {
    let number = prop_oneof![
        4 => -10.0..10.0f64,
        1 => prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
    ];
    let points = prop::collection::vec([number.clone(), number.clone(), number], 1..9);
    points.prop_flat_map(|points| {
        let end = 0..points.len();
        let edges = prop::collection::vec([end.clone(), end], 0..12);
        edges.prop_map(move |edges| of(points.iter().map(|p| Vector3::from(*p)).collect(), edges))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_wireframe_reads_back_or_is_refused(document in any_wireframe()) {
        for format in of_a_graph() {
            let dir = tempfile::tempdir().unwrap();
            let path = place(&dir, format);
            let options = ExportOptions { width: 32, ..ExportOptions::default() };
            match export(&document, &path, format, &options) {
                Ok(written) if EXACT.contains(&format) => {
                    let read = parse(&path, format);
                    prop_assert_eq!(bits(&read.junctions), bits(&document.junctions));
                    if written.remarks.is_empty() {
                        prop_assert_eq!(positions(&read), positions(&document.wireframe()));
                    }
                }
                Ok(_) => {}
                Err(error) => {
                    prop_assert!(!EXACT.contains(&format), "{error}");
                    let refused = matches!(error, ExportError::OutOfRange { .. });
                    prop_assert!(refused, "{}", error);
                }
            }
        }
    }
}
