//! Whether views that look alike also have poses alike.

use crate::evidence::Gathered;
use neat_core::Camera;

/// Trials with poses in a random order.
const TRIALS: usize = 200;
/// Standard deviations by which the given order has to stand out.
const SIGNIFICANT: f64 = 3.5;

/// Whether views that look alike are turned alike, more than with poses in a
/// random order. Conventions of axes do not change by how much two cameras are
/// turned against each other, except that inverted poses count for themselves.
pub(crate) fn poses_follow_likeness(gathered: &Gathered, cameras: &[Camera]) -> bool {
    let count = gathered.views.len();
    [false, true].into_iter().any(|inverted| {
        // The cosine of the angle between two rotations, but for a factor.
        let alike = |i: usize, j: usize| {
            let [a, b] = [i, j].map(|index| {
                let rotation = cameras[gathered.views[index]].world_from_camera;
                if inverted {
                    rotation.transpose()
                } else {
                    rotation
                }
            });
            a.dot(&b)
        };
        let mut rng = SplitMix(0x6e65_6174);
        let mut order: Vec<usize> = (0..count).collect();
        let mut sums = Vec::with_capacity(TRIALS);
        let given = sum(&gathered.likeness, &order, &alike);
        for _ in 0..TRIALS {
            for i in (1..count).rev() {
                order.swap(i, rng.below(i + 1));
            }
            sums.push(sum(&gathered.likeness, &order, &alike));
        }
        let mean = sums.iter().sum::<f64>() / TRIALS as f64;
        let variance = sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f64>() / TRIALS as f64;
        given - mean > SIGNIFICANT * variance.sqrt()
    })
}

/// Σ likeness of views · likeness of poses, with the poses in `order`.
fn sum(likeness: &[f64], order: &[usize], alike: &impl Fn(usize, usize) -> f64) -> f64 {
    let count = order.len();
    let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
    pairs
        .zip(likeness)
        .map(|((i, j), likeness)| likeness * alike(order[i], order[j]))
        .sum()
}

/// A small generator of random numbers (Steele et al. 2014): which ones does
/// not matter here, only that they are always the same.
struct SplitMix(u64);

impl SplitMix {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % limit as u64) as usize
    }
}
