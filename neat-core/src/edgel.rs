//! Points of image edges, to a fraction of a pixel: what segments are made of, and what
//! remains where no detector found a segment.

use crate::LineSegment2;
use nalgebra::Vector2;
use std::ops::{ControlFlow, Range};

/// Side of a cell of the index, in pixels: a search of a few pixels visits four at most.
const CELL: f64 = 4.0;
/// The index has at most this many cells along one side, whatever size an image claims.
const MAX_CELLS: f64 = 2048.0;
/// An edgel lies beside a point within so many pixels along the edge: edgels are about a pixel
/// apart.
const ALONG: f64 = 0.75;

/// A point of an image edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edgel {
    /// In image coordinates.
    pub position: Vector2<f32>,
    /// Unit vector across the edge.
    pub normal: Vector2<f32>,
}

/// All edge points of an image, by where they are.
#[derive(Clone, Debug, Default)]
pub struct EdgelMap {
    /// Side of a cell, in pixels.
    cell: f64,
    columns: usize,
    rows: usize,
    /// First edgel of each cell, row by row, and the end.
    starts: Vec<u32>,
    edgels: Vec<Edgel>,
}

impl EdgelMap {
    /// Indexes the edgels of a `width × height` image; those outside it, and those that
    /// are not finite, are left out.
    pub fn new(edgels: &[Edgel], width: u32, height: u32) -> Self {
        let side = CELL.max(f64::from(width.max(height)) / MAX_CELLS);
        let cells = |size: u32| ((f64::from(size) / side).ceil() as usize).max(1);
        let (columns, rows) = (cells(width), cells(height));
        let cell_of = |edgel: &Edgel| {
            let [x, y] = [edgel.position.x, edgel.position.y].map(f64::from);
            let inside = x >= 0.0 && y >= 0.0 && x < f64::from(width) && y < f64::from(height);
            let finite = edgel.normal.iter().all(|value| value.is_finite());
            (inside && finite).then(|| (y / side) as usize * columns + (x / side) as usize)
        };
        let mut starts = vec![0_u32; columns * rows + 1];
        for cell in edgels.iter().filter_map(cell_of) {
            starts[cell + 1] += 1;
        }
        for cell in 0..columns * rows {
            starts[cell + 1] += starts[cell];
        }
        let mut next = starts.clone();
        let placeholder = Edgel {
            position: Vector2::zeros(),
            normal: Vector2::zeros(),
        };
        let mut sorted = vec![placeholder; starts[columns * rows] as usize];
        for edgel in edgels {
            if let Some(cell) = cell_of(edgel) {
                sorted[next[cell] as usize] = *edgel;
                next[cell] += 1;
            }
        }
        Self {
            cell: side,
            columns,
            rows,
            starts,
            edgels: sorted,
        }
    }

    /// The edgels that segments stand for, one per pixel of their lengths: for images that
    /// are known by their segments only.
    pub fn of_segments(segments: &[LineSegment2], width: u32, height: u32) -> Self {
        /// No image is longer; a hostile segment must not fill the memory.
        const MOST: f64 = 1e5;
        let mut edgels = Vec::new();
        for segment in segments {
            let offset = segment.end - segment.start;
            let length = offset.norm();
            if !(length > 0.0 && length < MOST) {
                continue;
            }
            let normal = Vector2::new(-offset.y, offset.x) / length;
            let count = length.ceil();
            edgels.extend((0..count as usize).map(|i| Edgel {
                position: segment.point_at((i as f64 + 0.5) / count).cast(),
                normal: normal.cast(),
            }));
        }
        Self::new(&edgels, width, height)
    }

    /// The edgel with this index.
    pub fn get(&self, index: usize) -> &Edgel {
        &self.edgels[index]
    }

    /// Number of edgels.
    pub fn len(&self) -> usize {
        self.edgels.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.edgels.is_empty()
    }

