//! The whole way from an image to its wireframe.

use crate::DetectorConfig;
use crate::edge_completion;
use crate::edge_profile::strength;
use crate::junction_graph::{self, JunctionLimits};
use crate::line_fitting::{FittedSegment, LineFitter};
use crate::merging::{self, MergeLimits};
use crate::noise;
use crate::segment_search;
use crate::smoothed_image::SmoothedImage;
use image::RgbImage;
use neat_core::{LineSegment2, Wireframe2d};

/// Segments under a smaller angle than this can follow one another's edge.
const MAX_OVERSHOOT_ANGLE: f64 = 25.0;
/// How far the lines of the detector lie from the edge, in pixels.
const SEARCH_WIDTH: f64 = 3.0;

/// The 2D wireframe of `image`.
pub fn detect(image: &RgbImage, config: &DetectorConfig) -> Wireframe2d {
    let (width, height) = image.dimensions();
    if width < 8 || height < 8 {
        return Wireframe2d::empty(width, height);
    }
    let noise = noise::estimate(image);
    let sigma = noise::smoothing(config.smoothing_in_pixels, noise);
    let min_gradient = config
        .min_gradient
        .max(config.noise_factor * noise::gradient_noise(sigma, noise));
    let smoothed = SmoothedImage::new(image, sigma);
    let segments = segment_search::search(&smoothed, min_gradient);
    graph_of(&smoothed, &segments, min_gradient, SEARCH_WIDTH, config)
}

fn graph_of(
    image: &SmoothedImage,
    segments: &[LineSegment2],
    min_gradient: f64,
    search_width: f64,
    config: &DetectorConfig,
) -> Wireframe2d {
    let [width, height] = image.size().map(|side| side as u32);
    let scale = DetectorConfig::pixels_per_reference_pixel(width, height);
    let fitter = LineFitter {
        image,
        min_gradient,
        max_gap: config.max_gap * scale,
    };
    let fitted: Vec<FittedSegment> = (segments.iter())
        .filter_map(|segment| fitter.fit(segment, search_width))
        .collect();
    let mut lines = merging::merge(
        fitted,
        &fitter,
        &MergeLimits {
            distance: config.merge_distance,
            sin_angle: config.merge_angle.to_radians().sin(),
            gap: config.max_gap * scale,
        },
    );
    merging::drop_covered(&mut lines, MAX_OVERSHOOT_ANGLE.to_radians().sin());
    merging::trim_overshoots(&mut lines, MAX_OVERSHOOT_ANGLE.to_radians().sin());
    lines.retain(|line| {
        let length = line.segment.length();
        length >= config.min_length * scale
            && (line.sagitta <= 0.3 || line.sagitta <= config.max_sagitta * length)
    });
    let limits = JunctionLimits {
        extension: config.max_extension * scale,
        retreat: config.max_retreat * scale,
        distance: config.junction_distance * scale,
        sin_angle: config.min_junction_angle.to_radians().sin(),
        attraction: config.max_attraction * scale,
        t_extension: config.t_junction_distance * scale,
    };
    let straight: Vec<LineSegment2> = lines.iter().map(|line| line.segment).collect();
    let mut graph =
        junction_graph::build(&straight, &limits, |bridge| fitter.is_nowhere_flat(bridge));
    let completed = edge_completion::complete(
        &graph.vertices,
        &graph.edges,
        config.max_completion * scale,
        &fitter,
    );
    for edge in completed {
        for vertex in edge.vertices {
            graph.degrees[vertex] += 1;
        }
        graph.edges.push(edge.vertices);
        lines.push(edge.fitted);
    }
    let edge_scores: Vec<f64> = lines.iter().map(|s| score(s, min_gradient)).collect();
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

fn score(segment: &FittedSegment, min_gradient: f64) -> f64 {
    let contrast = strength(&segment.change) / min_gradient;
    segment.support.powi(2) * contrast / (contrast + 2.0)
}
