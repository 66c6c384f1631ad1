//! Which pixels lie on segments that are already found.

use crate::line_fitting::{FittedSegment, normal_of};
use nalgebra::Vector2;
use neat_core::LineSegment2;

/// Pixels this far from a segment are its own.
const HALF_WIDTH: i32 = 1;
/// A segment is known if one other owns this share of its pixels.
const KNOWN_SHARE: f64 = 0.85;
/// Sine of the largest angle between a segment and the one that it repeats.
const MAX_SIN_ANGLE: f64 = 0.1;

/// For every pixel of an image the last segment that was claimed there.
pub(crate) struct ClaimedPixels {
    width: usize,
    height: usize,
    /// 0 for none, otherwise the segment's number plus 1.
    owners: Vec<u32>,
    directions: Vec<Vector2<f64>>,
}

impl ClaimedPixels {
    /// Nothing is claimed yet.
    pub(crate) fn new([width, height]: [usize; 2]) -> Self {
        Self {
            width,
            height,
            owners: vec![0; width * height],
            directions: Vec::new(),
        }
    }

    /// Claims the pixels of a segment.
    pub(crate) fn claim(&mut self, fitted: &FittedSegment) {
        let direction = fitted.direction();
        let normal = normal_of(&direction);
        self.directions.push(direction);
        let owner = self.directions.len() as u32;
        for point in points_along(&fitted.segment) {
            for step in -HALF_WIDTH..=HALF_WIDTH {
                if let Some(index) = self.index(&(point + normal * f64::from(step))) {
                    self.owners[index] = owner;
                }
            }
        }
    }

    /// Whether nearly all of `segment` lies on one claimed segment of about its
    /// direction.
    pub(crate) fn contain(&self, segment: &LineSegment2) -> bool {
        let direction = (segment.end - segment.start).normalize();
        let mut counts: Vec<(u32, usize)> = Vec::new();
        let mut total = 0;
        for point in points_along(segment) {
            total += 1;
            let owner = self.index(&point).map_or(0, |index| self.owners[index]);
            match counts.iter_mut().find(|(known, _)| *known == owner) {
                Some((_, count)) => *count += 1,
                None => counts.push((owner, 1)),
            }
        }
        counts.iter().any(|&(owner, count)| {
            owner > 0
                && count as f64 >= KNOWN_SHARE * f64::from(total)
                && self.directions[owner as usize - 1].perp(&direction).abs() <= MAX_SIN_ANGLE
        })
    }

    fn index(&self, point: &Vector2<f64>) -> Option<usize> {
        let [column, row] = [point.x.round(), point.y.round()];
        let inside =
            column >= 0.0 && row >= 0.0 && column < self.width as f64 && row < self.height as f64;
        inside.then(|| row as usize * self.width + column as usize)
    }
}

/// Points of a segment less than a pixel apart.
fn points_along(segment: &LineSegment2) -> impl Iterator<Item = Vector2<f64>> + use<> {
    let segment = *segment;
    let steps = segment.length().ceil().max(1.0) as usize;
    (0..=steps).map(move |step| segment.point_at(step as f64 / steps as f64))
}
