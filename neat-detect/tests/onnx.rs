//! A learned detector: a model small enough to be written by hand.
#![cfg(feature = "onnx")]

use image::{Rgb, RgbImage};
use neat_detect::onnx::OnnxDetector;
use neat_detect::{DetectorConfig, wireframe_from_segments};
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

/// A model for images of 32×32 that always finds the same two segments.
fn model(scores: &[f32]) -> Vec<u8> {
    let found = [15.0, 3.0, 15.5, 28.0, 3.0, 8.0, 12.0, 8.0];
    let graph = [
        bytes(1, &identity("found", "lines")),
        bytes(1, &identity("sure", "scores")),
        bytes(2, b"two segments"),
        bytes(5, &initializer("found", &[2, 4], &found)),
        bytes(5, &initializer("sure", &[scores.len() as u8], scores)),
        bytes(11, &value_info("image", &[1, 3, 32, 32])),
        bytes(12, &value_info("lines", &[2, 4])),
        bytes(12, &value_info("scores", &[scores.len() as u8])),
    ];
    let opset = number(2, 13);
    [number(1, 8), bytes(7, &graph.concat()), bytes(8, &opset)].concat()
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
