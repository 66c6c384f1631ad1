//! Thinning of points to a density, as DTU's official evaluation does.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::HashMap;

/// Takes points in a random order and keeps those that have no kept point within
/// `radius`.
///
/// The published code shuffles without a seed; the same `seed` gives the same
/// points here. They are returned in the order in which they were taken.
pub fn thin_points(points: &[Vector3<f64>], radius: f64, seed: u64) -> Vec<Vector3<f64>> {
    let mut shuffled = points.to_vec();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for last in (1..shuffled.len()).rev() {
        shuffled.swap(last, rng.random_range(0..=last));
    }
    if radius.is_nan() || radius <= 0.0 {
        return shuffled;
    }
    // Cells of the size of the radius: neighbours lie in the 27 around a point.
    let mut kept_in_cell: HashMap<[i64; 3], Vec<Vector3<f64>>> = HashMap::new();
    shuffled.retain(|point| {
        let cell = [point.x, point.y, point.z].map(|x| (x / radius).floor() as i64);
        let is_free = !neighbouring_cells(cell)
            .filter_map(|cell| kept_in_cell.get(&cell))
            .flatten()
            .any(|kept| (kept - point).norm() <= radius);
        if is_free {
            kept_in_cell.entry(cell).or_default().push(*point);
        }
        is_free
    });
    shuffled
}

fn neighbouring_cells([x, y, z]: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(move |i| {
        [
            x.saturating_add(i % 3 - 1),
            y.saturating_add(i / 3 % 3 - 1),
            z.saturating_add(i / 9 - 1),
        ]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_points_are_apart_and_cover_the_rest() {
        let points: Vec<Vector3<f64>> = (0..2000)
            .map(|i| {
                let t = f64::from(i);
                Vector3::new((t * 0.618) % 3.0 - 1.5, (t * 0.317) % 2.0, (t * 0.09) % 0.3)
            })
            .collect();
        let kept = thin_points(&points, 0.2, 3);
        assert_eq!(kept, thin_points(&points, 0.2, 3));
        assert_ne!(kept, thin_points(&points, 0.2, 4));
        for (i, a) in kept.iter().enumerate() {
            assert!(kept[..i].iter().all(|b| (a - b).norm() > 0.2));
        }
        for point in &points {
            assert!(kept.iter().any(|k| (k - point).norm() <= 0.2));
        }
    }

    #[test]
    fn a_radius_of_nothing_keeps_all() {
        let points = [Vector3::zeros(), Vector3::new(1e300, 0.0, -1e300)];
        assert_eq!(thin_points(&points, 0.0, 0).len(), 2);
        assert_eq!(thin_points(&points, 0.2, 0).len(), 2);
        assert!(thin_points(&[], 0.2, 0).is_empty());
    }
}
