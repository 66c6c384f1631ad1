//! The whole way from an image to its wireframe.

use crate::claimed_pixels::ClaimedPixels;
use crate::clutter::{self, FittedEdge};
use crate::config::{DetectorConfig, pixels_per_reference_pixel};
use crate::edge_completion;
use crate::edge_profile::strength;
use crate::junction_graph;
use crate::line_fitting::{FittedSegment, LineFitter};
use crate::merging;
use crate::noise;
use crate::segment_search;
use crate::smoothed_image::SmoothedImage;
use image::{Rgb, RgbImage};
use nalgebra::Vector2;
use neat_core::{LineSegment2, Wireframe2d};
use tracing::{debug, debug_span};

/// The contrast, in smallest gradients, that halves an edge's score.
const WEAK_CONTRAST: f64 = 1.0;
/// Score of an end that meets no other segment, as a share of its edge's score.
const FREE_END: f64 = 0.4;
/// Edges that bend less than this, in pixels, are straight.
const STRAIGHT: f64 = 0.3;
/// Smaller images show no segment.
const MIN_SIDE: u32 = 8;
/// Edges that bend more are curves and are dropped: the height of the arc as a share of
/// its length.
const MAX_SAGITTA: f64 = 0.012;
/// Stretches without an edge along a line up to this length are bridged, in reference
/// pixels: where a weak edge drowns for a moment.
const MAX_GAP: f64 = 4.0;
/// How many standard deviations of the image's noise a gradient must have.
const NOISE_FACTOR: f64 = 3.0;
/// How far the lines of the detector lie from the edge, in pixels.
const SEARCH_WIDTH: f64 = 3.0;

/// The 2D wireframe of `image`: its straight edges as segments that share
/// junctions, with scores in [0, 1]. The centre of the first pixel is (0, 0): add
/// the scene's pixel centre for image coordinates.
///
/// Runs on the calling thread, but for the search, and gives the same for the same
/// input: call it for several images in parallel.
///
/// ```
/// use image::{Rgb, RgbImage};
/// use neat_detect::{DetectorConfig, detect};
///
/// // A bright square whose corners are at 19.5 and 43.5.
/// let inside = |v: u32| (20..44).contains(&v);
/// let image = RgbImage::from_fn(64, 64, |x, y| {
///     Rgb([if inside(x) && inside(y) { 200 } else { 20 }; 3])
/// });
/// let wireframe = detect(&image, &DetectorConfig::default());
/// assert_eq!((wireframe.vertices.len(), wireframe.edges.len()), (4, 4));
/// for vertex in &wireframe.vertices {
///     assert!((vertex.x - 31.5).abs() - 12.0 < 0.1 && (vertex.y - 31.5).abs() - 12.0 < 0.1);
/// }
/// ```
pub fn detect(image: &RgbImage, config: &DetectorConfig) -> Wireframe2d {
    detect_with_hints(image, &[], config)
}

/// As [`detect`], but fitting begins with `hints`: segments of another detector, in pixels of
/// `image`, that need not be exact. What they point to comes out whole where the built-in search
/// finds pieces, or nothing; where the image shows no edge they are lost.
///
/// ```
/// use image::{Rgb, RgbImage};
/// use nalgebra::Vector2;
/// use neat_core::LineSegment2;
/// use neat_detect::{DetectorConfig, detect_with_hints};
///
/// let image = RgbImage::from_fn(64, 64, |x, _| Rgb([if x < 30 { 20 } else { 200 }; 3]));
/// let vertical = |x| LineSegment2::new(Vector2::new(x, 5.0), Vector2::new(x, 55.0));
/// let hints = [vertical(31.0), vertical(50.0)];
/// let wireframe = detect_with_hints(&image, &hints, &DetectorConfig::default());
/// assert_eq!(wireframe.edges.len(), 1);
/// assert!((wireframe.vertices[0].x - 29.5).abs() < 0.05);
/// ```
pub fn detect_with_hints(
    image: &RgbImage,
    hints: &[LineSegment2],
    config: &DetectorConfig,
) -> Wireframe2d {
    let (width, height) = image.dimensions();
    if width < MIN_SIDE || height < MIN_SIDE {
        return Wireframe2d::empty(width, height);
    }
    let _span = debug_span!("detect", width, height).entered();
    let prepared = PreparedImage::new(image, config);
    let reduction = width
        .max(height)
        .div_ceil(config.max_search_side.max(MIN_SIDE));
    let segments = if reduction > 1 {
        let reduced = SmoothedImage::new(&reduced(image, reduction), prepared.sigma);
        // Between pixel centres of the two images.
        let [factor, shift] = [f64::from(reduction), f64::from(reduction - 1) / 2.0];
        let segments = segment_search::search(&reduced, prepared.min_gradient);
        let enlarged = |end: &Vector2<f64>| (end * factor).add_scalar(shift);
        segments
            .iter()
            .map(|segment| segment.map(enlarged))
            .collect()
    } else {
        segment_search::search(&prepared.smoothed, prepared.min_gradient)
    };
    let search_width = SEARCH_WIDTH.max(1.5 * f64::from(reduction));
    let hints = all_clipped(hints, width, height);
    graph_of(&prepared, [&hints, &segments], search_width, config)
}

