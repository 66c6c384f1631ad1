//! NEAT lines beside the 2D segments that they belong to. Not in the paper.
//!
//! A line says where the field puts a 2D segment, some pixels off; the segment says where the
//! image has it, to a part of a pixel.

use super::neat_lines::NeatLine;
use crate::ViewObservation;
use nalgebra::{Vector2, Vector3};
use neat_core::{LineSegment2, LineSegment3};

/// A 2D segment with its NEAT line.
#[derive(Clone, Copy, Debug)]
pub(super) struct RenderedLine {
    pub(super) view: usize,
    /// As it was detected.
    pub(super) detection: LineSegment2,
    /// Of the detection.
    pub(super) score: f64,
    /// Where the field puts it; its start belongs to the detection's.
    pub(super) segment: LineSegment3,
    /// Length of a pixel at its middle, in world units.
    pub(super) pixel: f64,
}

/// One end of a [`RenderedLine`].
#[derive(Clone, Copy, Debug)]
pub(super) struct RenderedEnd {
    pub(super) view: usize,
    /// Where it was detected.
    pub(super) detected: Vector2<f64>,
    /// Where the field puts it.
    pub(super) place: Vector3<f64>,
    /// Length of a pixel there, in world units.
    pub(super) pixel: f64,
}

impl RenderedLine {
    /// Start and end.
    pub(super) fn ends(&self) -> [RenderedEnd; 2] {
        [0, 1].map(|side| RenderedEnd {
            view: self.view,
            detected: self.detection.ends()[side],
            place: self.segment.ends()[side],
            pixel: self.pixel,
        })
    }
}

/// The lines of all views that lie before their cameras.
pub(super) fn rendered_lines(
    views: &[ViewObservation],
    lines_by_view: &[Vec<NeatLine>],
) -> Vec<RenderedLine> {
    let rendered = |view: usize, line: &NeatLine| {
        let ViewObservation {
            camera, segments, ..
        } = &views[view];
        let depth = camera.project(&line.segment.point_at(0.5)).depth;
        let detected = &segments[line.segment_in_view];
        (depth > 0.0).then_some(RenderedLine {
            view,
            detection: detected.segment,
            score: detected.score,
            segment: line.segment,
            pixel: depth / camera.intrinsics.fx,
        })
    };
    let of_view = |(view, lines): (usize, &Vec<NeatLine>)| -> Vec<RenderedLine> {
        lines
            .iter()
            .filter_map(|line| rendered(view, line))
            .collect()
    };
    lines_by_view.iter().enumerate().flat_map(of_view).collect()
}
