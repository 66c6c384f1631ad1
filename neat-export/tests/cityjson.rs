//! Buildings in CityJSON: a gable house with a passage through it, beside it a canopy and an edge.

use nalgebra::{Matrix3, Rotation3, Vector3};
use neat_core::Wireframe3d;
use neat_export::{ExportError, ExportOptions, Format, UpAxis, export};
use neat_wireframe::export::{WireframeDocument, read_json};
use neat_wireframe::faces::{MeasuredGraph, find_shells};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Of the house: (48 + 12) m² of a gable, 10 m long, less a passage of 3 m by 3 m.
const VOLUME: f64 = 60.0 * 10.0 - 9.0 * 8.0;

/// As it was drawn up: metres, z up, one corner of the house at the origin.
fn drawn_up() -> Wireframe3d {
    let gable = [[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [4.0, 9.0], [0.0, 6.0]];
    let passage = [[3.0, 1.0], [6.0, 1.0], [6.0, 4.0], [3.0, 4.0]];
    let canopy = [[3.0, -2.0], [6.0, -2.0], [6.0, -0.5], [3.0, -0.5]];
    let mut junctions = Vec::new();
    for x in [0.0, 10.0] {
        junctions.extend(gable.map(|[y, z]| Vector3::new(x, y, z)));
    }
    for y in [0.0, 8.0] {
        junctions.extend(passage.map(|[x, z]| Vector3::new(x, y, z)));
    }
    junctions.extend(canopy.map(|[x, y]| Vector3::new(x, y, 4.5 + 0.2 * y)));
    junctions.extend([12.0, 13.0].map(|x| Vector3::new(x, 1.0, 1.0)));
    let ring = |first: usize, n: usize| (0..n).map(move |i| [first + i, first + (i + 1) % n]);
    let across = |first: usize, n: usize| (0..n).map(move |i| [first + i, first + n + i]);
    let prism = |first, n| {
        ring(first, n)
            .chain(ring(first + n, n))
            .chain(across(first, n))
    };
    let edges = prism(0, 5).chain(prism(10, 4)).chain(ring(18, 4));
    Wireframe3d {
        junctions,
        edges: edges.chain([[22, 23]]).collect(),
    }
}

/// With the faces that are found in it.
fn with_shells(wireframe: &Wireframe3d, covariances: &[Option<Matrix3<f64>>]) -> WireframeDocument {
    let graph = MeasuredGraph {
        covariances,
        ..MeasuredGraph::of(wireframe)
    };
    WireframeDocument {
        shells: find_shells(&graph, &[], &[]),
        ..WireframeDocument::from(wireframe)
    }
}

/// The house as tests/data has it: turned about z, at UTM coordinates.
fn house() -> WireframeDocument {
    read_json(Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/data/house.json"
    )))
    .unwrap()
}

fn exported(document: &WireframeDocument, options: &ExportOptions) -> (Value, Vec<String>) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("house.city.json");
    let written = export(document, &path, Format::CityJson, options).unwrap();
    let value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    (value, written.remarks)
}