    /// The edgel nearest to `point` across an edge whose unit normal is `normal`: its signed
    /// distance along the normal, at most `reach` pixels, and its index. Only those count
    /// that lie beside `point`, whose own normal has at least the cosine `min_cosine` to
    /// `normal`, and that are `wanted`.
    pub fn nearest(
        &self,
        point: &Vector2<f64>,
        normal: &Vector2<f64>,
        reach: f64,
        min_cosine: f64,
        wanted: impl Fn(usize) -> bool,
    ) -> Option<(f64, usize)> {
        let mut nearest: Option<(f64, usize)> = None;
        self.visit(point, normal, reach, min_cosine, |across, index| {
            if nearest.is_none_or(|(best, _)| across.abs() < best.abs()) && wanted(index) {
                nearest = Some((across, index));
            }
            ControlFlow::Continue(())
        });
        nearest
    }

    /// Calls `found` with the signed distance and the index of each edgel of which
    /// [`Self::nearest`] finds the nearest one, until it breaks.
    #[inline]
    pub fn visit(
        &self,
        point: &Vector2<f64>,
        normal: &Vector2<f64>,
        reach: f64,
        min_cosine: f64,
        mut found: impl FnMut(f64, usize) -> ControlFlow<()>,
    ) {
        if self.edgels.is_empty() {
            return;
        }
        let [x, y] = [point.x, point.y];
        // Half of the strip's sides along the axes of the image: its length, its width.
        let [length_x, length_y] = [reach * normal.x.abs(), reach * normal.y.abs()];
        let [width_x, width_y] = [ALONG * normal.y.abs(), ALONG * normal.x.abs()];
        let whole = [x - length_x - width_x, x + length_x + width_x];
        let [first, last] = [y - length_y - width_y, y + length_y + width_y];
        for row in self.cells([first, last], self.rows) {
            // A strip that passes many rows is in few columns of each.
            let columns = if length_y > ALONG {
                let top = row as f64 * self.cell - y;
                let [low, high] = [top - width_y, top + self.cell + width_y]
                    .map(|y| (y / normal.y).clamp(-reach, reach) * normal.x);
                [x + low.min(high) - width_x, x + low.max(high) + width_x]
            } else {
                whole
            };
            let cells = self.cells(columns, self.columns);
            let first = self.starts[row * self.columns + cells.start] as usize;
            let last = self.starts[row * self.columns + cells.end] as usize;
            for (index, edgel) in (first..last).zip(&self.edgels[first..last]) {
                let offset = edgel.position.cast::<f64>() - point;
                let across = offset.dot(normal);
                let along = (offset.x * normal.y - offset.y * normal.x).abs();
                let cosine = edgel.normal.cast::<f64>().dot(normal).abs();
                // One branch: which of them fails cannot be foretold.
                let beside = (across.abs() <= reach) & (along <= ALONG);
                if beside & (cosine >= min_cosine) && found(across, index).is_break() {
                    return;
                }
            }
        }
    }

