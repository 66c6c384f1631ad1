//! Many boxes scattered in the unit ball: a scene as large as one likes, with
//! exact truth, for what depends on the number of junctions and views. There are
//! no images.

use crate::block_visibility::visible_stretches;
use crate::blocks::{Block, boxes, wireframe};
use nalgebra::Vector2;
use neat_core::synthetic::viewpoints;
use neat_core::{Camera, LineSegment2, LineSegment3, ScoredSegment2, Wireframe3d};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// What a stream of random numbers is for.
#[derive(Clone, Copy)]
pub enum Purpose {
    Detection = 1,
    FalseSegment = 4,
    Blocks = 5,
}

/// The stream keyed by `(seed, view, purpose)`.
pub fn stream(seed: u64, view: usize, purpose: Purpose) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&(view as u64).to_le_bytes());
    key[16] = purpose as u8;
    ChaCha8Rng::from_seed(key)
}

/// Two independent standard normal numbers (Box and Muller 1958).
fn gaussian_pair(rng: &mut ChaCha8Rng) -> Vector2<f64> {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    let (sin, cos) = (TAU * rng.random::<f64>()).sin_cos();
    radius * Vector2::new(cos, sin)
}

/// Two fragments of one segment leave out this share of it between them.
const FRAGMENT_GAP: f64 = 0.1;

/// What to generate.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockScene {
    /// Number of boxes: eight junctions and twelve edges each.
    pub blocks: usize,
    /// Number of views, spread evenly over a sphere.
    pub views: usize,
    /// Width and height of the images, in pixels.
    pub image_size: u32,
    /// Distance of the cameras from the origin.
    pub camera_distance: f64,
    /// Seed of all randomness.
    pub seed: u64,
    /// Boxes are turned about the vertical by at most this angle, in degrees.
    pub max_yaw_in_degrees: f64,
    /// Standard deviation of each coordinate of a detected end, in pixels.
    pub noise_in_pixels: f64,
    /// Probability that a visible part of an edge is detected.
    pub detection_rate: f64,
    /// Probability that a detected part falls into two fragments.
    pub fragment_rate: f64,
    /// False segments in every view, per hundred true ones.
    pub false_segments_per_hundred: f64,
    /// Visible parts shorter than this are never detected, in pixels.
    pub min_visible_length: f64,
}

impl Default for BlockScene {
    fn default() -> Self {
        Self {
            blocks: 60,
            views: 50,
            image_size: 1024,
            camera_distance: 2.5,
            seed: 0,
            max_yaw_in_degrees: 45.0,
            noise_in_pixels: 0.5,
            detection_rate: 0.8,
            fragment_rate: 0.1,
            false_segments_per_hundred: 10.0,
            min_visible_length: 8.0,
        }
    }
}

/// A generated scene and what is true about it.
#[derive(Clone, Debug)]
pub struct BlockData {
    /// Junctions and edges, box by box.
    pub truth: Wireframe3d,
    /// What a detector would see.
    pub views: Vec<BlockView>,
}

/// The detections of one view.
#[derive(Clone, Debug)]
pub struct BlockView {
    /// Intrinsics and pose.
    pub camera: Camera,
    /// Detected segments, in any order of their ends.
    pub segments: Vec<ScoredSegment2>,
    /// For each of them what it shows; `None` for a false one.
    pub sources: Vec<Option<BlockSource>>,
}

/// The stretch of a true edge that a detection shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockSource {
    /// The edge's index in [`BlockData::truth`].
    pub edge: usize,
    /// The stretch, its ends in the order of the detection's.
    pub segment: LineSegment3,
    /// Whether that is the whole edge.
    pub is_whole: bool,
}

impl BlockScene {
    /// Generates the scene. The same configuration gives the same scene, for any
    /// number of threads.
    pub fn generate(&self) -> BlockData {
        let boxes = boxes(self);
        let size = (self.image_size, self.image_size);
        let views = viewpoints(self.views, self.camera_distance, size, self.seed)
            .into_par_iter()
            .enumerate()
            .map(|(view, camera)| self.detect(&boxes, view, camera))
            .collect();
        BlockData {
            truth: wireframe(&boxes),
            views,
        }
    }

