//! Learned detectors: models small enough to be written by hand, and M-LSD where its weights are.
#![cfg(feature = "onnx")]

use image::{Rgb, RgbImage};
use nalgebra::Vector2;
use neat_core::LineSegment2;
use neat_detect::mlsd::Mlsd;
use neat_detect::onnx::OnnxDetector;
use neat_detect::{DetectorConfig, detect_with_hints, wireframe_from_segments};
use std::path::Path;

/// A protobuf field with bytes: a message, a string, packed numbers.
fn bytes(field: u8, content: &[u8]) -> Vec<u8> {
    let mut out = vec![field << 3 | 2];
    let mut len = content.len();
    while len >= 0x80 {
        out.push((len & 0x7f) as u8 | 0x80);
        len >>= 7;
    }
    out.push(len as u8);
    out.extend(content);
    out
}

/// A protobuf field with a small number.
fn number(field: u8, value: u8) -> Vec<u8> {
    vec![field << 3, value]
}

/// A `ValueInfoProto` of 32-bit floats.
fn value_info(name: &str, shape: &[u8]) -> Vec<u8> {
    let dims: Vec<u8> = shape
        .iter()
        .flat_map(|&n| bytes(1, &number(1, n)))
        .collect();
    let tensor = [number(1, 1), bytes(2, &dims)].concat();
    [bytes(1, name.as_bytes()), bytes(2, &bytes(1, &tensor))].concat()
}

/// A `TensorProto` of 32-bit floats.
fn initializer(name: &str, shape: &[u8], values: &[f32]) -> Vec<u8> {
    let raw: Vec<u8> = values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    let dims: Vec<u8> = shape.iter().flat_map(|&n| number(1, n)).collect();
    [
        dims,
        number(2, 1),
        bytes(8, name.as_bytes()),
        bytes(9, &raw),
    ]
    .concat()
}

/// A `NodeProto` that passes `input` on.
fn identity(input: &str, output: &str) -> Vec<u8> {
    let names = [bytes(1, input.as_bytes()), bytes(2, output.as_bytes())].concat();
    [names, bytes(4, b"Identity")].concat()
}

/// A model that gives these outputs, each a name, a shape and numbers, whatever its input
/// `image` of this shape is.
fn model_of(input: &[u8], outputs: &[(&str, &[u8], &[f32])]) -> Vec<u8> {
    let mut graph = [
        bytes(2, b"constants"),
        bytes(11, &value_info("image", input)),
    ]
    .concat();
    for (name, shape, values) in outputs {
        let constant = format!("constant {name}");
        graph.extend(bytes(1, &identity(&constant, name)));
        graph.extend(bytes(5, &initializer(&constant, shape, values)));
        graph.extend(bytes(12, &value_info(name, shape)));
    }
    let opset = number(2, 13);
    [number(1, 8), bytes(7, &graph), bytes(8, &opset)].concat()
}

/// A model for images of 32×32 that always finds the same two segments.
fn model(scores: &[f32]) -> Vec<u8> {
    let found = [15.0, 3.0, 15.5, 28.0, 3.0, 8.0, 12.0, 8.0];
    let count = [scores.len() as u8];
    let outputs: [(&str, &[u8], &[f32]); 2] =
        [("lines", &[2, 4], &found), ("scores", &count, scores)];
    model_of(&[1, 3, 32, 32], &outputs)
}

/// As M-LSD for images of 32×32: sure of a line with its middle in cell (3, 8), less of one in
/// cell (9, 8).
fn small_mlsd() -> Vec<u8> {
    let (mut scores, mut offsets) = (vec![0.0; 256], vec![0.0; 4 * 256]);
    scores[8 * 16 + 3] = 0.9;
    scores[8 * 16 + 9] = 0.05;
    for cell in [8 * 16 + 3, 8 * 16 + 9] {
        offsets[4 * cell..4 * cell + 4].copy_from_slice(&[0.5, -5.0, -0.5, 6.0]);
    }
    model_of(
        &[1, 32, 32, 4],
        &[
            ("scores", &[1, 16, 16, 1], &scores),
            ("offsets", &[1, 16, 16, 4], &offsets),
        ],
    )
}

