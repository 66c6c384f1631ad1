//! Density-based clustering of points in space (DBSCAN).
//!
//! Rendered end points pile up where the scene has a junction and scatter where
//! the field is still wrong; the means of the piles are the candidates for
//! junctions (paper §4.2).

use kiddo::leaf_strategies::VecOfArenas;
use kiddo::{EytzingerNoPf, KdTree, SquaredEuclidean};

/// Query radii are widened by this factor: the tree may round at the boundary,
/// the distance test behind it does not.
const RADIUS_MARGIN: f64 = 1.0 + 1e-9;

/// A partition of points into clusters and noise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clusters {
    /// The cluster of each point; `None` is noise.
    pub labels: Vec<Option<usize>>,
    /// Mean of each cluster's points, in label order.
    pub means: Vec<[f32; 3]>,
}

/// Clusters `points` as scikit-learn's `DBSCAN` does, and averages each cluster.
///
/// A *core* point has at least `min_samples` points within `eps`, itself
/// included; the boundary is inclusive. A cluster is a connected component of
/// core points, plus the other points within `eps` of one of them; a point in
/// reach of several clusters joins the first. Clusters are numbered by their
/// lowest core point. With `min_samples` 2, as published (`eps` 0.01 in world
/// units), these are the connected components of two and more points.
///
/// Points that are not finite are noise; so is everything if `eps` is negative
/// or NaN. Without any cluster `means` is empty (the published code crashes
/// there).
///
/// # Panics
/// If there are more than `u32::MAX` points.
///
/// # Example
/// ```
/// use neat_gjp::clustering::dbscan_means;
///
/// let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.5]];
/// let clusters = dbscan_means(&points, 0.5, 2);
/// assert_eq!(clusters.labels, [Some(0), None, Some(0)]);
/// assert_eq!(clusters.means, [[0.0, 0.0, 0.25]]);
/// ```
pub fn dbscan_means(points: &[[f32; 3]], eps: f64, min_samples: usize) -> Clusters {
    let labels = dbscan(points, eps, min_samples);
    let means = means(points, &labels);
    Clusters { labels, means }
}

fn dbscan(points: &[[f32; 3]], eps: f64, min_samples: usize) -> Vec<Option<usize>> {
    let mut labels = vec![None; points.len()];
    if eps.is_nan() || eps < 0.0 {
        return labels;
    }
    let neighborhoods = Neighborhoods::new(points, eps);
    let mut neighbors = Vec::new();
    let mut to_expand = Vec::new();
    let mut count = 0;
    for seed in 0..points.len() {
        if labels[seed].is_some() {
            continue;
        }
        neighborhoods.query(seed, &mut neighbors);
        // Not finite: alone without even itself, or no core point: noise, unless
        // a later cluster reaches it.
        if neighbors.is_empty() || neighbors.len() < min_samples {
            continue;
        }
        labels[seed] = Some(count);
        to_expand.push(seed);
        while let Some(point) = to_expand.pop() {
            neighborhoods.query(point, &mut neighbors);
            if neighbors.len() < min_samples {
                continue; // A border point: in the cluster, but not a bridge.
            }
            for &neighbor in &neighbors {
                if labels[neighbor].is_none() {
                    labels[neighbor] = Some(count);
                    to_expand.push(neighbor);
                }
            }
        }
        count += 1;
    }
    labels
}

fn means(points: &[[f32; 3]], labels: &[Option<usize>]) -> Vec<[f32; 3]> {
    let count = labels.iter().flatten().max().map_or(0, |last| last + 1);
    let mut sums = vec![([0.0f64; 3], 0usize); count];
    for (point, label) in points.iter().zip(labels) {
        if let Some(label) = label {
            let (sum, size) = &mut sums[*label];
            for axis in 0..3 {
                sum[axis] += f64::from(point[axis]);
            }
            *size += 1;
        }
    }
    sums.iter()
        .map(|(sum, size)| sum.map(|total| (total / *size as f64) as f32))
        .collect()
}

/// Kiddo's usual tree but for its prefetching, which computes addresses outside of what it owns.
type Tree = KdTree<f64, u32, EytzingerNoPf, VecOfArenas<f64, u32, 3, 32>, 3, 32>;

/// Which points lie within `eps` of which, both inclusive.
struct Neighborhoods {
    points: Vec<[f64; 3]>,
    /// Over the finite points only: a NaN breaks the order of a k-d tree.
    tree: Tree,
    /// Point index of each item of the tree.
    finite: Vec<usize>,
    squared_eps: f64,
}

impl Neighborhoods {
    fn new(points: &[[f32; 3]], eps: f64) -> Self {
        let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        let is_finite = |&i: &usize| points[i].iter().all(|c| c.is_finite());
        let finite: Vec<usize> = (0..points.len()).filter(is_finite).collect();
        let in_tree: Vec<[f64; 3]> = finite.iter().map(|&i| points[i]).collect();
        Self {
            tree: Tree::new_from_slice(&in_tree).expect("dbscan_means: more than u32::MAX points"),
            points,
            finite,
            squared_eps: eps * eps,
        }
    }

    /// Writes the neighbours of a point, itself included, over `neighbors`. A
    /// point that is not finite has none.
    fn query(&self, point: usize, neighbors: &mut Vec<usize>) {
        neighbors.clear();
        let center = &self.points[point];
        if self.finite.is_empty() || center.iter().any(|c| !c.is_finite()) {
            return;
        }
        let in_reach = self
            .tree
            .query(center)
            .within::<SquaredEuclidean<f64>>(self.squared_eps * RADIUS_MARGIN)
            .unsorted()
            .execute();
        neighbors.extend(
            in_reach
                .iter()
                .map(|found| self.finite[found.item as usize])
                .filter(|&other| squared_distance(center, &self.points[other]) <= self.squared_eps),
        );
    }
}

fn squared_distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum()
}