fn items(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

fn triple(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator(items(value).iter().map(|x| x.as_f64().unwrap()))
}

/// The rings of each surface of a building's only geometry, and what the surface is.
fn surfaces(city: &Value, building: &str) -> Vec<(Vec<Vec<usize>>, String)> {
    let geometry = &city["CityObjects"][building]["geometry"][0];
    let (mut boundaries, mut values) = (&geometry["boundaries"], &geometry["semantics"]["values"]);
    if geometry["type"] == "Solid" {
        assert_eq!(items(boundaries).len(), 1, "one shell");
        (boundaries, values) = (&boundaries[0], &values[0]);
    }
    let ring = |ring: &Value| -> Vec<usize> {
        items(ring)
            .iter()
            .map(|i| i.as_u64().unwrap() as usize)
            .collect()
    };
    assert_eq!(items(boundaries).len(), items(values).len());
    let surfaces = items(boundaries).iter().zip(items(values));
    surfaces
        .map(|(rings, value)| {
            let surface = &geometry["semantics"]["surfaces"][value.as_u64().unwrap() as usize];
            (
                items(rings).iter().map(ring).collect(),
                surface["type"].as_str().unwrap().to_owned(),
            )
        })
        .collect()
}

fn counts(surfaces: &[(Vec<Vec<usize>>, String)]) -> BTreeMap<&str, usize> {
    let mut counts = BTreeMap::new();
    for (_, name) in surfaces {
        *counts.entry(name.as_str()).or_default() += 1;
    }
    counts
}

fn coordinates(city: &Value) -> Vec<Vector3<f64>> {
    let (scale, translate) = (&city["transform"]["scale"], &city["transform"]["translate"]);
    let vertices = items(&city["vertices"]).iter();
    vertices
        .map(|vertex| {
            assert!(items(vertex).iter().all(Value::is_i64));
            triple(vertex).component_mul(&triple(scale)) + triple(translate)
        })
        .collect()
}

/// By Gauss' theorem; every side has to have its opposite.
fn volume(city: &Value, building: &str) -> f64 {
    let points = coordinates(city);
    let origin = points[0];
    let mut sides: BTreeMap<[usize; 2], i32> = BTreeMap::new();
    let mut sum = 0.0;
    for (rings, _) in surfaces(city, building) {
        let mut area = Vector3::zeros();
        for ring in &rings {
            for (k, a) in ring.iter().enumerate() {
                let b = &ring[(k + 1) % ring.len()];
                assert!(sides.insert([*a, *b], 1).is_none(), "a side twice");
                area += (points[*a] - origin).cross(&(points[*b] - origin)) / 2.0;
            }
        }
        sum += (points[rings[0][0]] - origin).dot(&area) / 3.0;
    }
    assert!(sides.keys().all(|[a, b]| sides.contains_key(&[*b, *a])));
    sum
}

const OF_HOUSE: [(&str, usize); 5] = [
    ("GroundSurface", 1),
    ("OuterCeilingSurface", 1),
    ("OuterFloorSurface", 1),
    ("RoofSurface", 2),
    ("WallSurface", 6),
];

#[test]
fn a_closed_house_is_a_solid_with_ground_walls_and_roofs() {
    let document = house();
    let (city, remarks) = exported(&document, &ExportOptions::default());
    assert_eq!(
        (&city["type"], &city["version"]),
        (&"CityJSON".into(), &"2.0".into())
    );
    assert_eq!(city["metadata"]["title"], "house");
    assert_eq!(city["CityObjects"]["building-1"]["type"], "Building");
    assert_eq!(
        city["CityObjects"]["building-1"]["geometry"][0]["type"],
        "Solid"
    );
    let surfaces = surfaces(&city, "building-1");
    assert_eq!(counts(&surfaces), BTreeMap::from(OF_HOUSE));
    // The passage is a hole in two walls.
    let with_hole = surfaces.iter().filter(|(rings, _)| rings.len() == 2);
    assert!(with_hole.clone().all(|(_, name)| name == "WallSurface"));
    assert_eq!(with_hole.count(), 2);
    assert!((volume(&city, "building-1") / VOLUME - 1.0).abs() < 1e-6);
    // Every junction of a face is one vertex, at its place to a ten-millionth of the extent.
    let points = coordinates(&city);
    assert_eq!(points.len(), 22);
    for junction in &document.junctions[..22] {
        assert!(points.iter().any(|point| (point - junction).norm() < 2e-6));
    }
    assert_eq!(remarks, ["CityJSON has no edges without faces: 1 left out"]);
}

#[test]
fn sheets_are_surfaces_of_one_more_building() {
    let (city, _) = exported(&house(), &ExportOptions::default());
    assert_eq!(city["CityObjects"].as_object().unwrap().len(), 2);
    let geometry = &city["CityObjects"]["building-2"]["geometry"][0];
    assert_eq!(geometry["type"], "MultiSurface");
    let surfaces = surfaces(&city, "building-2");
    assert_eq!(surfaces.len(), 1);
    // No view says which side of the canopy is seen.
    assert!(["RoofSurface", "OuterCeilingSurface"].contains(&surfaces[0].1.as_str()));
}

#[test]
fn the_file_of_the_house_is_what_was_drawn_up() {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.4);
    let moved = Vector3::new(500_000.0, 5_400_000.0, 312.5);
    let mut wireframe = drawn_up();
    for junction in &mut wireframe.junctions {
        *junction = turn * *junction + moved;
    }
    let mut document = with_shells(&wireframe, &[]);
    document.metadata.insert("scene".into(), "house".into());
    // To write it anew: `NEAT_UPDATE_HOUSE=1 cargo test -p neat-export --test cityjson`.
    if std::env::var_os("NEAT_UPDATE_HOUSE").is_some() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/house.json");
        neat_wireframe::export::write_json(Path::new(path), &document).unwrap();
    }
    let house = house();
    assert_eq!(house.edges, document.edges);
    for (a, b) in house.junctions.iter().zip(&document.junctions) {
        assert!((a - b).norm() < 1e-8);
    }
    let faces = |document: &WireframeDocument| -> Vec<(bool, usize)> {
        let shells = document.shells.iter();
        shells
            .map(|shell| (shell.closed, shell.faces.len()))
            .collect()
    };
    assert_eq!(faces(&house), [(true, 11), (false, 1)]);
    assert_eq!(faces(&document), faces(&house));
}

