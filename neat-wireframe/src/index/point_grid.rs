//! Neighbours of a point among many, without allocation: grids of cells in space.

use nalgebra::Vector3;
use std::collections::{HashMap, HashSet};

/// Cells are this much wider than the radius of the queries, so that rounding
/// puts no neighbour two cells away.
const SLACK: f64 = 1.0 + 1e-9;
/// Cells have at least this side, whatever the radius.
const MIN_CELL: f64 = 1e-9;

type Cell = [i64; 3];

fn cell_of(point: &Vector3<f64>, side: f64) -> Cell {
    // Casts saturate: far points share a cell.
    point.map(|x| (x / side).floor() as i64).into()
}

/// Finite points for many queries with one radius.
pub(crate) struct PointGrid {
    side: f64,
    radius: f64,
    /// Sorted by z, y, x of the cell and then by index.
    entries: Vec<Entry>,
}

struct Entry {
    cell: Cell,
    index: usize,
    point: Vector3<f64>,
}

impl Entry {
    fn key(&self) -> [i64; 3] {
        let [x, y, z] = self.cell;
        [z, y, x]
    }
}

impl PointGrid {
    /// Indexes `points` for queries with this radius.
    pub(crate) fn new(points: impl Iterator<Item = Vector3<f64>>, radius: f64) -> Self {
        // Half the radius: fewer points beyond it are looked at.
        let side = (0.5 * radius * SLACK).max(MIN_CELL);
        let mut entries: Vec<Entry> = points
            .enumerate()
            .map(|(index, point)| Entry {
                cell: cell_of(&point, side),
                index,
                point,
            })
            .collect();
        entries.sort_by_key(|entry| (entry.key(), entry.index));
        Self {
            side,
            radius,
            entries,
        }
    }

    /// Names every point at most the radius away with its squared distance, in
    /// an order that depends on the points alone.
    pub(crate) fn for_each_within(
        &self,
        center: &Vector3<f64>,
        mut visit: impl FnMut(usize, &Vector3<f64>, f64),
    ) {
        let squared_radius = self.radius * self.radius;
        let [x, y, z] = cell_of(center, self.side);
        let around = |i: i64| i.saturating_sub(2)..=i.saturating_add(2);
        for z in around(z) {
            for y in around(y) {
                // The cells of a row lie one after the other.
                let first = [z, y, x.saturating_sub(2)];
                let last = [z, y, x.saturating_add(2)];
                let begin = self.entries.partition_point(|entry| entry.key() < first);
                for entry in &self.entries[begin..] {
                    if entry.key() > last {
                        break;
                    }
                    let squared_distance = (entry.point - center).norm_squared();
                    if squared_distance <= squared_radius {
                        visit(entry.index, &entry.point, squared_distance);
                    }
                }
            }
        }
    }
}

/// Points that come one by one, for queries in between.
pub(crate) struct GrowingPointGrid {
    side: f64,
    points: Vec<Vector3<f64>>,
    /// Only ever looked up: its order plays no role.
    cells: HashMap<Cell, Vec<usize>>,
}

impl GrowingPointGrid {
    /// For queries up to this radius.
    pub(crate) fn new(radius: f64) -> Self {
        Self {
            side: (radius * SLACK).max(MIN_CELL),
            points: Vec::new(),
            cells: HashMap::new(),
        }
    }

    /// Adds a point; its index is the number of points before it.
    pub(crate) fn push(&mut self, point: Vector3<f64>) {
        let cell = cell_of(&point, self.side);
        self.cells.entry(cell).or_default().push(self.points.len());
        self.points.push(point);
    }

    /// The earliest point that, by its index and its distance from `center`, passes
    /// the test, which holds only for distances up to the radius.
    pub(crate) fn first_near(
        &self,
        center: &Vector3<f64>,
        is_near: impl Fn(usize, f64) -> bool,
    ) -> Option<usize> {
        let [x, y, z] = cell_of(center, self.side);
        let around = |i: i64| [i.saturating_sub(1), i, i.saturating_add(1)];
        let mut first: Option<usize> = None;
        for x in around(x) {
            for y in around(y) {
                for z in around(z) {
                    let near = self
                        .cells
                        .get(&[x, y, z])
                        .into_iter()
                        .flatten()
                        .find(|index| is_near(**index, (self.points[**index] - center).norm()));
                    first = first.into_iter().chain(near.copied()).min();
                }
            }
        }
        first
    }
}

/// The first point in every cell of a grid, in the order of the points.
pub(crate) fn one_per_cell(
    points: impl Iterator<Item = Vector3<f64>>,
    side: f64,
) -> Vec<Vector3<f64>> {
    let side = side.max(MIN_CELL);
    let mut taken = HashSet::new();
    points
        .filter(|point| taken.insert(cell_of(point, side)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    fn points(count: usize) -> Vec<Vector3<f64>> {
        let mut noise = Noise(3);
        let mut points: Vec<_> = (0..count).map(|_| noise.vector()).collect();
        points.extend(std::iter::repeat_n(Vector3::new(0.1, 0.2, 0.3), 9));
        points
    }

    #[test]
    fn a_grid_names_what_a_scan_names() {
        let points = points(400);
        for radius in [0.3, 1e-12, 5.0, 0.0] {
            let grid = PointGrid::new(points.iter().copied(), radius);
            for center in &points[380..] {
                let mut named = Vec::new();
                grid.for_each_within(center, |index, point, squared_distance| {
                    assert_eq!(*point, points[index]);
                    assert_eq!(squared_distance, (point - center).norm_squared());
                    named.push(index);
                });
                named.sort_unstable();
                let scanned: Vec<_> = (0..points.len())
                    .filter(|i| (points[*i] - center).norm_squared() <= radius * radius)
                    .collect();
                assert_eq!(named, scanned);
            }
        }
    }

    #[test]
    fn a_growing_grid_finds_the_earliest_near_point() {
        let points = points(400);
        for radius in [0.2, 0.0, f64::INFINITY] {
            let mut grid = GrowingPointGrid::new(radius);
            for (count, point) in points.iter().enumerate() {
                let scanned = (0..count).find(|i| (points[*i] - point).norm() <= radius);
                assert_eq!(
                    grid.first_near(point, |_, distance| distance <= radius),
                    scanned
                );
                grid.push(*point);
            }
        }
    }

    #[test]
    fn the_first_point_of_a_cell_stands_for_the_others() {
        let at = |x: f64| Vector3::new(x, 0.0, 0.0);
        let points = [at(0.4), at(0.1), at(-0.1), at(1.2), at(0.9)];
        assert_eq!(
            one_per_cell(points.into_iter(), 1.0),
            [at(0.4), at(-0.1), at(1.2)]
        );
    }

    #[test]
    fn points_may_lie_anywhere() {
        let far = Vector3::new(1e300, -1e300, f64::MAX);
        let grid = PointGrid::new([far].into_iter(), 0.1);
        let mut found = 0;
        grid.for_each_within(&far, |_, _, _| found += 1);
        assert_eq!(found, 1);
        let mut grid = GrowingPointGrid::new(0.1);
        grid.push(far);
        assert_eq!(grid.first_near(&far, |_, distance| distance < 0.1), Some(0));
    }
}