    /// The cells between two coordinates along an axis of `count` cells. A conversion is much
    /// quicker than rounding down, and differs only before the first cell.
    #[inline(always)]
    fn cells(&self, [low, high]: [f64; 2], count: usize) -> Range<usize> {
        let cell = |x: f64| ((x / self.cell) as usize).min(count);
        // Not so for NaN.
        if high >= 0.0 && low <= high {
            cell(low)..(cell(high) + 1).min(count)
        } else {
            0..0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> EdgelMap {
        let segment = |a: [f64; 2], b: [f64; 2]| LineSegment2::new(a.into(), b.into());
        // Two upright lines, and one across.
        let segments = [
            segment([20.25, 5.0], [20.25, 45.0]),
            segment([22.0, 5.0], [22.0, 45.0]),
            segment([5.0, 30.0], [60.0, 30.0]),
        ];
        EdgelMap::of_segments(&segments, 64, 48)
    }

    #[test]
    fn the_nearest_edgel_of_an_edge_is_found_across_it() {
        let map = map();
        let normal = Vector2::x();
        let find =
            |x: f64, reach: f64| map.nearest(&Vector2::new(x, 20.3), &normal, reach, 0.9, |_| true);
        let (distance, _) = find(20.0, 1.0).unwrap();
        assert!((distance - 0.25).abs() < 1e-5);
        let (distance, index) = find(21.5, 2.0).unwrap();
        assert!((distance - 0.5).abs() < 1e-5);
        assert_eq!(map.get(index).position.x, 22.0);
        assert!(find(25.0, 2.0).is_none());
        // What runs across is another edge.
        let on_cross = Vector2::new(40.0, 30.0);
        assert!(
            map.nearest(&on_cross, &normal, 2.0, 0.9, |_| true)
                .is_none()
        );
        // The unwanted is passed over.
        let other = map.nearest(&Vector2::new(21.5, 20.3), &normal, 2.0, 0.9, |i| i != index);
        assert!(other.is_none_or(|(_, i)| i != index));
    }

    #[test]
    fn every_place_finds_what_all_edgels_together_tell() {
        let map = map();
        // Oblique, along the rows and along the columns; within few cells and across many.
        let strips = [
            ([0.8, 0.6], 3.0),
            ([0.6, -0.8], 12.5),
            ([-0.96, 0.28], 12.5),
            ([1.0, 0.0], 12.5),
            ([0.0, -1.0], 12.5),
        ];
        let steps = strips
            .iter()
            .flat_map(|strip| (0..2000_u32).map(move |step| (strip, step)));
        for (&(normal, reach), step) in steps {
            let normal = Vector2::from(normal);
            let point = Vector2::new(
                f64::from(step * 37 % 700) / 10.0 - 3.0,
                f64::from(step * 53 % 540) / 10.0 - 3.0,
            );
            let beside = |edgel: &Edgel| {
                let offset = edgel.position.cast::<f64>() - point;
                let along = (offset.x * normal.y - offset.y * normal.x).abs();
                (along <= 0.75 && edgel.normal.cast::<f64>().dot(&normal).abs() >= 0.5)
                    .then(|| offset.dot(&normal).abs())
            };
            let expected = (0..map.len())
                .filter_map(|i| beside(map.get(i)))
                .filter(|d| *d <= reach)
                .reduce(f64::min);
            let found = map
                .nearest(&point, &normal, reach, 0.5, |_| true)
                .map(|(d, _)| d.abs());
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn what_is_no_edgel_is_left_out() {
        let edgel = |x: f32, y: f32| Edgel {
            position: Vector2::new(x, y),
            normal: Vector2::x(),
        };
        let edgels = [
            edgel(f32::NAN, 1.0),
            edgel(-1.0, 1.0),
            edgel(1.0, 1e30),
            edgel(9.0, 9.0),
        ];
        assert_eq!(EdgelMap::new(&edgels, 10, 10).len(), 1);
        assert!(EdgelMap::new(&edgels, 0, 0).is_empty());
        assert_eq!(EdgelMap::new(&edgels, u32::MAX, u32::MAX).len(), 1);
        let empty = EdgelMap::default();
        assert!(
            empty
                .nearest(&Vector2::zeros(), &Vector2::x(), 1.0, 0.5, |_| true)
                .is_none()
        );
        let far = EdgelMap::new(&edgels, 10, 10);
        for x in [f64::NAN, f64::INFINITY, -1e300, 1e300] {
            assert!(
                far.nearest(&Vector2::new(x, x), &Vector2::x(), 1.0, 0.5, |_| true)
                    .is_none()
            );
        }
        let endless = LineSegment2::new(Vector2::zeros(), Vector2::new(1e300, 0.0));
        assert!(EdgelMap::of_segments(&[endless], 10, 10).is_empty());
    }
}
