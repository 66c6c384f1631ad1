//! The pixels of attraction regions with their segments, in little memory: what
//! training draws its rays from.

use crate::attraction_region::for_each_pixel;
use neat_core::{LineSegment2, Scene};
use rayon::prelude::*;

/// The foreground pixels of one view and the segments that attract them, as runs of
/// neighbours in a row.
///
/// [`AttractionRegions`](crate::attraction_region::AttractionRegions) has the same
/// pixels in the same order, with feet, distances and parameters, in 20 bytes each. A
/// run is as long as a region is wide: about one byte for each pixel.
///
/// # Example
/// ```
/// use nalgebra::Vector2;
/// use neat_core::LineSegment2;
/// use neat_field::region_pixels::RegionPixels;
///
/// let segment = LineSegment2::new(Vector2::new(2.0, 4.0), Vector2::new(6.0, 4.0));
/// let pixels = RegionPixels::compute(&[segment], 9, 9, 0.0, 1.0);
/// assert_eq!(pixels.len(), 3 * 5); // rows 3 to 5, columns 2 to 6
/// assert_eq!(pixels.get(5), (4 * 9 + 2, 0)); // the first one of row 4
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RegionPixels {
    runs: Vec<Run>,
    len: u32,
}

/// Pixels with indices one after the other and the same segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    /// How many pixels the runs before it hold.
    first: u32,
    /// Index of its first pixel.
    pixel: u32,
    label: u32,
}

impl RegionPixels {
    /// The pixels of `segments` in a `width × height` image that are at most
    /// `threshold` pixels away; the arguments are those of
    /// [`AttractionRegions::compute`](crate::attraction_region::AttractionRegions::compute).
    ///
    /// # Panics
    /// If the image has more than `u32::MAX` pixels.
    pub fn compute(
        segments: &[LineSegment2],
        width: u32,
        height: u32,
        pixel_center: f64,
        threshold: f64,
    ) -> Self {
        let mut pixels = Self::default();
        for_each_pixel(
            segments,
            (width, height),
            pixel_center,
            threshold,
            |found| {
                pixels.push(found.pixel, found.attraction.label);
            },
        );
        pixels.runs.shrink_to_fit();
        pixels
    }

    /// The pixels of every view of a scene. Labels index the view's
    /// [`segments(min_score)`](neat_core::Wireframe2d::segments); the published
    /// code trains with 0.05.
    pub fn of_scene(scene: &Scene, min_score: f64, threshold: f64) -> Vec<Self> {
        scene
            .views
            .par_iter()
            .map(|view| {
                let segments: Vec<LineSegment2> = view
                    .wireframe
                    .segments(min_score)
                    .iter()
                    .map(|scored| scored.segment)
                    .collect();
                let camera = &view.camera;
                Self::compute(
                    &segments,
                    camera.width,
                    camera.height,
                    scene.pixel_center,
                    threshold,
                )
            })
            .collect()
    }

    /// Number of foreground pixels.
    pub fn len(&self) -> usize {
        self.len as usize
    }

    /// Whether no pixel is foreground.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The pixel `index`, as `row · width + column`, and the index of its segment.
    /// Pixels are in row-major order.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn get(&self, index: usize) -> (u32, u32) {
        assert!(
            index < self.len(),
            "RegionPixels::get: {index} of {} pixels",
            self.len
        );
        // Below `len`.
        let index = index as u32;
        let run = self.runs.partition_point(|run| run.first <= index) - 1;
        let run = self.runs[run];
        (run.pixel + (index - run.first), run.label)
    }

    fn push(&mut self, pixel: u32, label: u32) {
        let continues = self
            .runs
            .last()
            .is_some_and(|run| run.label == label && run.pixel + (self.len - run.first) == pixel);
        if !continues {
            self.runs.push(Run {
                first: self.len,
                pixel,
                label,
            });
        }
        self.len += 1;
    }
}
