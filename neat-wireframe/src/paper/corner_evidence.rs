//! Whether 2D segments end at a junction because a corner is there. Not in the paper.
//!
//! A detector cuts a curve into segments, or a long line, somewhere else in each view, and the
//! field puts junctions where it may. They attract whatever ends nearby. Around a corner ends
//! lie as near as the detector puts them; of cuts the nearest junction tells nothing. So the
//! distances of the ends that a junction attracts, along which a segment may be cut, are
//! explained by both:
//!
//! - a corner: Cauchy's distribution, whose scale the corners of the scene tell, and
//! - cuts: any distance up to the gate is as likely as any other.

use crate::statistics::upper_median;

/// What has been fitted to the ends of a corner.
const COORDINATES: f64 = 3.0;
/// Scale and corners depend on each other. They settle in two or three rounds.
const MAX_ROUNDS: usize = 10;

/// For each junction what speaks for a corner there, in nats. A corner has more than none.
///
/// `distances` are those of the ends that it attracts from its projection, in pixels; none is
/// larger than `gate`. The scale of the ends around corners is never taken for less than
/// `min_scale`.
///
/// The fit of its coordinates costs a corner half the logarithm of the number of all ends for
/// each (Schwarz's criterion): some ends are near each other anywhere.
pub(super) fn corner_evidence(distances: &[Vec<f64>], gate: f64, min_scale: f64) -> Vec<f64> {
    let count: usize = distances.iter().map(Vec::len).sum();
    let cost = 0.5 * COORDINATES * (count.max(1) as f64).ln();
    let mut is_corner = vec![true; distances.len()];
    let mut evidence = Vec::new();
    for _ in 0..MAX_ROUNDS {
        let of_corners = distances.iter().zip(&is_corner).filter(|(_, is)| **is);
        let mut ends: Vec<f64> = of_corners.flat_map(|(ends, _)| ends).copied().collect();
        // Half of Cauchy's magnitudes are smaller than its scale.
        let scale = upper_median(&mut ends).max(min_scale);
        let of_junction = |ends: &Vec<f64>| {
            let gains = ends.iter().map(|end| corner_over_cut(*end, scale, gate));
            gains.sum::<f64>() - cost
        };
        evidence = distances.iter().map(of_junction).collect();
        let now: Vec<bool> = evidence.iter().map(|nats| *nats > 0.0).collect();
        if now == is_corner || !now.contains(&true) {
            break;
        }
        is_corner = now;
    }
    evidence
}

/// Logarithm of how much likelier an end is so far from a corner than from a cut.
fn corner_over_cut(distance: f64, scale: f64, gate: f64) -> f64 {
    let ratio = distance / scale;
    let corner = (scale * (gate / scale).atan() * (1.0 + ratio * ratio)).recip();
    (corner * gate).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    const GATE: f64 = 10.0;

    #[test]
    fn both_explanations_are_distributions() {
        let cells = 100_000;
        let at = |cell: usize| GATE * (cell as f64 + 0.5) / f64::from(cells as u32);
        for scale in [0.05, 0.5, 5.0] {
            let mean = (0..cells)
                .map(|cell| corner_over_cut(at(cell), scale, GATE).exp())
                .sum::<f64>()
                / cells as f64;
            assert!((mean - 1.0).abs() < 1e-3, "{mean}");
        }
    }

    /// Ends around a corner with this noise, and as many cuts.
    fn ends(noise: &mut Noise, count: usize, scale: f64) -> Vec<f64> {
        (0..count).map(|_| scale * noise.uniform().abs()).collect()
    }

    #[test]
    fn corners_are_told_from_cuts_whatever_the_noise_and_however_many() {
        let mut noise = Noise(1);
        for (scale, corners, cuts) in [(0.5, 8, 24), (2.0, 8, 8), (0.5, 8, 0), (0.01, 2, 20)] {
            let mut distances: Vec<Vec<f64>> =
                (0..corners).map(|_| ends(&mut noise, 40, scale)).collect();
            distances.extend((0..cuts).map(|_| ends(&mut noise, 25, GATE)));
            let evidence = corner_evidence(&distances, GATE, 1.0);
            assert!(evidence[..corners].iter().all(|nats| *nats > 0.0));
            assert!(evidence[corners..].iter().all(|nats| *nats < 0.0));
        }
    }

    #[test]
    fn few_ends_are_no_corner() {
        let mut noise = Noise(2);
        let mut distances = vec![ends(&mut noise, 40, 0.5); 3];
        distances.extend([vec![], vec![0.2; 3], vec![0.2; 6]]);
        let evidence = corner_evidence(&distances, GATE, 1.0);
        assert!(evidence[3] < 0.0 && evidence[4] < 0.0 && evidence[5] > 0.0);
        assert!(corner_evidence(&[], GATE, 1.0).is_empty());
    }
}