/// The wireframe of segments that another detector found in `image`: they are
/// fitted to the image and joined as [`detect`]'s own. Those that lie outside the
/// image, and those along which it shows no edge, are dropped.
///
/// ```
/// use image::{Rgb, RgbImage};
/// use nalgebra::Vector2;
/// use neat_core::LineSegment2;
/// use neat_detect::{DetectorConfig, wireframe_from_segments};
///
/// let image = RgbImage::from_fn(64, 64, |x, _| Rgb([if x < 30 { 20 } else { 200 }; 3]));
/// let rough = LineSegment2::new(Vector2::new(28.0, 5.0), Vector2::new(31.0, 55.0));
/// let wireframe = wireframe_from_segments(&image, &[rough], &DetectorConfig::default());
/// assert_eq!(wireframe.edges.len(), 1);
/// assert!((wireframe.vertices[0].x - 29.5).abs() < 0.05);
/// ```
pub fn wireframe_from_segments(
    image: &RgbImage,
    segments: &[LineSegment2],
    config: &DetectorConfig,
) -> Wireframe2d {
    let (width, height) = image.dimensions();
    if width < MIN_SIDE || height < MIN_SIDE {
        return Wireframe2d::empty(width, height);
    }
    let _span = debug_span!("wireframe_from_segments", width, height).entered();
    let prepared = PreparedImage::new(image, config);
    let inside = all_clipped(segments, width, height);
    graph_of(&prepared, [&inside, &[]], SEARCH_WIDTH, config)
}

/// The parts of segments within an image of this size.
fn all_clipped(segments: &[LineSegment2], width: u32, height: u32) -> Vec<LineSegment2> {
    (segments.iter())
        .filter_map(|segment| clipped(segment, Vector2::new(width, height)))
        .collect()
}

/// The part of a segment within the pixel centres of an image of this size.
fn clipped(segment: &LineSegment2, size: Vector2<u32>) -> Option<LineSegment2> {
    let direction = segment.end - segment.start;
    let [mut first, mut last] = [0.0_f64, 1.0_f64];
    for axis in 0..2 {
        let [low, high] = [0.0, f64::from(size[axis]) - 1.0]
            .map(|border| (border - segment.start[axis]) / direction[axis]);
        if direction[axis] != 0.0 {
            first = first.max(low.min(high));
            last = last.min(low.max(high));
        } else if !(0.0..f64::from(size[axis])).contains(&segment.start[axis]) {
            return None;
        }
    }
    let part = LineSegment2::new(segment.point_at(first), segment.point_at(last));
    // Not so for NaN, and for numbers beyond those of images.
    let within =
        |end: &Vector2<f64>| (0..2).all(|axis| (-1.0..=f64::from(size[axis])).contains(&end[axis]));
    (first < last && part.ends().iter().all(within)).then_some(part)
}

/// An image with what its noise and texture ask for.
pub(crate) struct PreparedImage {
    pub smoothed: SmoothedImage,
    /// Standard deviation of its smoothing, in pixels.
    sigma: f64,
    /// The smallest strength of an edge, in grey levels per pixel.
    pub min_gradient: f64,
}

impl PreparedImage {
    pub(crate) fn new(image: &RgbImage, config: &DetectorConfig) -> Self {
        let noise = noise::estimate(image);
        let sigma = noise::smoothing(noise);
        let smoothed = SmoothedImage::new(image, sigma);
        let min_gradient = (config.min_gradient)
            .max(NOISE_FACTOR * noise::gradient_noise(sigma, noise))
            .max(config.texture_factor * smoothed.median_gradient());
        Self {
            smoothed,
            sigma,
            min_gradient,
        }
    }
}

/// The means over squares of `factor` pixels; pixels of a last, incomplete square
/// are left out.
fn reduced(image: &RgbImage, factor: u32) -> RgbImage {
    let count = factor * factor;
    RgbImage::from_fn(image.width() / factor, image.height() / factor, |x, y| {
        let mut sum = [0; 3];
        for dy in 0..factor {
            for dx in 0..factor {
                let pixel = image.get_pixel(x * factor + dx, y * factor + dy);
                for (sum, value) in sum.iter_mut().zip(pixel.0) {
                    *sum += u32::from(value);
                }
            }
        }
        Rgb(sum.map(|sum| ((sum + count / 2) / count) as u8))
    })
}

