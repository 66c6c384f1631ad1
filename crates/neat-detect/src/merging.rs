//! One segment for each image edge: duplicates go, pieces of one line are joined.

use crate::line_fitting::{FittedSegment, LineFitter, normal_of};
use neat_core::LineSegment2;

/// Edges of opposite contrast, such as the two sides of a thin line, are one
/// only if they are nearer than this, in pixels.
const SAME_EDGE: f64 = 0.75;
/// A fit to joined pieces must keep so much of their joint length.
const MIN_KEPT_LENGTH: f64 = 0.9;
/// A fit to joined pieces has at most this residual, in pixels.
const MAX_RESIDUAL: f64 = 0.6;

/// How near collinear segments must be to become one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MergeLimits {
    /// Between a segment's ends and the other's line, in pixels.
    pub distance: f64,
    /// Sine of the largest angle between them.
    pub sin_angle: f64,
    /// Between the two along their line, in pixels.
    pub gap: f64,
}

/// Merges `segments` until no two belong together. The result is sorted by
/// length, longest first.
pub(crate) fn merge(
    mut segments: Vec<FittedSegment>,
    fitter: &LineFitter,
    limits: &MergeLimits,
) -> Vec<FittedSegment> {
    loop {
        segments.sort_by(|a, b| b.segment.length().total_cmp(&a.segment.length()));
        let before = segments.len();
        let mut kept: Vec<FittedSegment> = Vec::new();
        for segment in segments {
            let merged = (kept.iter_mut()).find_map(|long| {
                joined(long, &segment, fitter, limits).map(|joined| *long = joined)
            });
            if merged.is_none() {
                kept.push(segment);
            }
        }
        if kept.len() == before {
            return kept;
        }
        segments = kept;
    }
}

/// The one segment that stands for both; `None` if they are two.
fn joined(
    long: &FittedSegment,
    short: &FittedSegment,
    fitter: &LineFitter,
    limits: &MergeLimits,
) -> Option<FittedSegment> {
    let direction = long.direction();
    let normal = normal_of(&direction);
    let across = short
        .segment
        .ends()
        .map(|end| (end - long.segment.start).dot(&normal));
    let same_way = direction.dot(&short.direction()) >= 0.0;
    let same_contrast = (long.change.dot(&short.change) >= 0.0) == same_way;
    let distance = if same_contrast {
        limits.distance
    } else {
        SAME_EDGE
    };
    if across.iter().any(|d| d.abs() > distance) {
        return None;
    }
    let length = long.segment.length();
    let along = short
        .segment
        .ends()
        .map(|end| (end - long.segment.start).dot(&direction));
    let [first, last] = [along[0].min(along[1]), along[0].max(along[1])];
    if first > length + limits.gap || last < -limits.gap {
        return None;
    }
    let margin = limits.distance;
    if first >= -margin && last <= length + margin {
        return Some(long.clone());
    }
    if direction.perp(&short.direction()).abs() > limits.sin_angle {
        return None;
    }
    // The outermost ends, so that the fit starts between both lines.
    let (order, mut ends) = if same_way {
        ([0, 1], long.segment.ends())
    } else {
        ([1, 0], long.segment.ends())
    };
    let short_ends = short.segment.ends();
    if along[order[0]] < 0.0 {
        ends[0] = short_ends[order[0]];
    }
    if along[order[1]] > length {
        ends[1] = short_ends[order[1]];
    }
    let whole = LineSegment2::new(ends[0], ends[1]);
    let fitted = fitter.fit(&whole)?;
    let good = fitted.residual <= MAX_RESIDUAL
        && fitted.segment.length() >= MIN_KEPT_LENGTH * whole.length();
    good.then_some(fitted)
}
