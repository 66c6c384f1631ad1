//! Whether 2D segments end at a junction because a corner is there. Not in the paper.
//!
//! A detector cuts a curve into segments, or a long line, somewhere else in each view, and the
//! field puts junctions where it may. They attract whatever ends nearby. Around a corner ends
//! lie as near as the detector puts them; of cuts the nearest junction tells nothing. So the
//! distances of the ends that a junction attracts are explained in two ways:
//!
//! - by cuts: any distance up to the gate is as likely as any other;
//! - by a corner, around which some share of the ends has Cauchy's distribution, and cuts.

/// What has been fitted to the ends of a corner.
const COORDINATES: f64 = 3.0;
/// Rounds of expectation and maximisation in which shares of ends are found.
const ROUNDS: usize = 50;

/// What speaks for a corner that attracts ends at these `distances` in pixels, none of them
/// larger than `gate`, in nats. Around corners half of the ends lie nearer than `scale`.
///
/// Its coordinates have been fitted to these ends, which costs half the logarithm of their
/// number for each (Schwarz's criterion). Of no ends nothing speaks.
pub(super) fn corner_evidence(distances: &[f64], gate: f64, scale: f64) -> f64 {
    let distances: Vec<[f64; 1]> = distances.iter().map(|distance| [*distance]).collect();
    explained(&distances, gate, scale) - 0.5 * COORDINATES * (distances.len().max(1) as f64).ln()
}

/// By how much ends at these distances from each of `N` corners are likelier than if all were
/// cuts, in nats, where each corner and the cuts have their likeliest shares.
pub(super) fn explained<const N: usize>(distances: &[[f64; N]], gate: f64, scale: f64) -> f64 {
    let by_cut = |distance: f64| match distance < gate {
        true => corner_by_cut(distance, gate, scale),
        false => 0.0,
    };
    let ratios: Vec<[f64; N]> = distances.iter().map(|end| end.map(by_cut)).collect();
    let likelihood = |shares: &[f64; N], ratios: &[f64; N]| {
        let of_corners: f64 = shares.iter().zip(ratios).map(|(w, ratio)| w * ratio).sum();
        1.0 - shares.iter().sum::<f64>() + of_corners
    };
    let mut shares = [1.0 / (N + 1) as f64; N];
    for _ in 0..ROUNDS {
        let mut expected = [0.0; N];
        for end in &ratios {
            let all = likelihood(&shares, end);
            for corner in 0..N {
                expected[corner] += shares[corner] * end[corner] / all;
            }
        }
        shares = expected.map(|ends| ends / ratios.len().max(1) as f64);
    }
    let gains = ratios.iter().map(|end| likelihood(&shares, end).ln());
    gains.sum()
}

/// How much likelier an end is so far from a corner than from a cut.
fn corner_by_cut(distance: f64, gate: f64, scale: f64) -> f64 {
    let ratio = distance / scale;
    gate / (scale * (gate / scale).atan() * (1.0 + ratio * ratio))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    const GATE: f64 = 10.0;

    #[test]
    fn both_explanations_are_distributions() {
        let cells = 100_000;
        let at = |cell: u32| GATE * (f64::from(cell) + 0.5) / f64::from(cells);
        for scale in [0.05, 0.5, 5.0] {
            let sum: f64 = (0..cells)
                .map(|cell| corner_by_cut(at(cell), GATE, scale))
                .sum();
            assert!((sum / f64::from(cells) - 1.0).abs() < 1e-3, "{sum}");
        }
    }

    fn ends(noise: &mut Noise, count: usize, farthest: f64) -> Vec<f64> {
        let end = |_| farthest * noise.uniform().abs();
        (0..count).map(end).collect()
    }

    #[test]
    fn corners_are_told_from_cuts() {
        let mut noise = Noise(1);
        let evidence = |ends: &[f64]| corner_evidence(ends, GATE, 1.0);
        for _ in 0..100 {
            let corner = ends(&mut noise, 20, 1.0);
            let cuts = ends(&mut noise, 20, GATE);
            assert!(evidence(&corner) > 20.0);
            assert!(evidence(&cuts) < 0.0);
            // Ends that belong elsewhere do not hide a corner.
            assert!(evidence(&[corner, cuts].concat()) > 0.0);
        }
    }

    #[test]
    fn one_end_is_a_corner_and_none_or_far_ones_are_not() {
        assert!(corner_evidence(&[0.1], GATE, 1.0) > 0.0);
        assert!(corner_evidence(&[], GATE, 1.0) <= 0.0);
        assert!(corner_evidence(&[5.0; 10], GATE, 1.0) < 0.0);
    }
}
