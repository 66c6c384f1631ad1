//! Junction candidates: the modes of the density of segment ends, and the
//! perceived junctions that segment ends support.

use crate::index::{GrowingPointGrid, PointGrid, PointIndex, one_per_cell};
use crate::segment_ends::SegmentEnd;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Ends farther than this many sigmas from a point weigh less than 0.0004 of a
/// near one: leaving them out makes the search near-linear.
const KERNEL_RADIUS_IN_SIGMAS: f64 = 4.0;

/// Of the ends in a cube of this side one starts a search: more would climb the
/// same hill, and the time would grow with the square of the number of views.
const START_CELL_IN_SIGMAS: f64 = 1.0;

/// Standard deviation of the Gaussian kernel.
const SIGMA: f64 = 0.02;
/// Candidates keep more than this distance from each other.
const SEPARATION: f64 = 0.04;
/// A mode needs more kernel-weighted mass than this: about two good ends.
const MIN_MASS: f64 = 1.0;
/// Mean shift steps of every search.
const ITERATIONS: usize = 10;
/// A perceived junction is supported by the ends closer than this.
const PERCEIVED_RADIUS: f64 = 0.03;
/// A perceived junction needs more mass of ends than this.
const PERCEIVED_MIN_MASS: f64 = 1.0;

/// The modes of the weighted density of `ends`, heaviest first.
///
/// Mean shift from ends in all places; of modes closer than the separation the
/// heaviest stays.
pub fn junction_modes(ends: &[SegmentEnd]) -> Vec<Vector3<f64>> {
    let positions = ends.iter().map(|end| end.position);
    let grid = PointGrid::new(positions.clone(), KERNEL_RADIUS_IN_SIGMAS * SIGMA);
    let starts = one_per_cell(positions, START_CELL_IN_SIGMAS * SIGMA);
    let modes = starts
        .par_iter()
        .map(|start| climb(*start, ends, &grid))
        .collect();
    separated(modes, MIN_MASS, SEPARATION, &[])
}

/// The perceived junctions (NEAT, global junction perceiving) that enough segment
/// ends support and that keep the separation from `present` and from each other,
/// best supported first.
pub fn supported_junctions(
    perceived: &[Vector3<f64>],
    ends: &[SegmentEnd],
    present: &[Vector3<f64>],
) -> Vec<Vector3<f64>> {
    let index = PointIndex::new(ends.iter().map(|end| end.position).collect());
    let candidates = perceived
        .iter()
        .filter(|position| position.iter().all(|x| x.is_finite()))
        .map(|position| {
            let near = index.within(position, PERCEIVED_RADIUS);
            let mass = near
                .iter()
                .filter(|neighbour| neighbour.distance < PERCEIVED_RADIUS)
                .map(|neighbour| ends[neighbour.index].weight)
                .sum();
            (*position, mass)
        })
        .collect();
    separated(candidates, PERCEIVED_MIN_MASS, SEPARATION, present)
}

/// Follows the mean shift from `start`; the mode with its mass.
fn climb(start: Vector3<f64>, ends: &[SegmentEnd], grid: &PointGrid) -> (Vector3<f64>, f64) {
    let by_squared_distance = -0.5 / (SIGMA * SIGMA);
    let kernel_sums = |at: &Vector3<f64>| {
        let mut mass = 0.0;
        let mut weighted_sum = Vector3::zeros();
        grid.for_each_within(at, |index, position, squared_distance| {
            let kernel = ends[index].weight * (by_squared_distance * squared_distance).exp();
            mass += kernel;
            weighted_sum += kernel * position;
        });
        (mass, weighted_sum)
    };
    let mut mode = start;
    for _ in 0..ITERATIONS {
        let (mass, weighted_sum) = kernel_sums(&mode);
        if mass > 0.0 {
            mode = weighted_sum / mass;
        }
    }
    (mode, kernel_sums(&mode).0)
}

