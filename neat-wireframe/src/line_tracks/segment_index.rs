//! Which 2D segments of an image pass near a given one: a grid of cells.

use nalgebra::Vector2;
use neat_core::LineSegment2;

/// Side of a cell in pixels.
const CELL: f64 = 24.0;
/// The grid has at most this many cells along one side, whatever the image.
const MAX_CELLS: usize = 512;

/// Segments by the cells that they touch.
#[derive(Clone, Debug)]
pub(crate) struct SegmentIndex {
    cell: f64,
    columns: usize,
    rows: usize,
    /// Segments of each cell, row by row; ascending.
    cells: Vec<Vec<u32>>,
}

impl SegmentIndex {
    /// Indexes finite segments of a `width × height` image. Parts outside the
    /// image count to the nearest cell.
    pub(crate) fn new(segments: &[LineSegment2], width: u32, height: u32) -> Self {
        let longest = f64::from(width.max(height));
        let cell = CELL.max(longest / MAX_CELLS as f64);
        let count = |size: u32| ((f64::from(size) / cell).ceil() as usize).clamp(1, MAX_CELLS);
        let mut index = Self {
            cell,
            columns: count(width),
            rows: count(height),
            cells: Vec::new(),
        };
        index.cells = vec![Vec::new(); index.columns * index.rows];
        for (i, segment) in segments.iter().enumerate() {
            for cell in index.cells_of(segment, 0) {
                index.cells[cell].push(i as u32);
            }
        }
        index
    }

    /// The segments that may lie within one cell's side of `segment`, ascending.
    pub(crate) fn near(&self, segment: &LineSegment2) -> Vec<usize> {
        let mut found: Vec<usize> = self
            .cells_of(segment, 1)
            .into_iter()
            .flat_map(|cell| self.cells[cell].iter().map(|i| *i as usize))
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The cells that a segment touches and `margin` cells around them.
    fn cells_of(&self, segment: &LineSegment2, margin: usize) -> Vec<usize> {
        let Some(segment) = self.clipped(segment) else {
            return Vec::new();
        };
        // Half a cell per step: no cell is passed over by more than its corner.
        let steps = (segment.length() / (0.5 * self.cell)).ceil().max(1.0) as usize;
        let mut cells = Vec::new();
        for step in 0..=steps {
            let point = segment.point_at(step as f64 / steps as f64);
            let column = self.coordinate(point.x, self.columns);
            let row = self.coordinate(point.y, self.rows);
            for row in row.saturating_sub(margin)..=(row + margin).min(self.rows - 1) {
                for column in
                    column.saturating_sub(margin)..=(column + margin).min(self.columns - 1)
                {
                    cells.push(row * self.columns + column);
                }
            }
        }
        cells.sort_unstable();
        cells.dedup();
        cells
    }

    fn coordinate(&self, x: f64, count: usize) -> usize {
        // A negative number becomes 0.
        ((x / self.cell) as usize).min(count - 1)
    }

    /// The part within the image and one cell around it.
    fn clipped(&self, segment: &LineSegment2) -> Option<LineSegment2> {
        let upper = Vector2::new(self.columns as f64, self.rows as f64).add_scalar(1.0) * self.cell;
        let offset = segment.end - segment.start;
        let (mut low, mut high) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let (start, step) = (segment.start[axis], offset[axis]);
            let bounds = [-self.cell - start, upper[axis] - start];
            if step == 0.0 {
                if bounds[0] > 0.0 || bounds[1] < 0.0 {
                    return None;
                }
                continue;
            }
            let [a, b] = bounds.map(|bound| bound / step);
            low = low.max(a.min(b));
            high = high.min(a.max(b));
        }
        (low <= high).then(|| LineSegment2::new(segment.point_at(low), segment.point_at(high)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    fn segment(x0: f64, y0: f64, x1: f64, y1: f64) -> LineSegment2 {
        LineSegment2::new(Vector2::new(x0, y0), Vector2::new(x1, y1))
    }

    #[test]
    fn every_near_segment_is_found() {
        let mut noise = Noise(3);
        let mut point = || 250.0 * Vector2::new(1.0 + noise.uniform(), 1.0 + noise.uniform());
        let segments: Vec<_> = (0..300)
            .map(|_| LineSegment2::new(point(), point()))
            .collect();
        let index = SegmentIndex::new(&segments, 500, 500);
        for query in &segments[..20] {
            let found = index.near(query);
            for (i, other) in segments.iter().enumerate() {
                let distance = (0..=100)
                    .map(|k| other.distance_to_point(&query.point_at(f64::from(k) / 100.0)))
                    .fold(f64::INFINITY, f64::min);
                assert!(distance > 4.0 || found.contains(&i), "{i} at {distance}");
            }
        }
    }

    #[test]
    fn far_segments_are_not_looked_at_and_anything_may_be_asked() {
        let segments = [
            segment(10.0, 10.0, 40.0, 10.0),
            segment(400.0, 400.0, 450.0, 400.0),
        ];
        let index = SegmentIndex::new(&segments, 500, 500);
        assert_eq!(index.near(&segment(5.0, 12.0, 30.0, 12.0)), [0]);
        assert_eq!(index.near(&segment(-1e9, 420.0, 1e9, 420.0)), [1]);
        assert!(index.near(&segment(-90.0, 0.0, -80.0, 1e12)).is_empty());
        assert!(index.near(&segment(f64::NAN, 0.0, 1.0, 1.0)).len() <= 2);
    }
}
