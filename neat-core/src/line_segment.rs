//! Finite line segments in the image and in space.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// A finite segment between two points of `D` dimensions.
///
/// The order of the two ends carries no meaning unless a function says so.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineSegment<const D: usize> {
    /// First end point.
    pub start: SVector<f64, D>,
    /// Second end point.
    pub end: SVector<f64, D>,
}

/// A segment in the image, in image coordinates (pixels) unless named otherwise.
pub type LineSegment2 = LineSegment<2>;
/// A segment in space.
pub type LineSegment3 = LineSegment<3>;

impl<const D: usize> LineSegment<D> {
    /// The segment from `start` to `end`.
    pub fn new(start: SVector<f64, D>, end: SVector<f64, D>) -> Self {
        Self { start, end }
    }

    /// Distance between the two ends.
    pub fn length(&self) -> f64 {
        (self.end - self.start).norm()
    }

    /// The same segment with its ends exchanged.
    pub fn reversed(&self) -> Self {
        Self::new(self.end, self.start)
    }

    /// Both ends, start first.
    pub fn ends(&self) -> [SVector<f64, D>; 2] {
        [self.start, self.end]
    }

    /// The point at parameter `t`: 0 is the start, 1 the end.
    pub fn point_at(&self, t: f64) -> SVector<f64, D> {
        self.start + (self.end - self.start) * t
    }

    /// Parameter of the foot of the perpendicular from `point` on the infinite
    /// line, not clamped. Zero for a segment without length.
    pub fn line_parameter(&self, point: &SVector<f64, D>) -> f64 {
        let direction = self.end - self.start;
        let squared_length = direction.norm_squared();
        if squared_length > 0.0 {
            (point - self.start).dot(&direction) / squared_length
        } else {
            0.0
        }
    }

    /// Distance from `point` to the nearest point of the segment.
    pub fn distance_to_point(&self, point: &SVector<f64, D>) -> f64 {
        (self.point_at(self.line_parameter(point).clamp(0.0, 1.0)) - point).norm()
    }

    /// Distance from `point` to the nearest point of the whole line.
    pub fn distance_to_line(&self, point: &SVector<f64, D>) -> f64 {
        (self.point_at(self.line_parameter(point)) - point).norm()
    }

    /// `[start-to-start, end-to-end]` distances to `other`.
    pub fn end_distances(&self, other: &Self) -> [f64; 2] {
        [
            (self.start - other.start).norm(),
            (self.end - other.end).norm(),
        ]
    }

    /// The order of `other`'s ends that lies nearer to this segment, by the sum
    /// of squared end-point distances; ties keep the order.
    pub fn with_nearest_order(&self, other: &Self) -> Self {
        let reversed = other.reversed();
        if self.squared_end_distance(&reversed) < self.squared_end_distance(other) {
            reversed
        } else {
            *other
        }
    }

    /// Sum of the squared distances of corresponding ends.
    pub fn squared_end_distance(&self, other: &Self) -> f64 {
        (self.start - other.start).norm_squared() + (self.end - other.end).norm_squared()
    }

    /// [`Self::squared_end_distance`] in the better of the two orders.
    pub fn unordered_squared_end_distance(&self, other: &Self) -> f64 {
        self.squared_end_distance(other)
            .min(self.squared_end_distance(&other.reversed()))
    }

    /// The same segment with both ends mapped by `f`.
    pub fn map<const E: usize>(
        &self,
        f: impl Fn(&SVector<f64, D>) -> SVector<f64, E>,
    ) -> LineSegment<E> {
        LineSegment::new(f(&self.start), f(&self.end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn distance_is_to_the_segment_not_to_the_line() {
        let segment = LineSegment2::new(Vector2::new(0.0, 0.0), Vector2::new(2.0, 0.0));
        assert_eq!(segment.distance_to_point(&Vector2::new(1.0, 3.0)), 3.0);
        assert_eq!(segment.distance_to_point(&Vector2::new(5.0, 4.0)), 5.0);
        let point = LineSegment2::new(Vector2::new(1.0, 1.0), Vector2::new(1.0, 1.0));
        assert_eq!(point.distance_to_point(&Vector2::new(4.0, 5.0)), 5.0);
    }

    #[test]
    fn nearest_order_swaps_the_ends_only_when_it_helps() {
        let a = LineSegment2::new(Vector2::new(0.0, 0.0), Vector2::new(2.0, 0.0));
        let b = LineSegment2::new(Vector2::new(2.0, 0.1), Vector2::new(0.0, 0.1));
        assert_eq!(a.with_nearest_order(&b), b.reversed());
        assert_eq!(a.with_nearest_order(&a), a);
        assert!((a.unordered_squared_end_distance(&b) - 0.02).abs() < 1e-12);
    }
}
