//! Random lines among the edges: how often chance supports one.

use nalgebra::Vector3;
use neat_core::LineSegment3;

/// Random numbers are the same in every run.
const SEED: u64 = 0x6e65_6174;

/// At most `max_decoys` lines, each as long as an edge and from a junction of the
/// wireframe in a random direction. Empty without edges.
pub(super) fn decoys(edges: &[LineSegment3], max_decoys: usize) -> Vec<LineSegment3> {
    let count = edges.len().min(max_decoys);
    let mut random = SplitMix(SEED);
    (0..count)
        .map(|i| {
            // Evenly spread over all edges.
            let length = edges[i * edges.len() / count].length();
            let from = edges[random.below(edges.len())];
            let start = if random.below(2) == 0 {
                from.start
            } else {
                from.end
            };
            LineSegment3::new(start, start + length * random.direction())
        })
        .collect()
}

/// SplitMix64 (Steele, Lea and Flood 2014).
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        (self.uniform() * count as f64) as usize
    }

    /// A unit vector, evenly distributed.
    fn direction(&mut self) -> Vector3<f64> {
        let z = 2.0 * self.uniform() - 1.0;
        let (sin, cos) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        Vector3::new(radius * cos, radius * sin, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoys_start_at_junctions_with_the_lengths_of_edges() {
        let edge = |x: f64| LineSegment3::new(Vector3::x() * x, Vector3::y() * x);
        let edges: Vec<_> = (1..100).map(|i| edge(f64::from(i))).collect();
        let found = decoys(&edges, 50);
        assert_eq!(found.len(), 50);
        assert_eq!(found, decoys(&edges, 50));
        for decoy in &found {
            let has_its_length =
                |edge: &LineSegment3| (edge.length() - decoy.length()).abs() < 1e-9;
            assert!(edges.iter().any(has_its_length));
            assert!(edges.iter().any(|edge| edge.ends().contains(&decoy.start)));
        }
        assert!(decoys(&[], 50).is_empty() && decoys(&edges, 0).is_empty());
    }
}