/// Fits segments to the image, the first ones before the others, merges them and joins them to
/// a graph.
fn graph_of(
    image: &PreparedImage,
    segments: [&[LineSegment2]; 2],
    search_width: f64,
    config: &DetectorConfig,
) -> Wireframe2d {
    let [width, height] = image.smoothed.size().map(|side| side as u32);
    let scale = pixels_per_reference_pixel(width, height);
    let fitter = LineFitter {
        image: &image.smoothed,
        min_gradient: image.min_gradient,
        max_gap: MAX_GAP * scale,
    };
    let mut lines = merging::merge(fit_all(segments, &fitter, search_width), &fitter);
    lines.retain(|line| {
        let length = line.segment.length();
        length >= (config.min_length * scale).max(1.0)
            && (line.sagitta <= STRAIGHT || line.sagitta <= MAX_SAGITTA * length)
    });
    let straight: Vec<LineSegment2> = lines.iter().map(|line| line.segment).collect();
    debug!(
        found = segments.map(<[_]>::len).iter().sum::<usize>(),
        straight = lines.len(),
        "segments are fitted"
    );
    let mut graph =
        junction_graph::build(&straight, scale, |bridge| fitter.is_nowhere_flat(bridge));
    for edge in edge_completion::complete(&graph.vertices, &graph.edges, scale, &fitter) {
        for vertex in edge.vertices {
            graph.meets_others[vertex] = true;
        }
        graph.edges.push(edge.vertices);
        lines.push(edge.fitted);
    }
    let fitted_edges: Vec<FittedEdge> = (lines.iter().zip(&graph.edges))
        .map(|(line, &vertices)| FittedEdge {
            vertices,
            score: score(line, image.min_gradient),
        })
        .collect();
    let kept = clutter::remove(fitted_edges, &graph.vertices, &graph.meets_others, scale);
    let wireframe = wireframe(&graph.vertices, kept, config.min_score, [width, height]);
    debug!(
        vertices = wireframe.vertices.len(),
        edges = wireframe.edges.len(),
        "segments are joined"
    );
    wireframe
}

/// The wireframe of the edges with a score of at least `min_score` and their
/// vertices.
fn wireframe(
    vertices: &[Vector2<f64>],
    mut edges: Vec<FittedEdge>,
    min_score: f64,
    [width, height]: [u32; 2],
) -> Wireframe2d {
    edges.retain(|edge| edge.score >= min_score && edge.vertices[0] != edge.vertices[1]);
    let mut wireframe = Wireframe2d::empty(width, height);
    let mut scores_at: Vec<Vec<f64>> = vec![Vec::new(); vertices.len()];
    for edge in &edges {
        for vertex in edge.vertices {
            scores_at[vertex].push(edge.score);
        }
    }
    let mut renumbered = vec![0; vertices.len()];
    for (vertex, scores) in scores_at.iter().enumerate() {
        if scores.is_empty() {
            continue;
        }
        renumbered[vertex] = wireframe.vertices.len();
        wireframe.vertices.push(vertices[vertex]);
        let mean = scores.iter().sum::<f64>() / scores.len() as f64;
        let certainty = if scores.len() > 1 { 1.0 } else { FREE_END };
        wireframe.vertex_scores.push(certainty * mean);
    }
    for edge in edges {
        wireframe
            .edges
            .push(edge.vertices.map(|vertex| renumbered[vertex]));
        wireframe.edge_scores.push(edge.score);
    }
    wireframe
}

/// Fits segments, those of each part longest first, without those that lie on an earlier one.
fn fit_all(
    parts: [&[LineSegment2]; 2],
    fitter: &LineFitter,
    search_width: f64,
) -> Vec<FittedSegment> {
    let longest_first = parts.map(|part| {
        let mut part: Vec<&LineSegment2> = part.iter().collect();
        part.sort_by(|a, b| b.length().total_cmp(&a.length()));
        part
    });
    let mut claimed = ClaimedPixels::new(fitter.image.size());
    let mut fitted: Vec<FittedSegment> = Vec::new();
    for segment in longest_first.into_iter().flatten() {
        if !claimed.contain(segment)
            && let Some(found) = fitter.fit(segment, search_width)
        {
            claimed.claim(&found);
            fitted.push(found);
        }
    }
    fitted
}

/// The score of an edge: how much of it the image shows, and how clearly.
fn score(line: &FittedSegment, min_gradient: f64) -> f64 {
    let contrast = strength(&line.change) / min_gradient;
    line.support.powi(2) * contrast / (contrast + WEAK_CONTRAST)
}
