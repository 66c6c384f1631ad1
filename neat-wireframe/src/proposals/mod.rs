//! A 3D segment that a field, or anything else, proposes for one 2D segment.

mod robust_segments;

pub use robust_segments::{WeightedSegment, robust_segment};

use neat_core::LineSegment3;

/// One 3D segment per detected 2D segment, with how well it fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentProposal {
    /// Index of the view.
    pub view: usize,
    /// Index into that view's [`crate::ViewObservation::segments`].
    pub segment_in_view: usize,
    /// The 3D segment. Its start belongs to the start of the 2D segment.
    pub segment: LineSegment3,
    /// Distance of each projected end from its 2D end, in pixels.
    pub end_error_in_pixels: [f64; 2],
    /// Median distance of each end among the rays that were averaged, in world
    /// units: how sure the field is.
    pub end_spread: [f64; 2],
}
