//! Which 2D segments of an image pass near a point: a grid of cells.

use nalgebra::Vector2;
use neat_core::LineSegment2;

/// Smallest side of a cell in pixels.
const MIN_CELL: f64 = 16.0;
/// The grid has at most this many cells along one side, whatever the image.
const MAX_CELLS: usize = 256;

/// Segments by the cells that they pass through. Cells at the border hold what
/// lies beyond it.
pub(crate) struct SegmentGrid {
    cell: f64,
    columns: usize,
    rows: usize,
    /// Where the segments of each cell begin in `segments`, row by row, and
    /// where the last ones end.
    begins: Vec<usize>,
    segments: Vec<u32>,
}

impl SegmentGrid {
    /// Indexes the finite segments of a `width × height` image.
    pub(crate) fn new(segments: &[LineSegment2], width: u32, height: u32) -> Self {
        let longest = f64::from(width.max(height));
        let cell = MIN_CELL.max(longest / MAX_CELLS as f64);
        let count = |size: u32| ((f64::from(size) / cell).ceil() as usize).clamp(1, MAX_CELLS);
        let mut grid = Self {
            cell,
            columns: count(width),
            rows: count(height),
            begins: Vec::new(),
            segments: Vec::new(),
        };
        // Count what each cell holds, then fill: no list per cell.
        let mut begins = vec![0; grid.columns * grid.rows + 1];
        for segment in segments {
            grid.for_each_cell(segment, |cell| begins[cell + 1] += 1);
        }
        for cell in 1..begins.len() {
            begins[cell] += begins[cell - 1];
        }
        let mut next = begins.clone();
        let mut indices = vec![0; begins.last().copied().unwrap_or(0)];
        for (index, segment) in segments.iter().enumerate() {
            grid.for_each_cell(segment, |cell| {
                indices[next[cell]] = index as u32;
                next[cell] += 1;
            });
        }
        grid.begins = begins;
        grid.segments = indices;
        grid
    }

    /// Names every segment that passes at most `radius` away from `point`, and
    /// others; some more than once.
    pub(crate) fn for_each_near(
        &self,
        point: &Vector2<f64>,
        radius: f64,
        mut visit: impl FnMut(usize),
    ) {
        let columns = [point.x - radius, point.x + radius].map(|x| self.column(x));
        let rows = [point.y - radius, point.y + radius].map(|y| self.row(y));
        for row in rows[0]..=rows[1] {
            // The cells of a row lie one after the other.
            let first = row * self.columns + columns[0];
            let last = row * self.columns + columns[1];
            for index in &self.segments[self.begins[first]..self.begins[last + 1]] {
                visit(*index as usize);
            }
        }
    }

    /// The cells that a segment passes through.
    fn for_each_cell(&self, segment: &LineSegment2, mut visit: impl FnMut(usize)) {
        let [mut left, mut right] = segment.ends();
        if left.x > right.x {
            std::mem::swap(&mut left, &mut right);
        }
        // More than rounding can move a crossing of a column's border.
        let margin = 1e-6 + 1e-9 * (left.y.abs() + right.y.abs());
        let slope = (right.y - left.y) / (right.x - left.x);
        let y_at = |x: f64| left.y + (x - left.x) * slope;
        let (first, last) = (self.column(left.x - 1e-6), self.column(right.x + 1e-6));
        for column in first..=last {
            let from = self.cell * column as f64;
            let enter = if column > first && from > left.x {
                y_at(from)
            } else {
                left.y
            };
            let to = from + self.cell;
            let leave = if column < last && to < right.x {
                y_at(to)
            } else {
                right.y
            };
            let rows = self.row(enter.min(leave) - margin)..=self.row(enter.max(leave) + margin);
            for row in rows {
                visit(row * self.columns + column);
            }
        }
    }

    fn column(&self, x: f64) -> usize {
        // A negative number becomes 0.
        ((x / self.cell) as usize).min(self.columns - 1)
    }

    fn row(&self, y: f64) -> usize {
        ((y / self.cell) as usize).min(self.rows - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    #[test]
    fn every_near_segment_is_named_and_few_others() {
        let mut noise = Noise(3);
        // Some of it outside the image of 500 × 300 pixels.
        let mut point = || 300.0 * Vector2::new(0.8 + noise.uniform(), 0.5 + noise.uniform());
        let mut segments: Vec<_> = (0..300)
            .map(|_| LineSegment2::new(point(), point()))
            .collect();
        let vertical = Vector2::new(48.0, 16.0);
        segments.push(LineSegment2::new(vertical, vertical + 64.0 * Vector2::y()));
        segments.push(LineSegment2::new(vertical, vertical + 64.0 * Vector2::x()));
        let grid = SegmentGrid::new(&segments, 500, 300);
        let mut named_in_all = 0;
        for _ in 0..300 {
            let point = point();
            let mut named = vec![false; segments.len()];
            grid.for_each_near(&point, 5.0, |index| named[index] = true);
            for (segment, named) in segments.iter().zip(&named) {
                assert!(*named || segment.distance_to_point(&point) > 5.0);
            }
            named_in_all += named.iter().filter(|named| **named).count();
        }
        assert!(named_in_all < 300 * segments.len() / 4);
    }

    #[test]
    fn anything_may_be_indexed_and_asked() {
        let far = LineSegment2::new(Vector2::new(-1e200, 3.0), Vector2::new(1e250, -1e99));
        for size in [0, 1, u32::MAX] {
            let grid = SegmentGrid::new(&[far, far], size, size);
            grid.for_each_near(&Vector2::new(f64::NAN, 1e300), 5.0, |index| {
                assert!(index < 2)
            });
        }
        SegmentGrid::new(&[], 9, 9).for_each_near(&Vector2::zeros(), 1e9, |_| unreachable!());
    }
}