#[test]
fn segments_come_in_pixels_of_the_image_and_are_fitted_to_it() {
    let detector = OnnxDetector::from_bytes(model(&[0.9, 0.01]), Path::new("a.onnx")).unwrap();
    let image = RgbImage::from_fn(64, 64, |x, _| Rgb([if x < 31 { 20 } else { 200 }; 3]));
    let segments = detector.segments(&image).unwrap();
    assert_eq!(segments.len(), 1, "the other's score is too low");
    assert_eq!((segments[0].start.x, segments[0].end.y), (30.5, 56.5));
    let wireframe = wireframe_from_segments(&image, &segments, &DetectorConfig::default());
    assert_eq!(wireframe.edges.len(), 1);
    assert!((wireframe.vertices[0].x - 30.5).abs() < 0.05);
}

#[test]
fn what_breaks_the_contract_is_said() {
    let path = Path::new("a.onnx");
    let garbage = OnnxDetector::from_bytes(b"no model".to_vec(), path)
        .err()
        .unwrap();
    assert!(garbage.to_string().contains("a.onnx"), "{garbage}");
    let detector = OnnxDetector::from_bytes(model(&[0.9, 0.8, 0.7]), path).unwrap();
    let message = detector
        .segments(&RgbImage::new(32, 32))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("a.onnx") && message.contains("scores"),
        "{message}"
    );
}

#[test]
fn lines_of_mlsd_come_in_pixels_of_the_image() {
    let mlsd = Mlsd::from_bytes(small_mlsd(), Path::new("small.onnx")).unwrap();
    let lines = mlsd.lines(&RgbImage::new(64, 96)).unwrap();
    // Two input pixels a cell; two and three image pixels an input pixel.
    let [x1, y1, x2, y2] = [14.0, 18.0, 10.0, 84.0];
    let expected = LineSegment2::new(Vector2::new(x1, y1), Vector2::new(x2, y2));
    assert_eq!(lines, [expected], "the other line is not sure enough");
}

#[test]
fn a_model_that_is_not_mlsd_is_refused_by_name() {
    let error = Mlsd::from_bytes(model(&[0.9, 0.8]), Path::new("lines.onnx")).err();
    let message = error.unwrap().to_string();
    assert!(
        message.contains("lines.onnx") && message.contains("M-LSD"),
        "{message}"
    );
}

/// With the weights in the file `$NEAT_MLSD`.
#[test]
#[expect(clippy::print_stderr, reason = "a skipped test must be seen")]
fn mlsd_sees_the_borders_of_a_square() {
    let Some(path) = std::env::var_os("NEAT_MLSD") else {
        eprintln!("skipped: NEAT_MLSD names no weights (scripts/fetch_mlsd.sh fetches them)");
        return;
    };
    let inside = |v: u32, [first, end]: [u32; 2]| (first..end).contains(&v);
    let image = RgbImage::from_fn(640, 480, |x, y| {
        Rgb([if inside(x, [160, 480]) && inside(y, [120, 360]) {
            200
        } else {
            40
        }; 3])
    });
    let lines = Mlsd::load(Path::new(&path)).unwrap().lines(&image).unwrap();
    let corners = [
        [159.5, 119.5],
        [479.5, 119.5],
        [479.5, 359.5],
        [159.5, 359.5],
    ];
    let corners = corners.map(|[x, y]| Vector2::new(x, y));
    for k in 0..4 {
        let side = LineSegment2::new(corners[k], corners[(k + 1) % 4]);
        let along = |line: &&LineSegment2| {
            line.ends()
                .iter()
                .all(|end| side.distance_to_line(end) < 4.0)
        };
        let seen: f64 = lines.iter().filter(along).map(LineSegment2::length).sum();
        assert!(seen > 0.8 * side.length(), "side {k}: {lines:?}");
    }
    let wireframe = detect_with_hints(&image, &lines, &DetectorConfig::default());
    assert_eq!((wireframe.vertices.len(), wireframe.edges.len()), (4, 4));
}