    fn detect(&self, boxes: &[Block], view: usize, camera: Camera) -> BlockView {
        let mut rng = stream(self.seed, view, Purpose::Detection);
        let mut found = Detections::default();
        for stretch in visible_stretches(boxes, &camera.center_in_world) {
            let [start, end] = stretch.range.map(|t| stretch.segment.point_at(t));
            let mut part = LineSegment3::new(start, end);
            let shown = project(&camera, &part);
            if shown.length() < self.min_visible_length
                || rng.random::<f64>() >= self.detection_rate
            {
                continue;
            }
            if rng.random::<f64>() < 0.5 {
                part = part.reversed();
            }
            let is_fragmented = rng.random::<f64>() < self.fragment_rate;
            let segments = if is_fragmented {
                let gap = 0.3 + 0.4 * rng.random::<f64>();
                let [before, after] = [-0.5, 0.5].map(|half| gap + half * FRAGMENT_GAP);
                let between = |from, to| LineSegment3::new(part.point_at(from), part.point_at(to));
                vec![between(0.0, before), between(after, 1.0)]
            } else {
                vec![part]
            };
            for segment in segments {
                let source = BlockSource {
                    edge: stretch.edge,
                    segment,
                    is_whole: !is_fragmented && stretch.range == [0.0, 1.0],
                };
                found.push_true(&camera, source, self.noise_in_pixels, &mut rng);
            }
        }
        let mut clutter = stream(self.seed, view, Purpose::FalseSegment);
        let share = self.false_segments_per_hundred / 100.0;
        let false_segments = (share * found.segments.len() as f64).round() as usize;
        for _ in 0..false_segments {
            found.push_false(f64::from(self.image_size), &mut clutter);
        }
        BlockView {
            camera,
            segments: found.segments,
            sources: found.sources,
        }
    }
}

/// The growing lists of a [`BlockView`].
#[derive(Default)]
struct Detections {
    segments: Vec<ScoredSegment2>,
    sources: Vec<Option<BlockSource>>,
}

impl Detections {
    fn push_true(
        &mut self,
        camera: &Camera,
        source: BlockSource,
        noise_in_pixels: f64,
        rng: &mut ChaCha8Rng,
    ) {
        let exact = project(camera, &source.segment);
        let segment = LineSegment2::new(
            exact.start + noise_in_pixels * gaussian_pair(rng),
            exact.end + noise_in_pixels * gaussian_pair(rng),
        );
        self.push(segment, 0.5 + 0.5 * rng.random::<f64>(), Some(source));
    }

    /// A segment up to a tenth of the image long, anywhere in it.
    fn push_false(&mut self, size: f64, rng: &mut ChaCha8Rng) {
        let start = size * Vector2::new(rng.random(), rng.random());
        let offset = Vector2::new(rng.random::<f64>(), rng.random()).add_scalar(-0.5);
        let segment = LineSegment2::new(start, start + 0.2 * size * offset);
        self.push(segment, 0.1 + 0.5 * rng.random::<f64>(), None);
    }

    fn push(&mut self, segment: LineSegment2, score: f64, source: Option<BlockSource>) {
        self.segments.push(ScoredSegment2 {
            segment,
            score,
            edge: self.segments.len(),
        });
        self.sources.push(source);
    }
}

/// A segment's image; the ball lies in front of every camera.
fn project(camera: &Camera, segment: &LineSegment3) -> LineSegment2 {
    segment.map(|end| camera.project(end).pixel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn detections_show_stretches_of_edges_and_nothing_else() {
        let config = BlockScene {
            blocks: 30,
            views: 4,
            noise_in_pixels: 0.0,
            ..BlockScene::default()
        };
        let data = config.generate();
        for view in &data.views {
            assert_eq!(view.segments.len(), view.sources.len());
            let mut shown = 0;
            for (detection, source) in view.segments.iter().zip(&view.sources) {
                let Some(source) = source else { continue };
                shown += 1;
                let edge = data.truth.segment(source.edge);
                let is_whole = edge.unordered_squared_end_distance(&source.segment) < 1e-20;
                assert!(is_whole || !source.is_whole);
                assert!(edge.distance_to_point(&source.segment.point_at(0.5)) < 1e-12);
                let exact = project(&view.camera, &source.segment);
                assert!(exact.squared_end_distance(&detection.segment) < 1e-12);
            }
            assert!(shown > 50 && shown < view.segments.len());
        }
    }
}