#[test]
fn noise_of_a_centimetre_changes_no_surface() {
    let sigma = 0.01;
    for seed in 0..8 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut wireframe = drawn_up();
        for junction in &mut wireframe.junctions {
            // A sum of uniform numbers, of the variance sigma².
            let noise = || (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
            *junction += sigma
                * Vector3::from_fn({
                    let mut noise = noise;
                    move |_, _| noise()
                });
        }
        let covariance = Some(Matrix3::identity() * sigma * sigma);
        let covariances = vec![covariance; wireframe.junctions.len()];
        let document = with_shells(&wireframe, &covariances);
        let (city, _) = exported(&document, &ExportOptions::default());
        let surfaces = surfaces(&city, "building-1");
        assert_eq!(counts(&surfaces), BTreeMap::from(OF_HOUSE), "seed {seed}");
        let ratio = volume(&city, "building-1") / VOLUME;
        assert!((ratio - 1.0).abs() < 0.01, "seed {seed}: {ratio}");
    }
}

#[test]
fn what_is_up_is_turned_to_z() {
    // Coordinates (x, y, z) of the house become (x, −z, y): −y is up, as in images.
    let wireframe = Wireframe3d {
        junctions: (drawn_up().junctions.iter())
            .map(|p| Vector3::new(p.x, -p.z, p.y))
            .collect(),
        edges: drawn_up().edges,
    };
    let document = with_shells(&wireframe, &[]);
    let options = ExportOptions {
        up: UpAxis::MinusY,
        ..ExportOptions::default()
    };
    let (city, _) = exported(&document, &options);
    assert_eq!(
        counts(&surfaces(&city, "building-1")),
        BTreeMap::from(OF_HOUSE)
    );
    assert!((volume(&city, "building-1") / VOLUME - 1.0).abs() < 1e-6);
    let heights: Vec<f64> = coordinates(&city).iter().map(|p| p.z).collect();
    let highest = heights.iter().copied().fold(f64::MIN, f64::max);
    assert!((highest - 9.0).abs() < 1e-5, "{highest}");
    // Taken for z, the axis makes other surfaces of them.
    let (city, _) = exported(&document, &ExportOptions::default());
    assert_ne!(
        counts(&surfaces(&city, "building-1")),
        BTreeMap::from(OF_HOUSE)
    );
}

#[test]
fn round_faces_are_triangles_of_a_watertight_solid() {
    let document = read_json(Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/data/solid.json"
    )))
    .unwrap();
    let (city, remarks) = exported(&document, &ExportOptions::default());
    assert!(volume(&city, "building-1") > 0.0);
    assert!(surfaces(&city, "building-1").len() > 100);
    assert_eq!(remarks.len(), 2, "an edge and an arc without faces");
}

#[test]
fn without_faces_there_is_no_building() {
    let mut document = house();
    document.shells.clear();
    let (city, remarks) = exported(&document, &ExportOptions::default());
    assert_eq!(city["CityObjects"].as_object().unwrap().len(), 0);
    assert_eq!(items(&city["vertices"]).len(), 0);
    assert_eq!(
        remarks,
        ["CityJSON has no edges without faces: 32 left out"]
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    /// In whatever unit: the whole numbers have seven or eight digits.
    #[test]
    fn any_unit_has_whole_numbers(power in -300..300i32, far in -1e6..1e6f64) {
        let unit = 10f64.powi(power);
        let document = house();
        let origin = document.junctions[0];
        let scaled = |p: &Vector3<f64>| (p - origin + Vector3::repeat(far)) * unit;
        let scaled = WireframeDocument {
            junctions: document.junctions.iter().map(scaled).collect(),
            shells: document.shells.iter().map(|shell| shell.map(scaled)).collect(),
            ..document
        };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("house.city.json");
        match export(&scaled, &path, Format::CityJson, &ExportOptions::default()) {
            Ok(_) => {
                let city: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
                let largest = items(&city["vertices"]).iter().flat_map(items);
                let largest = largest.map(|x| x.as_i64().unwrap()).max().unwrap();
                prop_assert!((10_000_000..100_000_000).contains(&largest), "{largest}");
            }
            Err(error) => {
                let beyond = !(-290..290).contains(&power);
                prop_assert!(beyond && matches!(error, ExportError::OutOfRange { .. }), "{error}");
            }
        }
    }
}
