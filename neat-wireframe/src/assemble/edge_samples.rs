//! Where a 3D line ought to show in the images, and whether edgels are there.

use super::view_segments::PreparedView;
use crate::projection::{project_in_front, project_segment_in_front};
use crate::statistics::upper_median;
use nalgebra::Vector2;
use neat_core::{EdgelMap, LineSegment2, LineSegment3};
use std::ops::ControlFlow;

/// Edgels of a line have at most this angle to its normal (cosine): about 20°, judged.
pub(super) const MIN_COSINE: f64 = 0.93;
/// Distance between samples in pixels: the smoothing before gradients correlates nearer
/// ones.
const SPACING: f64 = 3.0;
/// Samples per view: more say nothing new.
const COUNTS: [usize; 2] = [4, 40];
/// Shorter projections have no direction that an edgel could agree with, in pixels.
const MIN_PROJECTED_LENGTH: f64 = 5.0;
/// No image is larger, in pixels.
const MAX_PROJECTED_LENGTH: f64 = 1e5;
/// Edgels nearer to the border are those of the border, in pixels.
const BORDER: f64 = 3.0;
/// A view counts if it holds at least this share of the samples.
const MIN_INSIDE: f64 = 1.0 / 3.0;

/// The reach before the noise is known, in pixels.
const FIRST_REACH: f64 = 1.0;

/// All that the assembler knows of the images.
#[derive(Clone, Copy)]
pub(super) struct Images<'a> {
    pub views: &'a [PreparedView],
    /// The edgels of each view.
    pub maps: &'a [EdgelMap],
    /// Farther beside a line no edgel is its own, in pixels.
    pub reach: f64,
    /// Nearer to the ends of a line nothing is asked of it, in pixels: where corners are known,
    /// smoothing has rounded them.
    pub rounding: f64,
}

/// A place along the projection of a line or a curve in a view.
pub(super) struct Sample {
    /// Its parameter.
    pub place: f64,
    pub pixel: Vector2<f64>,
    /// Across the projection.
    pub normal: Vector2<f64>,
}

impl<'a> Images<'a> {
    /// Before it is known how far off edgels may be.
    pub(super) fn new(views: &'a [PreparedView], maps: &'a [EdgelMap]) -> Self {
        Self {
            views,
            maps,
            reach: FIRST_REACH,
            rounding: 0.0,
        }
    }
}

