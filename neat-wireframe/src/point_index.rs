//! Points that can be asked for those around a place.

use kiddo::leaf_strategies::VecOfArenas;
use kiddo::{EytzingerNoPf, KdTree, SquaredEuclidean};
use nalgebra::Vector3;

/// Kiddo's usual tree but for its prefetching, which computes addresses outside of what it owns.
type Tree = KdTree<f64, u32, EytzingerNoPf, VecOfArenas<f64, u32, 3, 32>, 3, 32>;

/// There are more points than an index holds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TooManyPoints;

/// An index of points, all of which are finite.
pub(crate) struct PointIndex {
    /// `None` without points: there is no nearest one.
    tree: Option<Tree>,
}

impl PointIndex {
    pub(crate) fn new(points: &[Vector3<f64>]) -> Result<Self, TooManyPoints> {
        if points.is_empty() {
            return Ok(Self { tree: None });
        }
        let coordinates: Vec<[f64; 3]> = points.iter().map(|p| [p.x, p.y, p.z]).collect();
        let tree = Tree::new_from_slice(&coordinates).map_err(|_| TooManyPoints)?;
        Ok(Self { tree: Some(tree) })
    }

    /// Distance from a place to the nearest point; `None` without points.
    pub(crate) fn distance(&self, place: &Vector3<f64>) -> Option<f64> {
        let nearest = (self.tree.as_ref()?)
            .query(&[place.x, place.y, place.z])
            .nearest_one::<SquaredEuclidean<f64>>()
            .execute();
        Some(nearest.distance.sqrt())
    }

    /// Indices of the points around a place, the nearest first; of two that are as near, the
    /// one that was given first.
    pub(crate) fn within(&self, place: &Vector3<f64>, radius: f64) -> Vec<usize> {
        let Some(tree) = &self.tree else {
            return Vec::new();
        };
        let found = tree
            .query(&[place.x, place.y, place.z])
            .within::<SquaredEuclidean<f64>>(radius * radius)
            .unsorted()
            .execute();
        let mut found: Vec<(f64, usize)> = (found.iter())
            .map(|found| (found.distance, found.item as usize))
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.into_iter().map(|(_, point)| point).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    #[test]
    fn what_is_near_comes_in_order_as_by_asking_all() {
        let mut noise = Noise(2);
        let mut points: Vec<_> = (0..200).map(|_| noise.vector()).collect();
        points.extend_from_within(..5);
        let index = PointIndex::new(&points).unwrap();
        for _ in 0..20 {
            let place = noise.vector();
            let squared = |point: &usize| (points[*point] - place).norm_squared();
            let mut expected: Vec<usize> = (0..points.len())
                .filter(|point| squared(point) < 0.25)
                .collect();
            expected.sort_by(|a, b| squared(a).total_cmp(&squared(b)));
            assert_eq!(index.within(&place, 0.5), expected);
            let nearest = points.iter().map(|point| (point - place).norm());
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            assert!((index.distance(&place).unwrap() - nearest).abs() < 1e-12);
        }
    }

    #[test]
    fn no_points_are_near_nothing() {
        let index = PointIndex::new(&[]).unwrap();
        assert!(index.within(&Vector3::zeros(), 1.0).is_empty());
        assert!(index.distance(&Vector3::zeros()).is_none());
    }
}
