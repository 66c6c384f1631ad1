//! The whole way from an image to its wireframe.

use crate::DetectorConfig;
use crate::junction_graph::{self, JunctionLimits};
use crate::line_fitting::{FittedSegment, LineFitter};
use crate::merging::{self, MergeLimits};
use crate::segment_search;
use crate::smoothed_image::SmoothedImage;
use image::RgbImage;
use neat_core::{LineSegment2, Wireframe2d};

/// The 2D wireframe of `image`.
pub fn detect(image: &RgbImage, config: &DetectorConfig) -> Wireframe2d {
    let (width, height) = image.dimensions();
    if width < 8 || height < 8 {
        return Wireframe2d::empty(width, height);
    }
    let smoothed = SmoothedImage::new(image, config.smoothing_in_pixels);
    let segments = segment_search::search(&smoothed, config.min_gradient);
    graph_of(&smoothed, &segments, 1.0, config)
}

fn graph_of(
    image: &SmoothedImage,
    segments: &[LineSegment2],
    initial_error: f64,
    config: &DetectorConfig,
) -> Wireframe2d {
    let [width, height] = image.size().map(|side| side as u32);
    let scale = DetectorConfig::pixels_per_reference_pixel(width, height);
    let fitter = LineFitter {
        image,
        min_gradient: config.min_gradient,
        max_gap: config.max_gap * scale,
        initial_error,
    };
    let fitted: Vec<FittedSegment> = (segments.iter())
        .filter_map(|segment| fitter.fit(segment))
        .collect();
    let merged = merging::merge(
        fitted,
        &fitter,
        &MergeLimits {
            distance: config.merge_distance,
            sin_angle: config.merge_angle.to_radians().sin(),
            gap: config.max_gap * scale,
        },
    );
    let mut merged = merged;
    merged.retain(|s| s.segment.length() >= config.min_length * scale);
    let lines: Vec<LineSegment2> = merged.iter().map(|s| s.segment).collect();
    let graph = junction_graph::build(
        &lines,
        &JunctionLimits {
            extension: config.max_extension * scale,
            retreat: config.max_retreat * scale,
            distance: config.junction_distance * scale,
            sin_angle: config.min_junction_angle.to_radians().sin(),
            t_extension: config.t_junction_distance * scale,
        },
    );
    let edge_scores: Vec<f64> = merged.iter().map(|s| score(s, config)).collect();
    let vertex_scores = graph
        .degrees
        .iter()
        .map(|&degree| if degree > 1 { 0.9 } else { 0.3 })
        .collect();
    Wireframe2d {
        vertices: graph.vertices,
        vertex_scores,
        edges: graph.edges,
        edge_scores,
        width,
        height,
    }
}

fn score(segment: &FittedSegment, config: &DetectorConfig) -> f64 {
    let contrast = segment.change.norm() / config.min_gradient;
    segment.support.powi(2) * contrast / (contrast + 2.0)
}
