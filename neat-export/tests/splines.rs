//! Splines in the exports: one with ends and one that runs around.

use nalgebra::Vector3;
use neat_core::Spline;
use neat_core::npz::NpzReader;
use neat_export::{EdgeFilter, ExportOptions, Format, ViewDirection, Written, export};
use neat_wireframe::export::{SupportingSegment, WireframeDocument, read_json};
use std::fs;
use std::path::Path;

fn document() -> WireframeDocument {
    read_json(Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/data/arcs.json"
    )))
    .unwrap()
}

fn exported(format: Format) -> (Written, Vec<u8>) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("w");
    let options = ExportOptions {
        direction: ViewDirection::Top,
        ..ExportOptions::default()
    };
    let written = export(&document(), &path, format, &options).unwrap();
    let bytes = fs::read(&path).unwrap_or_default();
    (written, bytes)
}

fn text(format: Format) -> String {
    String::from_utf8(exported(format).1).unwrap()
}

/// All numbers of a text in their order.
fn numbers(text: &str) -> Vec<f64> {
    text.split(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c)))
        .filter_map(|word| word.parse().ok())
        .collect()
}

#[test]
fn every_format_counts_them() {
    for format in Format::ALL {
        if format == Format::Limap {
            continue;
        }
        let (written, _) = exported(format);
        let lacking = matches!(format, Format::Colmap | Format::CityJson);
        assert_eq!(written.splines, if lacking { 0 } else { 2 }, "{format:?}");
        let said = written.remarks.iter().filter(|r| r.contains("no splines"));
        assert_eq!(said.count(), usize::from(lacking), "{:?}", written.remarks);
    }
}

#[test]
fn line_tracks_have_none() {
    let mut document = document();
    document.views = vec!["a".into()];
    let support = SupportingSegment {
        view: 0,
        segment: [0.0, 0.0, 1.0, 1.0],
        residual: 0.0,
    };
    document.edge_support = vec![vec![support]; document.edges.len()];
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("w");
    let written = export(&document, &path, Format::Limap, &ExportOptions::default()).unwrap();
    let remark = "line tracks are straight and no splines: 2 left out";
    assert!(written.remarks.iter().any(|said| said == remark));
}

#[test]
fn a_filter_keeps_them_and_says_so() {
    let mut document = document();
    document.edge_fields.probability = Some(vec![0.0; document.edges.len()]);
    let filter = EdgeFilter {
        min_probability: Some(0.5),
        ..EdgeFilter::default()
    };
    let kept = filter.apply(&document).unwrap();
    assert_eq!(
        (kept.edges.len(), kept.splines),
        (0, document.splines.clone())
    );
    let dir = tempfile::tempdir().unwrap();
    let options = ExportOptions {
        filter,
        ..ExportOptions::default()
    };
    let written = export(&document, &dir.path().join("w"), Format::Json, &options).unwrap();
    assert!(
        written
            .remarks
            .iter()
            .any(|said| said.starts_with("splines have neither"))
    );
}

#[test]
fn steps_are_clamped_and_pass_through_the_same_points() {
    let step = text(Format::Step);
    let point = |name: &str| {
        let line = step
            .lines()
            .find(|line| line.starts_with(&format!("{name}=")));
        Vector3::from_row_slice(&numbers(line.unwrap().split_once('(').unwrap().1))
    };
    let curves = step
        .lines()
        .filter(|line| line.contains("=B_SPLINE_CURVE_WITH_KNOTS("));
    let curves: Vec<&str> = curves.collect();
    assert_eq!(curves.len(), 2);
    for (spline, curve) in document().splines.iter().zip(curves) {
        let lists: Vec<&str> = curve.split('(').collect();
        let names = lists[2].split(')').next().unwrap();
        let controls: Vec<Vector3<f64>> = names.split(',').map(point).collect();
        let pieces = spline.pieces();
        assert_eq!(controls.len(), pieces + 3);
        assert_eq!(numbers(lists[3]).iter().sum::<f64>(), (pieces + 7) as f64);
        assert_eq!(numbers(lists[4]).len(), pieces + 1);
        assert_eq!(controls[0] == controls[pieces + 2], spline.closed);
        // With these knots it is what an open spline is.
        let clamped = Spline {
            controls,
            closed: false,
        };
        for k in 0..=40 {
            let place = pieces as f64 * f64::from(k) / 40.0;
            let off = (clamped.point_at(place) - spline.point_at(place)).norm();
            assert!(off < 1e-12, "{place}: {off}");
        }
    }
}

