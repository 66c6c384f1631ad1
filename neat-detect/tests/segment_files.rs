//! Segment files and edge maps of other programs: exact ones read as they should,
//! damaged ones never panic.

use image::{GrayImage, ImageFormat, Luma};
use nalgebra::Vector2;
use neat_core::LineSegment2;
use neat_core::npz::{NpyArray, write_npz};
use neat_detect::{edge_map, segment_file};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

const ROWS: [[f64; 4]; 2] = [[1.0, 2.0, 3.5, 4.0], [5.0, 6.0, 7.0, 8.25]];

fn expected() -> Vec<LineSegment2> {
    let segment =
        |[x1, y1, x2, y2]: [f64; 4]| LineSegment2::new(Vector2::new(x1, y1), Vector2::new(x2, y2));
    ROWS.map(segment).to_vec()
}

/// The bytes of an archive with one array.
fn npz(name: &str, shape: &[usize], values: Vec<f64>) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.npz");
    let array = NpyArray {
        shape: shape.to_vec(),
        values,
    };
    write_npz(&path, &BTreeMap::from([(name, array)])).unwrap();
    std::fs::read(path).unwrap()
}

/// A `.npy` file of 32-bit floats as NumPy writes it.
fn npy() -> Vec<u8> {
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 4), }\n";
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(
        ROWS.iter()
            .flatten()
            .flat_map(|value| (*value as f32).to_le_bytes()),
    );
    bytes
}

fn read(bytes: Vec<u8>, name: &str) -> Result<Vec<LineSegment2>, neat_core::SceneError> {
    segment_file::parse(bytes, Path::new(name))
}

#[test]
fn arrays_of_all_shapes_and_names_are_read() {
    let flat: Vec<f64> = ROWS.concat();
    for name in segment_file::ARRAY_NAMES {
        assert_eq!(
            read(npz(name, &[2, 4], flat.clone()), "a.npz").unwrap(),
            expected()
        );
        assert_eq!(
            read(npz(name, &[2, 2, 2], flat.clone()), "a.NPZ").unwrap(),
            expected()
        );
    }
    let scored = ROWS
        .iter()
        .flat_map(|row| row.iter().copied().chain([0.9]))
        .collect();
    assert_eq!(
        read(npz("lines", &[2, 5], scored), "a.npz").unwrap(),
        expected()
    );
    assert_eq!(read(npy(), "a.npy").unwrap(), expected());
    assert_eq!(read(npz("segs", &[0], Vec::new()), "a.npz").unwrap(), []);
}

#[test]
fn messages_name_the_file_and_what_is_wrong() {
    let cases = [
        (
            read(npz("vertices", &[2, 4], ROWS.concat()), "a.npz"),
            "lines, segs",
        ),
        (
            read(npz("lines", &[4, 2], ROWS.concat()), "a.npz"),
            "[4, 2]",
        ),
        (read(npy(), "a.mat"), ".npz, .npy, .txt"),
        (read(b"1 2 3".to_vec(), "a.txt"), "line 1"),
    ];
    for (result, reason) in cases {
        let message = result.unwrap_err().to_string();
        assert!(
            message.contains("a.") && message.contains(reason),
            "{message}"
        );
    }
}

/// A map with a cross and a ring.
fn map() -> GrayImage {
    GrayImage::from_fn(40, 30, |x, y| {
        let radius = (f64::from(x) - 28.0).hypot(f64::from(y) - 14.0);
        let is_edge = x == 10 || y == 15 || (radius - 9.0).abs() < 1.0;
        Luma([if is_edge { 255 } else { 0 }])
    })
}

fn png() -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    map().write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// One to four bytes changed, and perhaps the end cut off.
fn damaged(bytes: Vec<u8>) -> impl Strategy<Value = Vec<u8>> {
    let len = bytes.len();
    let changes = prop::collection::vec((0..len, any::<u8>()), 1..5);
    (changes, prop::option::of(0..len)).prop_map(move |(changes, end)| {
        let mut bytes = bytes.clone();
        for (at, byte) in changes {
            bytes[at] = byte;
        }
        bytes.truncate(end.unwrap_or(len));
        bytes
    })
}

fn is_fine(result: Result<Vec<LineSegment2>, neat_core::SceneError>) -> bool {
    result.is_err()
        || result.is_ok_and(|segments| {
            segments
                .iter()
                .flat_map(LineSegment2::ends)
                .all(|end| end.iter().all(|x| x.is_finite()))
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    #[test]
    fn damaged_archives_do_not_panic(bytes in damaged(npz("lines", &[2, 4], ROWS.concat()))) {
        prop_assert!(is_fine(read(bytes, "a.npz")));
    }

    #[test]
    fn damaged_arrays_do_not_panic(bytes in damaged(npy())) {
        prop_assert!(is_fine(read(bytes, "a.npy")));
    }

    #[test]
    fn damaged_text_does_not_panic(bytes in damaged(b"2\n1 2 3.5 4 0.9\n5e0,-6,7,8.25\n# end\n".to_vec())) {
        prop_assert!(is_fine(read(bytes, "a.txt")));
    }

    #[test]
    fn damaged_edge_maps_do_not_panic(bytes in damaged(png())) {
        if let Ok(map) = edge_map::parse(&bytes, Path::new("a.png")) {
            let segments = edge_map::segments(&map);
            prop_assert!(is_fine(Ok(segments)));
        }
    }

    #[test]
    fn random_edge_maps_do_not_panic(pixels in prop::collection::vec(any::<bool>(), 144)) {
        let map = GrayImage::from_fn(12, 12, |x, y| Luma([u8::from(pixels[(12 * y + x) as usize])]));
        for segment in edge_map::segments(&map) {
            prop_assert!(segment.ends().iter().all(|end| end.min() >= 0.0 && end.max() <= 11.0));
        }
    }
}
