//! How well a detected 2D segment fits a projected edge.

use neat_core::LineSegment2;

/// Edges shorter than this have no direction.
const MIN_LENGTH: f64 = 1e-9;

/// Fit of a detection to a projected edge, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentMatch {
    /// Distance from the edge's infinite line of the detection's farther end.
    pub perpendicular_distance: f64,
    /// Share of the edge that the detection covers, in [0, 1].
    pub overlap: f64,
    /// Larger of the two end-to-end distances, in the better order.
    pub end_distance: f64,
}

/// Compares a detection with a projected edge.
pub fn match_segment(edge: &LineSegment2, detection: &LineSegment2) -> SegmentMatch {
    let length = edge.length().max(MIN_LENGTH);
    let direction = (edge.end - edge.start) / length;
    let from_start = detection.ends().map(|end| end - edge.start);
    let across = from_start.map(|offset| offset.perp(&direction).abs());
    let along = from_start.map(|offset| offset.dot(&direction));
    let low = along[0].min(along[1]).max(0.0);
    let high = along[0].max(along[1]).min(length);
    let farther_end = |other: &LineSegment2| {
        let [start, end] = edge.end_distances(other);
        start.max(end)
    };
    SegmentMatch {
        perpendicular_distance: across[0].max(across[1]),
        overlap: (high - low).max(0.0) / length,
        end_distance: farther_end(detection).min(farther_end(&detection.reversed())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    fn segment(x0: f64, y0: f64, x1: f64, y1: f64) -> LineSegment2 {
        LineSegment2::new(Vector2::new(x0, y0), Vector2::new(x1, y1))
    }

    #[test]
    fn measures_on_a_hand_made_pair() {
        let edge = segment(0.0, 0.0, 10.0, 0.0);
        let fit = match_segment(&edge, &segment(12.0, 2.0, 4.0, -1.0));
        assert_eq!(fit.perpendicular_distance, 2.0);
        assert!((fit.overlap - 0.6).abs() < 1e-12);
        assert!((fit.end_distance - 17f64.sqrt()).abs() < 1e-12);
        let beside = match_segment(&edge, &segment(11.0, 0.0, 20.0, 0.0));
        assert_eq!(beside.overlap, 0.0);
    }

    #[test]
    fn an_edge_without_length_is_covered_by_nothing() {
        let point = segment(3.0, 3.0, 3.0, 3.0);
        let fit = match_segment(&point, &segment(0.0, 0.0, 9.0, 0.0));
        assert_eq!(fit.overlap, 0.0);
        assert!(fit.end_distance.is_finite());
    }
}