#[test]
fn pictures_have_their_control_points() {
    let svg = text(Format::Svg);
    let (_, group) = svg.split_once("<g id=\"splines\"").unwrap();
    let paths: Vec<&str> = group.split("<path data-spline=").skip(1).collect();
    assert_eq!(paths.len(), 2);
    let root = |name: &str| numbers(svg.split_once(name).unwrap().1.split('"').nth(1).unwrap());
    let (center, scale) = (root("data-center="), root("data-scale=")[0]);
    let size = [root(" width=")[0], root(" height=")[0]];
    for (spline, path) in document().splines.iter().zip(paths) {
        let (_, commands) = path.split_once("d=\"M").unwrap();
        let found = numbers(commands.split('"').next().unwrap());
        let beziers = spline.beziers();
        let rest = beziers.iter().flat_map(|controls| &controls[1..]);
        let expected: Vec<_> = [&beziers[0][0]].into_iter().chain(rest).collect();
        assert_eq!(found.len(), 2 * expected.len());
        for (pixel, point) in found.chunks(2).zip(expected) {
            let x = center[0] + (pixel[0] - 0.5 * size[0]) / scale;
            let y = center[1] - (pixel[1] - 0.5 * size[1]) / scale;
            assert!((x - point.x).abs().max((y - point.y).abs()) < 1e-6);
        }
    }
}

#[test]
fn chains_are_on_a_layer_and_in_a_group_of_their_own() {
    let splines = document().splines;
    let chains = splines
        .iter()
        .map(|s| s.points(WireframeDocument::TURN_OF_DRAWN_ARCS));
    let chains: Vec<Vec<Vector3<f64>>> = chains.collect();
    let dxf = text(Format::Dxf);
    let flags: Vec<&str> = dxf.split("\nPOLYLINE\n8\nSPLINES\n").skip(1).collect();
    assert_eq!(flags.len(), 2);
    for ((polyline, chain), closed) in flags.iter().zip(&chains).zip([false, true]) {
        let (polyline, _) = polyline.split_once("\nSEQEND\n").unwrap();
        let vertices = polyline.matches("\nVERTEX\n").count();
        assert_eq!(vertices, chain.len() - usize::from(closed));
        assert!(polyline.contains(if closed { "\n70\n9\n" } else { "\n70\n8\n" }));
    }
    let gltf = text(Format::Gltf);
    assert!(gltf.contains("\"name\":\"arcs\"") && gltf.contains("\"name\":\"splines\""));
    let geojson: serde_json::Value = serde_json::from_str(&text(Format::GeoJson)).unwrap();
    let features = geojson["features"].as_array().unwrap().iter();
    let of_splines = features.filter(|feature| feature["properties"]["spline"].is_u64());
    for (feature, (spline, chain)) in of_splines.zip(splines.iter().zip(&chains)) {
        assert_eq!(feature["geometry"]["coordinates"], serde_json::json!(chain));
        assert_eq!(feature["properties"]["closed"], spline.closed);
    }
}

#[test]
fn arrays_hold_their_control_points() {
    let mut npz = NpzReader::from_bytes(exported(Format::Npz).1, Path::new("w.npz")).unwrap();
    let stored = npz.array("spline_controls").unwrap();
    let splines = document().splines;
    let controls = splines.iter().flat_map(|spline| &spline.controls);
    assert_eq!(
        stored.values,
        controls.flatten().copied().collect::<Vec<f64>>()
    );
    assert_eq!(stored.shape, [10, 3]);
}