impl Images<'_> {
    /// For each edgel of each view, that no line has it.
    pub(super) fn nothing_taken(&self) -> Vec<Vec<bool>> {
        let of_map = |map: &EdgelMap| vec![false; map.len()];
        self.maps.iter().map(of_map).collect()
    }

    /// Samples of the part of `line` between two parameters; `None` where the view does
    /// not see enough of it. `count` is chosen by the length in pixels unless given.
    pub(super) fn samples(
        &self,
        view: usize,
        line: &LineSegment3,
        [low, high]: [f64; 2],
        count: Option<usize>,
    ) -> Option<Vec<Sample>> {
        let camera = &self.views[view].camera;
        let part = LineSegment3::new(line.point_at(low), line.point_at(high));
        let least = MIN_PROJECTED_LENGTH - 2.0 * self.rounding;
        let (length, normal) = across_of(&project_segment(&self.views[view], &part)?, least)?;
        let count =
            count.unwrap_or_else(|| ((length / SPACING) as usize).clamp(COUNTS[0], COUNTS[1]));
        let mut samples = Vec::with_capacity(count);
        samples.extend((0..count).filter_map(|i| {
            let place = low + (high - low) * ((i as f64 + 0.5) / count as f64);
            let pixel = project_in_front(camera, &line.point_at(place))?;
            self.is_inside(view, &pixel).then_some(Sample {
                place,
                pixel,
                normal,
            })
        }));
        are_enough(&samples, count).then_some(samples)
    }

    /// Whether a pixel is far enough from the image's border.
    pub(super) fn is_inside(&self, view: usize, pixel: &Vector2<f64>) -> bool {
        let camera = &self.views[view].camera;
        pixel.x > BORDER
            && pixel.y > BORDER
            && pixel.x < f64::from(camera.width) - BORDER
            && pixel.y < f64::from(camera.height) - BORDER
    }

    /// The index of the nearest edgel within `reach` pixels beside a sample.
    pub(super) fn edgel(&self, view: usize, sample: &Sample, reach: f64) -> Option<usize> {
        let Sample { pixel, normal, .. } = sample;
        self.maps[view]
            .nearest(pixel, normal, reach, MIN_COSINE, |_| true)
            .map(|(_, index)| index)
    }

    /// Whether an edgel lies beside a sample; those that are `taken` by another line do not count.
    pub(super) fn has_edgel(
        &self,
        view: usize,
        sample: &Sample,
        taken: Option<&[Vec<bool>]>,
    ) -> bool {
        let Sample { pixel, normal, .. } = sample;
        let mut found = false;
        self.maps[view].visit(pixel, normal, self.reach, MIN_COSINE, |_, index| {
            found = taken.is_none_or(|taken| !taken[view][index]);
            if found {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        found
    }

    /// The shares of the samples, moved by each of some `shifts` in pixels across the line, that
    /// have an edgel: one search for all of them.
    pub(super) fn shares<const N: usize>(
        &self,
        view: usize,
        samples: &[Sample],
        shifts: &[f64; N],
    ) -> [f64; N] {
        let farthest = shifts
            .iter()
            .fold(0.0, |far: f64, shift| far.max(shift.abs()));
        let reach = farthest + self.reach;
        let mut hits = [0; N];
        for Sample { pixel, normal, .. } in samples {
            let mut found = [false; N];
            self.maps[view].visit(pixel, normal, reach, MIN_COSINE, |across, _| {
                for (found, shift) in found.iter_mut().zip(shifts) {
                    *found |= (across - shift).abs() <= self.reach;
                }
                ControlFlow::Continue(())
            });
            for (hits, found) in hits.iter_mut().zip(found) {
                *hits += u32::from(found);
            }
        }
        hits.map(|hits| f64::from(hits) / samples.len() as f64)
    }

    /// Positions of the edgels within `reach` pixels beside a line in a view, in order.
    pub(super) fn edgels_beside(
        &self,
        view: usize,
        line: &LineSegment3,
        reach: f64,
    ) -> Vec<Vector2<f64>> {
        let Some(samples) = self.samples(view, line, [0.0, 1.0], None) else {
            return Vec::new();
        };
        (samples.iter())
            .filter_map(|sample| self.edgel(view, sample, reach))
            .map(|index| self.maps[view].get(index).position.cast())
            .collect()
    }

    /// Median size of a pixel at the middle of a line, over some views.
    pub(super) fn pixel_size(
        &self,
        line: &LineSegment3,
        views: impl Iterator<Item = usize>,
    ) -> f64 {
        let middle = line.point_at(0.5);
        let sizes = views.map(|view| self.views[view].pixel_size_at(&middle));
        upper_median(&mut sizes.collect::<Vec<f64>>())
    }

    /// Median length of a line's projections, in pixels.
    pub(super) fn projected_length(
        &self,
        line: &LineSegment3,
        views: impl Iterator<Item = usize>,
    ) -> f64 {
        let lengths = views.filter_map(|view| project_segment(&self.views[view], line));
        let lengths = lengths.map(|segment| segment.length());
        upper_median(&mut lengths.collect::<Vec<f64>>())
    }
}

/// Whether a view holds enough of `count` samples to say anything.
pub(super) fn are_enough(samples: &[Sample], count: usize) -> bool {
    samples.len() >= COUNTS[0] && samples.len() as f64 >= MIN_INSIDE * count as f64
}

/// The projection of a 3D segment, `None` unless it lies in front of the camera.
pub(super) fn project_segment(view: &PreparedView, line: &LineSegment3) -> Option<LineSegment2> {
    project_segment_in_front(&view.camera, line)
}

/// Length and unit normal of a 2D segment of a useful length.
pub(super) fn across(segment: &LineSegment2) -> Option<(f64, Vector2<f64>)> {
    across_of(segment, MIN_PROJECTED_LENGTH)
}

fn across_of(segment: &LineSegment2, least: f64) -> Option<(f64, Vector2<f64>)> {
    let offset = segment.end - segment.start;
    let length = offset.norm();
    (least..MAX_PROJECTED_LENGTH)
        .contains(&length)
        .then(|| (length, Vector2::new(-offset.y, offset.x) / length))
}
