//! Neighbours of a point among many.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::SVector;

/// Below this number of points a scan is as quick as a tree.
const MIN_POINTS_FOR_TREE: usize = 32;

/// A point of a [`PointIndex`] near a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Neighbour {
    /// Index of the point.
    pub index: usize,
    /// Its distance from the query.
    pub distance: f64,
}

/// Finite points, ready for radius queries.
pub(crate) struct PointIndex<const D: usize> {
    points: Vec<SVector<f64, D>>,
    tree: Option<ImmutableKdTree<f64, D>>,
}

impl<const D: usize> PointIndex<D> {
    /// Indexes `points`, which must be finite.
    pub(crate) fn new(points: Vec<SVector<f64, D>>) -> Self {
        let tree = if points.len() < MIN_POINTS_FOR_TREE {
            None
        } else {
            let rows: Vec<[f64; D]> = points.iter().map(|p| (*p).into()).collect();
            // A tree that cannot be built (more than 2³² points) leaves the scan.
            ImmutableKdTree::new_from_slice(&rows).ok()
        };
        Self { points, tree }
    }

    /// The points at most `radius` away from a finite `center`, by ascending
    /// index.
    pub(crate) fn within(&self, center: &SVector<f64, D>, radius: f64) -> Vec<Neighbour> {
        let neighbour = |index: usize| {
            let distance = (self.points[index] - center).norm();
            (distance <= radius).then_some(Neighbour { index, distance })
        };
        let Some(tree) = &self.tree else {
            return (0..self.points.len()).filter_map(neighbour).collect();
        };
        // The tree may round differently: ask for a little more, decide here.
        let squared_radius = radius * radius * (1.0 + 1e-9);
        let query: [f64; D] = (*center).into();
        let mut indices: Vec<usize> = tree
            .query(&query)
            .within::<SquaredEuclidean<f64>>(squared_radius)
            .unsorted()
            .execute()
            .into_iter()
            .map(|found| found.item as usize)
            .collect();
        indices.sort_unstable();
        indices.into_iter().filter_map(neighbour).collect()
    }

    /// The nearest point at most `radius` away; the lowest index among equals.
    pub(crate) fn nearest_within(
        &self,
        center: &SVector<f64, D>,
        radius: f64,
    ) -> Option<Neighbour> {
        self.within(center, radius)
            .into_iter()
            .min_by(|a, b| a.distance.total_cmp(&b.distance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;
    use nalgebra::Vector3;

    #[test]
    fn tree_and_scan_agree_even_on_coincident_points() {
        let mut noise = Noise(3);
        let mut points: Vec<_> = (0..300).map(|_| noise.vector()).collect();
        points.extend(std::iter::repeat_n(Vector3::new(0.1, 0.2, 0.3), 100));
        let tree = PointIndex::new(points.clone());
        assert!(tree.tree.is_some());
        let scan = PointIndex { points, tree: None };
        for _ in 0..50 {
            let center = noise.vector();
            assert_eq!(tree.within(&center, 0.4), scan.within(&center, 0.4));
            assert_eq!(
                tree.nearest_within(&center, 0.4),
                scan.nearest_within(&center, 0.4)
            );
        }
        let twins = tree.within(&Vector3::new(0.1, 0.2, 0.3), 0.0);
        assert_eq!(twins.len(), 100);
        assert_eq!(twins[0].index, 300);
    }

    #[test]
    fn nothing_is_near_in_an_empty_index() {
        let index = PointIndex::<3>::new(Vec::new());
        assert_eq!(index.nearest_within(&Vector3::zeros(), 9.0), None);
    }
}
