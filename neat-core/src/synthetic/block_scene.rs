//! Many boxes scattered in the unit ball: a scene as large as one likes, with
//! exact truth, for what depends on the number of junctions and views. There are
//! no images.

use super::block_visibility::visible_stretches;
use super::blocks::Blocks;
use super::random::{Purpose, gaussian_pair, stream};
use super::scene::SyntheticError;
use super::viewpoints::{min_distance, viewpoints};
use crate::{Camera, LineSegment2, LineSegment3, ScoredSegment2, Wireframe3d};
use nalgebra::Vector2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Two fragments of one segment leave out this share of it between them.
const FRAGMENT_GAP: f64 = 0.1;

/// What to generate.
///
/// ```
/// use neat_core::synthetic::BlockScene;
///
/// let config = BlockScene { blocks: 5, views: 3, ..BlockScene::default() };
/// let data = config.generate()?;
/// assert_eq!(data.truth.junctions.len(), 40);
/// assert_eq!(data.views.len(), 3);
/// # Ok::<(), neat_core::synthetic::SyntheticError>(())
/// ```
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
    /// The surface.
    pub blocks: Blocks,
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
    /// Checks every field against its range.
    ///
    /// # Errors
    /// The first field outside its range, or not a number.
    pub fn validate(&self) -> Result<(), SyntheticError> {
        let size = f64::from(self.image_size);
        let nearest = min_distance(1.0, 1.0);
        let ranges = [
            ("blocks", self.blocks as f64, 1.0, 100_000.0),
            ("views", self.views as f64, 1.0, 10_000.0),
            ("image_size", size, 16.0, 8192.0),
            ("camera_distance", self.camera_distance, nearest, 100.0),
            ("max_yaw_in_degrees", self.max_yaw_in_degrees, 0.0, 180.0),
            ("noise_in_pixels", self.noise_in_pixels, 0.0, size),
            ("detection_rate", self.detection_rate, 0.0, 1.0),
            ("fragment_rate", self.fragment_rate, 0.0, 1.0),
            (
                "false_segments_per_hundred",
                self.false_segments_per_hundred,
                0.0,
                1000.0,
            ),
            (
                "min_visible_length",
                self.min_visible_length,
                0.0,
                2.0 * size,
            ),
        ];
        SyntheticError::first_outside(&ranges)
    }

    /// Generates the scene. The same configuration gives the same scene, for any
    /// number of threads.
    ///
    /// # Errors
    /// See [`Self::validate`].
    pub fn generate(&self) -> Result<BlockData, SyntheticError> {
        self.validate()?;
        let blocks = Blocks::new(self);
        let views = viewpoints(
            self.views,
            self.camera_distance,
            (self.image_size, self.image_size),
            self.seed,
        )
        .into_par_iter()
        .enumerate()
        .map(|(view, camera)| self.detect(&blocks, view, camera))
        .collect();
        Ok(BlockData {
            truth: blocks.wireframe(),
            blocks,
            views,
        })
    }

    fn detect(&self, blocks: &Blocks, view: usize, camera: Camera) -> BlockView {
        let mut rng = stream(self.seed, view, Purpose::Detection);
        let mut found = Detections::default();
        for stretch in visible_stretches(&blocks.boxes, &camera.center_in_world) {
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

    fn small() -> BlockScene {
        BlockScene {
            blocks: 30,
            views: 4,
            ..BlockScene::default()
        }
    }

    #[test]
    fn detections_show_visible_stretches_and_nothing_else() {
        let config = BlockScene {
            noise_in_pixels: 0.0,
            ..small()
        };
        let data = config.generate().unwrap();
        for view in &data.views {
            assert_eq!(view.segments.len(), view.sources.len());
            let mut shown = 0;
            for (detection, source) in view.segments.iter().zip(&view.sources) {
                let Some(source) = source else { continue };
                shown += 1;
                let edge = data.truth.segment(source.edge);
                assert!(
                    !source.is_whole
                        || edge.unordered_squared_end_distance(&source.segment) < 1e-20
                );
                let exact = project(&view.camera, &source.segment);
                assert!(exact.squared_end_distance(&detection.segment) < 1e-12);
                for t in [0.05, 0.5, 0.95] {
                    let point = source.segment.point_at(t);
                    assert!(edge.distance_to_point(&point) < 1e-12);
                    let to_camera = view.camera.center_in_world - point;
                    assert!((1..400).all(|i| {
                        data.blocks.sdf(&(point + to_camera * f64::from(i) / 400.0)) > -1e-9
                    }));
                }
            }
            assert!(shown > 50 && shown < view.segments.len());
        }
    }

    #[test]
    fn a_field_out_of_range_is_named() {
        let config = BlockScene {
            camera_distance: f64::NAN,
            ..small()
        };
        assert_eq!(config.generate().unwrap_err().field, "camera_distance");
    }
}
