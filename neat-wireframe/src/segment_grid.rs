//! Which 2D segments of an image pass near a point or another segment: a grid of
//! cells.

use nalgebra::Vector2;
use neat_core::LineSegment2;

/// Side of a cell in pixels.
const CELL: f64 = 24.0;
/// The grid has at most this many cells along one side, whatever the image.
const MAX_CELLS: usize = 512;
/// Cells are sampled along a segment at this share of their side …
const SAMPLING: f64 = 0.5;
/// … and never more often than this, which is more than its diagonal takes.
const MAX_SAMPLES: f64 = 4.0 * MAX_CELLS as f64;

/// Segments by the cells that they touch.
#[derive(Clone, Debug)]
pub(crate) struct SegmentGrid {
    cell: f64,
    columns: usize,
    rows: usize,
    /// Segments of each cell, row by row; ascending.
    cells: Vec<Vec<u32>>,
}

impl SegmentGrid {
    /// Indexes the segments of a `width × height` image. Parts up to one cell
    /// outside the image count to the nearest cell; parts farther out, and
    /// segments that are not finite, are never found.
    pub(crate) fn new(segments: &[LineSegment2], width: u32, height: u32) -> Self {
        let longest = f64::from(width.max(height));
        let cell = CELL.max(longest / MAX_CELLS as f64);
        let count = |size: u32| ((f64::from(size) / cell).ceil() as usize).clamp(1, MAX_CELLS);
        let mut grid = Self {
            cell,
            columns: count(width),
            rows: count(height),
            cells: Vec::new(),
        };
        grid.cells = vec![Vec::new(); grid.columns * grid.rows];
        for (i, segment) in segments.iter().enumerate() {
            for cell in grid.cells_of(segment, 0) {
                grid.cells[cell].push(i as u32);
            }
        }
        grid
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

    /// Names every segment that passes at most `radius` away from `point`, and
    /// others; some more than once.
    pub(crate) fn for_each_near(
        &self,
        point: &Vector2<f64>,
        radius: f64,
        mut visit: impl FnMut(usize),
    ) {
        // No point of a segment is farther from the next sample.
        let reach = radius + 0.5 * SAMPLING * self.cell;
        let range = |x: f64, count: usize| {
            self.coordinate(x - reach, count)..=self.coordinate(x + reach, count)
        };
        for row in range(point.y, self.rows) {
            for column in range(point.x, self.columns) {
                for index in &self.cells[row * self.columns + column] {
                    visit(*index as usize);
                }
            }
        }
    }

    /// The cells that a segment touches, but for corners, and `margin` cells
    /// around them; ascending.
    fn cells_of(&self, segment: &LineSegment2, margin: usize) -> Vec<usize> {
        let clipped = self.clipped(segment);
        let Some(segment) = clipped.filter(|segment| segment.length().is_finite()) else {
            return Vec::new();
        };
        let steps = (segment.length() / (SAMPLING * self.cell)).ceil();
        let steps = steps.clamp(1.0, MAX_SAMPLES) as usize;
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

    fn found_at(grid: &SegmentGrid, point: &Vector2<f64>, radius: f64) -> Vec<usize> {
        let mut found = Vec::new();
        grid.for_each_near(point, radius, |index| found.push(index));
        found
    }

    #[test]
    fn every_near_segment_is_found_and_few_others() {
        let mut noise = Noise(3);
        // The image is 500 × 300; some lie up to 20 pixels outside.
        let mut point = || {
            let [x, y] = [noise.uniform(), noise.uniform()];
            Vector2::new(250.0 + 270.0 * x, 150.0 + 170.0 * y)
        };
        let mut segments: Vec<_> = (0..300)
            .map(|_| LineSegment2::new(point(), point()))
            .collect();
        segments.push(segment(48.0, 24.0, 48.0, 96.0));
        segments.push(segment(48.0, 24.0, 120.0, 24.0));
        let grid = SegmentGrid::new(&segments, 500, 300);
        let mut named_in_all = 0;
        for query in &segments[..100] {
            let found = grid.near(query);
            for (i, other) in segments.iter().enumerate() {
                let distance = (0..=100)
                    .map(|k| other.distance_to_point(&query.point_at(f64::from(k) / 100.0)))
                    .fold(f64::INFINITY, f64::min);
                assert!(distance > 4.0 || found.contains(&i), "{i} at {distance}");
            }
            let mut found = found_at(&grid, &query.start, 5.0);
            found.sort_unstable();
            found.dedup();
            for (i, other) in segments.iter().enumerate() {
                let distance = other.distance_to_point(&query.start);
                assert!(distance > 5.0 || found.contains(&i), "{i} at {distance}");
            }
            named_in_all += found.len();
        }
        assert!(named_in_all < 100 * segments.len() / 3, "{named_in_all}");
    }

    #[test]
    fn far_segments_are_not_looked_at_and_anything_may_be_asked() {
        let segments = [
            segment(10.0, 10.0, 40.0, 10.0),
            segment(400.0, 400.0, 450.0, 400.0),
        ];
        let index = SegmentGrid::new(&segments, 500, 500);
        assert_eq!(index.near(&segment(5.0, 12.0, 30.0, 12.0)), [0]);
        assert_eq!(index.near(&segment(-1e9, 420.0, 1e9, 420.0)), [1]);
        assert!(index.near(&segment(-90.0, 0.0, -80.0, 1e12)).is_empty());
        for odd in [f64::NAN, f64::INFINITY, -1e200, 1e300] {
            assert!(index.near(&segment(odd, 0.0, 1.0, 1.0)).len() <= 2);
            assert!(index.near(&segment(odd, odd, -odd, 3.0)).len() <= 2);
            let point = Vector2::new(odd, 20.0);
            assert!(found_at(&index, &point, 5.0).iter().all(|i| *i < 2));
        }
        for size in [0, 1, u32::MAX] {
            let far = segment(-1e200, 3.0, 1e250, -1e99);
            let grid = SegmentGrid::new(&[far, far, segments[0]], size, size);
            assert!(grid.near(&far).len() <= 3);
        }
        let none = SegmentGrid::new(&[], 9, 9);
        assert!(found_at(&none, &Vector2::zeros(), 1e9).is_empty());
    }
}