/// The candidates with more than `min_mass`, heaviest first, each farther than
/// `separation` from the accepted ones and from `present`.
fn separated(
    mut candidates: Vec<(Vector3<f64>, f64)>,
    min_mass: f64,
    separation: f64,
    present: &[Vector3<f64>],
) -> Vec<Vector3<f64>> {
    candidates.retain(|(_, mass)| *mass > min_mass);
    // A stable sort: of equal masses the first comes first.
    candidates.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut grid = GrowingPointGrid::new(separation);
    for position in present {
        grid.push(*position);
    }
    let mut accepted = Vec::new();
    for (position, _) in candidates {
        let near = grid.first_near(&position, |_, distance| distance <= separation);
        if near.is_none() {
            accepted.push(position);
            grid.push(position);
        }
    }
    accepted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;
    use nalgebra::Vector2;

    fn end(position: Vector3<f64>, weight: f64) -> SegmentEnd {
        SegmentEnd {
            position,
            view: 0,
            pixel: Vector2::zeros(),
            weight,
        }
    }

    fn noisy_clusters(centers: usize) -> (Vec<Vector3<f64>>, Vec<SegmentEnd>) {
        let mut noise = Noise(11);
        let centers: Vec<_> = (0..centers).map(|_| 2.0 * noise.vector()).collect();
        let ends = centers
            .iter()
            .flat_map(|center| {
                (0..20)
                    .map(|_| {
                        end(
                            center + 0.02 * noise.vector(),
                            0.75 + 0.25 * noise.uniform(),
                        )
                    })
                    .collect::<Vec<_>>()
            })
            .collect();
        (centers, ends)
    }

    /// The definition: every end pulls on every start.
    fn all_pairs_modes(ends: &[SegmentEnd]) -> Vec<Vector3<f64>> {
        let kernel = |end: &SegmentEnd, at: &Vector3<f64>| {
            let squared = (end.position - at).norm_squared();
            end.weight * (-squared / (2.0 * SIGMA * SIGMA)).exp()
        };
        let modes = ends
            .iter()
            .map(|start| {
                let mut x = start.position;
                for _ in 0..ITERATIONS {
                    let sum: Vector3<f64> = ends.iter().map(|e| kernel(e, &x) * e.position).sum();
                    x = sum / ends.iter().map(|e| kernel(e, &x)).sum::<f64>();
                }
                (x, ends.iter().map(|e| kernel(e, &x)).sum())
            })
            .collect();
        separated(modes, MIN_MASS, SEPARATION, &[])
    }

    #[test]
    fn modes_are_those_of_the_all_pairs_form() {
        let (centers, ends) = noisy_clusters(15);
        let modes = junction_modes(&ends);
        let oracle = all_pairs_modes(&ends);
        assert_eq!(modes.len(), centers.len());
        assert_eq!(modes.len(), oracle.len());
        for (mode, expected) in modes.iter().zip(&oracle) {
            assert!((mode - expected).norm() < 1e-4, "{mode} {expected}");
        }
        for center in centers {
            assert!(modes.iter().any(|mode| (mode - center).norm() < 0.02));
        }
    }

    #[test]
    fn a_lone_end_is_no_mode() {
        let lone = end(Vector3::new(0.3, 0.0, 0.0), 1.0);
        assert!(junction_modes(&[lone]).is_empty());
        assert!(junction_modes(&[]).is_empty());
        assert_eq!(junction_modes(&[lone, lone]), [lone.position]);
    }

    #[test]
    fn perceived_junctions_need_support_and_distance() {
        let at = |x: f64| Vector3::new(x, 0.0, 0.0);
        let ends: Vec<_> = [0.0, 0.001, 0.5, 0.5, 0.51, 0.9]
            .iter()
            .map(|x| end(at(*x), 0.8))
            .collect();
        let perceived = [at(0.01), at(0.49), at(0.52), at(0.9), at(f64::NAN)];
        // 0.49 wins over 0.52: first of equal masses. 0.9 has one end only.
        assert_eq!(
            supported_junctions(&perceived, &ends, &[]),
            [at(0.49), at(0.01)]
        );
        assert_eq!(
            supported_junctions(&perceived, &ends, &[at(0.0)]),
            [at(0.49)]
        );
    }
}
